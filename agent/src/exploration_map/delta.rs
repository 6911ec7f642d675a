//! A map update: changed cells in blocks of 4 x 4 x 4.
//!
//! Blocks are numbered as cells are: x first, then y, then z. So that near cells have near numbers,
//! the number of a cell in its block interleaves the bits of its coordinates (Morton order): x0,
//! y0, z0, x1, y1, z1 from the lowest; each eight consecutive numbers are an *octant*, a cube of 2
//! x 2 x 2. Blocks at the upper ends of the map may have cells outside it.
//!
//! This module knows neither the encoding of updates nor whether they are true.

use std::cell::RefCell;
use std::ops::Range;

use voxels::{Cell, Extent, bits};

use super::blocks::FACES;
use super::{Change, Finding};

/// Cells along each axis of a block.
pub(super) const SIDE: u32 = 4;

/// The reported cells of one block, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Block {
    /// The number of the block.
    pub index: u32,
    /// The reported cells.
    pub known: u64,
    /// Those of them that are wall; the others are free.
    pub wall: u64,
    /// Those of them that are covered, and so free.
    pub covered: u64,
}

impl Block {
    /// The report of one cell, by its number in the block.
    pub(super) fn of_cell(index: u32, number: u32, finding: Finding) -> Self {
        let known = 1 << number;
        let only_if = |condition| if condition { known } else { 0 };
        Self { index, known, wall: only_if(finding == Finding::Wall), covered: only_if(finding == Finding::Covered) }
    }

    /// The finding about a reported cell, by its number in the block.
    pub(super) fn finding(&self, number: u32) -> Finding {
        match () {
            () if self.wall >> number & 1 != 0 => Finding::Wall,
            () if self.covered >> number & 1 != 0 => Finding::Covered,
            () => Finding::Free,
        }
    }

    /// Overrides the report with a later one.
    pub(super) fn say(&mut self, later: Self) {
        self.known |= later.known;
        self.wall = self.wall & !later.known | later.wall;
        self.covered = self.covered & !later.known | later.covered;
    }
}

/// The reported cells of a map.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Delta {
    /// The blocks; those made by [`Delta::of`] and by the decoder of map messages are strictly
    /// ascending, not empty, and without cells outside the map.
    pub blocks: Vec<Block>,
}

impl Delta {
    /// The delta of some changes in order: the last change of a cell wins.
    #[must_use]
    pub fn of(extent: Extent, changes: impl IntoIterator<Item = Change>) -> Self {
        let layout = Layout::new(extent);
        let reports = changes.into_iter().map(|Change { cell, finding, .. }| {
            let (index, number) = layout.place(layout.at(cell));
            Block::of_cell(index, number, finding)
        });
        with_delta(extent, reports, Self::clone)
    }

    /// The delta moved by so many cells along each axis, without the cells that leave the map.
    #[must_use]
    pub fn moved(&self, extent: Extent, by: [i32; 3]) -> Self {
        let moved = |(cell, finding)| {
            let Cell { x, y, z } = extent.cell_at(cell as usize);
            let cell = extent.index(Cell::new(x + by[0], y + by[1], z + by[2]))? as u32;
            Some(Change { cell, finding, from: None })
        };
        Self::of(extent, self.findings(extent).filter_map(moved))
    }

    /// Number of reported cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.blocks.iter().map(|block| block.known.count_ones() as usize).sum()
    }

    /// Whether no cell is reported.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The reported cells by index with their findings, block by block; cells outside the map are
    /// ignored.
    pub fn findings(&self, extent: Extent) -> impl Iterator<Item = (u32, Finding)> + '_ {
        let layout = Layout::new(extent);
        self.blocks.iter().flat_map(move |block| {
            let cells = bits(block.known & layout.inside(block.index));
            cells.map(move |number| (layout.index_of((block.index, number)) as u32, block.finding(number)))
        })
    }
}

thread_local! {
    /// One for all agents of a thread: its table stays in the cache, and takes its memory once.
    static BUILDER: RefCell<DeltaBuilder> = RefCell::default();
}

/// Makes deltas.
#[derive(Default)]
struct DeltaBuilder {
    /// For each block of the map 1 + its place in the delta that is being made, or 0.
    places: Vec<u32>,
    delta: Delta,
}

/// Hands over the delta of reports about blocks of a map of this extent, of which later ones
/// override earlier ones.
pub(crate) fn with_delta<R>(
    extent: Extent,
    reports: impl IntoIterator<Item = Block>,
    take: impl FnOnce(&Delta) -> R,
) -> R {
    BUILDER.with_borrow_mut(|builder| take(builder.build(extent, reports)))
}

