//! What is known of each block of 4 x 4 x 4 cells, as bits by the numbers of the cells in it.
//!
//! Blocks without an explored cell take four bytes. The others are in the order in which they were
//! first explored, so that near blocks are mostly near in memory.
//!
//! Invariants: a block has words if and only if one of its cells is explored; its open cells are up
//! to date unless it is stale.

use voxels::CellSet;

use super::delta::Layout;

/// What is known of the cells of a block: a line of the cache.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(align(64))]
pub(super) struct Words {
    /// The explored cells.
    pub(super) known: u64,
    /// Those of them that are wall.
    pub(super) wall: u64,
    /// Those that have been visited.
    pub(super) covered: u64,
    /// Those that the own sensor found, apart from the mark of coverage.
    pub(super) own: u64,
    /// Those that the own sensor has scanned, and not only visited.
    pub(super) scanned: u64,
    /// The frontiers: free cells with an unexplored face neighbour inside the map.
    pub(super) frontier: u64,
    /// Those that have become known since the frontiers were brought up to date.
    fresh: u64,
    /// The length of the journal after the last change that was more than a mark of coverage: less
    /// than 2^30 on the largest map.
    pub(super) revealed: u32,
    /// Whether the block has changed since the frontiers were brought up to date.
    is_fresh: bool,
}

/// The blocks of a map.
#[derive(Debug, Clone)]
pub(super) struct Blocks {
    layout: Layout,
    /// By block 1 + the place of its words, or 0.
    places: Vec<u32>,
    words: Vec<Words>,
    /// The blocks whose frontiers may have changed.
    stale: CellSet,
    /// The blocks that have changed: they and those beside them are not among the stale ones yet.
    fresh: Vec<u32>,
}

impl Blocks {
    /// The unexplored blocks of a map.
    pub(super) fn new(layout: Layout) -> Self {
        let count = layout.count() as usize;
        Self { layout, places: vec![0; count], words: Vec::new(), stale: CellSet::new(count), fresh: Vec::new() }
    }

    /// What is known of a block; `None`: there is no such block.
    #[inline]
    pub(super) fn get(&self, block: u32) -> Option<Words> {
        let &place = self.places.get(block as usize)?;
        Some(place.checked_sub(1).map_or_else(Words::default, |place| self.words[place as usize]))
    }

    /// What is known of a block of the map, to be changed.
    #[inline]
    pub(super) fn of(&mut self, block: u32) -> &mut Words {
        words_of(&mut self.places, &mut self.words, block)
    }

    /// What is known of a block that changes; those of its changed cells that were unexplored also
    /// concern the blocks beside it.
    #[inline]
    pub(super) fn change(&mut self, block: u32, explored: u64) -> &mut Words {
        let words = words_of(&mut self.places, &mut self.words, block);
        if !std::mem::replace(&mut words.is_fresh, true) {
            self.fresh.push(block);
        }
        words.fresh |= explored;
        words
    }

    /// Adds the blocks that have changed to the stale ones, and those beside them.
    fn note_stale(&mut self) {
        let mut fresh = std::mem::take(&mut self.fresh);
        for block in fresh.drain(..) {
            let words = self.of(block);
            words.is_fresh = false;
            let explored = std::mem::take(&mut words.fresh);
            self.stale.insert(block as usize);
            if explored & SURFACE == 0 {
                continue;
            }
            for (beside, layer) in self.layout.beside(block).into_iter().zip(FACE_LAYERS) {
                if explored & layer != 0
                    && let Some(beside) = beside
                    && self.places[beside as usize] != 0
                {
                    self.stale.insert(beside as usize);
                }
            }
        }
        // Its memory serves the next changes.
        self.fresh = fresh;
    }

    /// Brings the frontiers of all blocks up to date; `changed` gets each block with frontiers that
    /// changed, and the words of those that there were before and that there are now.
    pub(super) fn update_frontiers(&mut self, mut changed: impl FnMut(u32, u64, u64)) {
        self.note_stale();
        for block in self.stale.iter() {
            let Some(place) = self.places[block].checked_sub(1) else { continue };
            let block = block as u32;
            let Words { known, wall, frontier, .. } = self.words[place as usize];
            let free = known & !wall;
            let now = if free == 0 { 0 } else { free & !self.closed(block) };
            if now != frontier {
                self.words[place as usize].frontier = now;
                changed(block, frontier, now);
            }
        }
        self.stale.clear();
    }