impl DeltaBuilder {
    fn build(&mut self, extent: Extent, reports: impl IntoIterator<Item = Block>) -> &Delta {
        let count = Layout::new(extent).count() as usize;
        if self.places.len() < count {
            // All are 0 at first, which costs no memory where the system provides it page by page.
            self.places = vec![0; count];
        }
        let blocks = &mut self.delta.blocks;
        blocks.clear();
        for report in reports {
            let place = &mut self.places[report.index as usize];
            match place.checked_sub(1) {
                Some(place) => blocks[place as usize].say(report),
                None => {
                    blocks.push(report);
                    *place = blocks.len() as u32;
                }
            }
        }
        blocks.iter().for_each(|block| self.places[block.index as usize] = 0);
        blocks.sort_unstable_by_key(|block| block.index);
        &self.delta
    }
}

/// The layout of the blocks of a map.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    extent: Extent,
    size: [u32; 3],
    blocks: [u32; 3],
    /// Whether all cells of all blocks are inside the map.
    is_filled: bool,
}

impl Layout {
    pub(crate) fn new(extent: Extent) -> Self {
        let size = extent.size();
        let is_filled = size.iter().all(|cells| cells.is_multiple_of(SIDE));
        Self { extent, size, blocks: size.map(|cells| cells.div_ceil(SIDE)), is_filled }
    }

    /// The extent of the map.
    #[inline]
    pub(super) fn extent(&self) -> Extent {
        self.extent
    }

    /// Number of blocks.
    pub(crate) fn count(&self) -> u32 {
        self.blocks.iter().product()
    }

    /// The coordinates of a cell.
    fn at(&self, cell: u32) -> [u32; 3] {
        let row = cell / self.size[0];
        [cell % self.size[0], row % self.size[1], row / self.size[1]]
    }

    /// The block of the cell with these coordinates, and the number of the cell in it.
    pub(super) fn place(&self, [x, y, z]: [u32; 3]) -> (u32, u32) {
        let index = (z / SIDE * self.blocks[1] + y / SIDE) * self.blocks[0] + x / SIDE;
        (index, spread(x) | spread(y) << 1 | spread(z) << 2)
    }

    /// The block of the cell with this index, and the number of the cell in it.
    pub(super) fn place_of(&self, cell: u32) -> (u32, u32) {
        self.place(self.at(cell))
    }

    /// The row along x of the cell of the map with this index.
    pub(super) fn row_of(&self, cell: u32) -> Row {
        let [x, y, z] = self.at(cell);
        let (block, number) = self.place([0, y, z]);
        Row { cells: cell - x..cell - x + self.size[0], block, number }
    }

    /// The index of the cell with these coordinates.
    pub(super) fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        ((z * self.size[1] + y) * self.size[0] + x) as usize
    }

    /// The index of the cell with this number in a block.
    pub(super) fn index_of(&self, place: (u32, u32)) -> usize {
        self.index(self.cell(place).map(i32::cast_unsigned))
    }

    /// The coordinates of the cell with this number in a block.
    pub(super) fn cell(&self, (block, number): (u32, u32)) -> [i32; 3] {
        cell_in(self.lowest(block), number)
    }

    /// The lowest cell of a block along each axis.
    pub(super) fn lowest(&self, block: u32) -> [u32; 3] {
        let row = block / self.blocks[0];
        [block % self.blocks[0], row % self.blocks[1], row / self.blocks[1]].map(|at| at * SIDE)
    }

    /// The blocks beside a block, by the [faces](super::blocks::FACES) between them; `None`: the
    /// map ends there.
    pub(super) fn beside(&self, block: u32) -> [Option<u32>; 6] {
        let strides = [1, self.blocks[0], self.blocks[0] * self.blocks[1]];
        let row = block / self.blocks[0];
        let at = [block % self.blocks[0], row % self.blocks[1], row / self.blocks[1]];
        FACES.map(|(axis, is_upper)| match is_upper {
            true => (at[axis] + 1 < self.blocks[axis]).then(|| block + strides[axis]),
            false => (at[axis] > 0).then(|| block - strides[axis]),
        })
    }

    /// The cells of a block that lie inside the map.
    pub(crate) fn inside(&self, block: u32) -> u64 {
        /// For each axis, the cells of a block in the lowest 0 to 4 layers across it.
        const LOWEST: [[u64; SIDE as usize + 1]; 3] = lowest_layers();
        if block >= self.count() {
            return 0;
        }
        if self.is_filled {
            return u64::MAX;
        }
        let lowest = self.lowest(block);
        (0..3).fold(u64::MAX, |inside, axis| {
            let layers = (self.size[axis] - lowest[axis]).min(SIDE);
            inside & LOWEST[axis][layers as usize]
        })
    }
}

/// A row of cells of the map along x.
#[derive(Debug, Clone, Default)]
pub(super) struct Row {
    /// Their indices.
    pub(super) cells: Range<u32>,
    /// The block of the first of them, and its number in it.
    block: u32,
    number: u32,
}

impl Row {
    /// The block of a cell of the row, and the number of the cell in it.
    #[inline]
    pub(super) fn place_of(&self, cell: u32) -> (u32, u32) {
        let x = cell - self.cells.start;
        (self.block + x / SIDE, self.number | spread(x))
    }

    /// Number of cells from one on that are in its block.
    #[inline]
    pub(super) fn room(&self, cell: u32) -> usize {
        let of_block = SIDE - (cell - self.cells.start) % SIDE;
        of_block.min(self.cells.end - cell) as usize
    }
}