    /// The explored cells of a block of the map.
    #[inline]
    fn known(&self, block: u32) -> u64 {
        self.places[block as usize].checked_sub(1).map_or(0, |place| self.words[place as usize].known)
    }

    /// The cells of a block whose face neighbours inside the map are all explored.
    fn closed(&self, block: u32) -> u64 {
        let known = |block: Option<u32>| block.map_or(u64::MAX, |block| self.known(block) | !self.layout.inside(block));
        let here = known(Some(block));
        let beside = self.layout.beside(block);
        (0..3).fold(u64::MAX, |closed, axis| {
            let [below, above] = [known(beside[2 * axis]), known(beside[2 * axis + 1])];
            // By how much the number of a cell grows with one step along the axis from an even
            // coordinate, from the middle, and back from the last to the first.
            let (even, middle, whole) = (1 << axis, 7 << axis, 9 << axis);
            let [first, second, third, fourth] = LAYERS[axis];
            let upwards = here >> even & (first | third) | here >> middle & second | above << whole & fourth;
            let downwards = here << even & (second | fourth) | here << middle & third | below >> whole & first;
            closed & upwards & downwards
        })
    }
}

/// The words of a block of the map, which it gets if it has none.
#[inline]
fn words_of<'w>(places: &mut [u32], words: &'w mut Vec<Words>, block: u32) -> &'w mut Words {
    let place = &mut places[block as usize];
    if *place == 0 {
        words.push(Words::default());
        *place = words.len() as u32;
    }
    &mut words[*place as usize - 1]
}

/// A face of a block: the axis across it, and whether it is the upper one.
pub(super) type Face = (usize, bool);

/// The faces of a block, two for each axis.
pub(super) const FACES: [Face; 6] = [(0, false), (0, true), (1, false), (1, true), (2, false), (2, true)];

/// For each axis, the cells of a block with each coordinate.
const LAYERS: [[u64; 4]; 3] = layers();

/// The cells at each of the [`FACES`].
const FACE_LAYERS: [u64; 6] = [LAYERS[0][0], LAYERS[0][3], LAYERS[1][0], LAYERS[1][3], LAYERS[2][0], LAYERS[2][3]];

/// The cells at any of them.
const SURFACE: u64 = {
    let [a, b, c, d, e, f] = FACE_LAYERS;
    a | b | c | d | e | f
};

const fn layers() -> [[u64; 4]; 3] {
    let mut layers = [[0; 4]; 3];
    let mut at = 0;
    while at < 3 * 64 {
        let (axis, number) = (at / 64, at % 64);
        let along = number >> axis & 1 | (number >> (axis + 3) & 1) << 1;
        layers[axis][along] |= 1 << number;
        at += 1;
    }
    layers
}

/// The least and the greatest coordinates in their block of cells, of which there is at least one.
pub(super) fn ends(cells: u64) -> [[i32; 3]; 2] {
    let layers = |axis: usize| LAYERS[axis].iter().map(move |&layer| cells & layer != 0);
    let first = |axis: usize| layers(axis).take_while(|has_cells| !has_cells).count() as i32;
    let last = |axis: usize| 3 - layers(axis).rev().take_while(|has_cells| !has_cells).count() as i32;
    [[0, 1, 2].map(first), [0, 1, 2].map(last)]
}

/// The cells of a row of a block along x, as the lowest four bits: the row with these coordinates.
#[inline]
pub(super) fn row_of(cells: u64, y: u32, z: u32) -> u8 {
    let first = (y & 1) << 1 | (z & 1) << 2 | (y >> 1) << 4 | (z >> 1) << 5;
    let row = cells >> first;
    (row & 3 | row >> 6 & 12) as u8
}

/// So many cells of a row of a block along x, from the one with this number on.
#[inline]
pub(super) fn row_from(first: u32, count: usize) -> u64 {
    let row = ((1 << count) - 1) << (first & 1 | first >> 2 & 2);
    (row & 3 | (row & 12) << 6) << (first & !9)
}