/// What a coordinate along x adds to the number of a cell in its block.
#[inline]
fn spread(along: u32) -> u32 {
    const SPREAD: [u32; SIDE as usize] = [0, 1, 8, 9];
    SPREAD[(along % SIDE) as usize]
}

/// The coordinates of the cell with this number in the block with this lowest cell.
pub(super) fn cell_in(lowest: [u32; 3], number: u32) -> [i32; 3] {
    let by = place_in_block(number);
    [0, 1, 2].map(|axis: usize| (lowest[axis] + by[axis]).cast_signed())
}

/// Coordinates of a cell in its block.
const fn place_in_block(number: u32) -> [u32; 3] {
    [number & 1 | number >> 2 & 2, number >> 1 & 1 | number >> 3 & 2, number >> 2 & 1 | number >> 4 & 2]
}

const fn lowest_layers() -> [[u64; SIDE as usize + 1]; 3] {
    let mut lowest = [[0; SIDE as usize + 1]; 3];
    let mut at = 0;
    while at < 64 * 3 * SIDE {
        let (number, axis, layers) = (at % 64, (at / 64 % 3) as usize, at / 192 + 1);
        if place_in_block(number)[axis] < layers {
            lowest[axis][layers as usize] |= 1 << number;
        }
        at += 1;
    }
    lowest
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn moved_delta_reports_the_same_elsewhere() {
        let extent = Extent::new([6, 5, 4], 1.0).unwrap();
        let index = |x, y, z| extent.index(Cell::new(x, y, z)).unwrap() as u32;
        let change = |cell, finding| Change { cell, finding, from: None };
        let delta = Delta::of(
            extent,
            [
                change(index(3, 1, 2), Finding::Wall),
                change(index(4, 1, 2), Finding::Covered),
                change(index(5, 1, 2), Finding::Free),
                change(index(0, 0, 0), Finding::Free),
            ],
        );
        let moved: BTreeMap<u32, Finding> = delta.moved(extent, [1, -1, 1]).findings(extent).collect();
        assert_eq!(moved, [(index(4, 0, 3), Finding::Wall), (index(5, 0, 3), Finding::Covered)].into());
        assert_eq!(delta.moved(extent, [0; 3]), delta);
    }

    #[test]
    fn last_change_of_a_cell_wins() {
        let extent = Extent::new([5, 4, 4], 1.0).unwrap();
        let change = |cell, finding| Change { cell, finding, from: None };
        let delta = Delta::of(
            extent,
            [
                change(6, Finding::Wall),
                change(4, Finding::Wall),
                change(1, Finding::Free),
                change(6, Finding::Free),
                change(1, Finding::Covered),
                change(79, Finding::Covered),
                change(79, Finding::Wall),
                change(20, Finding::Wall),
            ],
        );
        let block = |index, known, wall, covered| Block { index, known, wall, covered };
        let last = 1 << 0b11_0110;
        assert_eq!(delta.blocks, [block(0, 0b1_1010, 0b1_0000, 0b10), block(1, 1 | last, 1 | last, 0)]);
        assert_eq!(delta.len(), 5);
        assert!(!delta.is_empty() && Delta::of(extent, []).is_empty());
    }

    #[test]
    fn cells_outside_the_map_are_ignored() {
        let extent = Extent::new([5, 2, 1], 1.0).unwrap();
        let everything = |index| Block { index, known: u64::MAX, ..Block::default() };
        let delta = Delta { blocks: (0..9).chain([u32::MAX]).map(everything).collect() };
        let mut cells: Vec<u32> = delta.findings(extent).map(|(cell, _)| cell).collect();
        cells.sort_unstable();
        assert!(cells.into_iter().eq(0..10));
    }

    proptest! {
        #[test]
        fn delta_holds_the_last_finding_of_each_cell(
            size in [1u32..11, 1u32..11, 1u32..11],
            changes in prop::collection::vec((0u32..1000, 0usize..3), 0..80),
        ) {
            let extent = Extent::new(size, 1.0).unwrap();
            let finding = |at: usize| [Finding::Free, Finding::Covered, Finding::Wall][at];
            let changes: Vec<(u32, Finding)> =
                changes.into_iter().map(|(cell, at)| (cell % extent.volume() as u32, finding(at))).collect();
            let delta =
                Delta::of(extent, changes.iter().map(|&(cell, finding)| Change { cell, finding, from: None }));
            let model: BTreeMap<u32, Finding> = changes.into_iter().collect();
            prop_assert_eq!(delta.findings(extent).collect::<BTreeMap<_, _>>(), model);
            prop_assert!(delta.blocks.is_sorted_by(|a, b| a.index < b.index));
            let layout = Layout::new(extent);
            for block in &delta.blocks {
                prop_assert_eq!(block.known & !layout.inside(block.index), 0);
                prop_assert_eq!((block.wall | block.covered) & !block.known | block.wall & block.covered, 0);
            }
        }
    }
}
