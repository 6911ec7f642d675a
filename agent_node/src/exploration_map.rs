//! The map of an agent: each cell unexplored, free or wall, with a separate mark of coverage.
//!
//! **Conflicts.** A finding of the own sensor overrides reports of other agents, and stays; of
//! conflicting own findings the first one stays. Among reports, free overrides wall and covered
//! overrides free, in whatever order they arrive: an agent that saw through a cell or was inside it
//! knows more than one that was stopped by it, and since the rule does not depend on the order,
//! agents that merge the same reports have the same map. So a correction to free propagates from
//! agent to agent, and one to wall stays with agents whose own sensor found the wall; a mark of
//! coverage is only removed where the own sensor finds a wall.
//!
//! Invariants: a known cell stays known; only free cells are covered; the counts and the frontiers
//! agree with the cells; the journal holds each change once, in order, and nothing else: at most
//! [`CHANGES_MAX`] entries for a cell, the last of which is its present state.
//!
//! The states are kept a second time as bits, by blocks of 4 x 4 x 4 cells: of a report that says
//! mostly what is known, only the news are looked at.
//!
//! A *frontier* is a free or covered cell with an unexplored face neighbour inside the map. The set
//! of frontiers is updated with every change; nothing here ever iterates over the whole map.
//!
//! Beyond that, reports are not validated.

mod delta;
#[cfg(test)]
pub(crate) mod drawing;
#[cfg(test)]
mod tests;

use std::ops::Range;

use msgs::ids::AgentId;
use voxels::{Cell, CellSet, Extent, Grid};

pub use delta::{Block, Delta};
pub(crate) use delta::{Layout, bits};

/// The state of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[repr(u8)]
pub enum CellState {
    /// Unexplored.
    #[default]
    Unexplored,
    /// Known to be free.
    Free,
    /// Known to be free, and visited.
    Covered,
    /// Known to be wall.
    Wall,
}

/// A finding about a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Finding {
    /// The cell is free.
    Free = CellState::Free as u8,
    /// The cell has been visited, and so is free.
    Covered = CellState::Covered as u8,
    /// The cell is wall.
    Wall = CellState::Wall as u8,
}

/// An entry of the journal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Change {
    /// Index of the cell.
    pub cell: u32,
    /// The new state.
    pub finding: Finding,
    /// The agent that reported it; `None`: the own sensor.
    pub from: Option<AgentId>,
}

/// A change in 8 bytes: the cell in the upper 30 bits of `what`, the finding in the lower two.
#[derive(Debug, Clone, Copy)]
struct Entry {
    what: u32,
    from: u32,
}

/// The own sensor, as `from` of an entry: no agent has this id, since as a receiver it means
/// broadcast.
const OWN: u32 = msgs::maes_msgs::Parcel::BROADCAST;

/// Most entries of the journal for one cell: wall, free and covered as reported, and wall by the
/// own sensor.
pub const CHANGES_MAX: usize = 4;

/// Bit of a cell's byte: found by the own sensor (apart from the mark of coverage).
const IS_OWN: u8 = 4;
/// Unit of a cell's byte: one explored face neighbour.
const ONE_CLOSED: u8 = 8;

#[inline]
fn state_of(packed: u8) -> CellState {
    match packed & 3 {
        0 => CellState::Unexplored,
        1 => CellState::Free,
        2 => CellState::Covered,
        _ => CellState::Wall,
    }
}

/// Whether a cell with this many neighbours outside the map has an unexplored face neighbour
/// inside.
fn is_open(packed: u8, outside: u8) -> bool {
    packed / ONE_CLOSED + outside < 6
}

/// The map of one agent.
#[derive(Debug, Clone)]
pub struct ExplorationMap {
    /// The state in the lower two bits, above them [`IS_OWN`], and above that the number of
    /// explored face neighbours. All are 0 at first, which costs no memory where the system
    /// provides it page by page.
    cells: Grid<u8>,
    layout: Layout,
    /// Three words for each block: its explored cells, those of them that are wall, and those that
    /// are covered.
    blocks: Vec<u64>,
    frontier: CellSet,
    journal: Vec<Entry>,
    free: usize,
    wall: usize,
    covered: usize,
    contradictions: u64,
    corrections: u64,
}

impl ExplorationMap {
    /// An unexplored map.
    #[must_use]
    pub fn new(extent: Extent) -> Self {
        let cells = Grid::new(extent, 0);
        let layout = Layout::new(extent);
        Self {
            cells,
            layout,
            blocks: vec![0; 3 * layout.count() as usize],
            frontier: CellSet::new(extent.volume()),
            journal: Vec::new(),
            free: 0,
            wall: 0,
            covered: 0,
            contradictions: 0,
            corrections: 0,
        }
    }

    /// The extent of the map.
    #[must_use]
    #[inline]
    pub fn extent(&self) -> Extent {
        self.cells.extent()
    }

    /// The state of a cell; outside the map all is wall.
    #[must_use]
    #[inline]
    pub fn state(&self, cell: Cell) -> CellState {
        self.cells.get(cell).map_or(CellState::Wall, |&packed| state_of(packed))
    }

    /// Number of known free cells, covered ones included.
    #[must_use]
    pub fn free(&self) -> usize {
        self.free
    }

    /// Number of known walls.
    #[must_use]
    pub fn wall(&self) -> usize {
        self.wall
    }

    /// Number of covered cells.
    #[must_use]
    pub fn covered(&self) -> usize {
        self.covered
    }

    /// Number of ignored findings that contradicted the own sensor: a free cell as a wall, or a
    /// wall as a free cell.
    #[must_use]
    pub fn contradictions(&self) -> u64 {
        self.contradictions
    }

    /// Number of overridden reports: a free cell became a wall, or a wall a free cell.
    #[must_use]
    pub fn corrections(&self) -> u64 {
        self.corrections
    }

    /// Whether a cell is a frontier.
    #[must_use]
    #[inline]
    pub fn is_frontier(&self, cell: Cell) -> bool {
        self.extent().index(cell).is_some_and(|index| self.frontier.contains(index))
    }

    /// The indices of all frontiers, ascending.
    pub fn frontiers(&self) -> impl Iterator<Item = u32> + '_ {
        self.frontier.iter().map(|index| index as u32)
    }

    /// Number of frontiers.
    #[must_use]
    pub fn frontier_count(&self) -> usize {
        self.frontier.len()
    }

    /// Number of changes so far: the position of the next entry in the journal.
    #[must_use]
    pub fn journal_len(&self) -> usize {
        self.journal.len()
    }

    /// The changes at these positions of the journal, in order. Positions beyond its end are
    /// ignored.
    pub fn changes(&self, positions: Range<usize>) -> impl Iterator<Item = Change> + '_ {
        let end = positions.end.min(self.journal.len());
        let entries = self.journal.get(positions.start..end).unwrap_or_default();
        entries.iter().map(|&Entry { what, from }| Change {
            cell: what >> 2,
            finding: match what & 3 {
                1 => Finding::Free,
                2 => Finding::Covered,
                _ => Finding::Wall,
            },
            from: (from != OWN).then_some(AgentId(from)),
        })
    }

    /// The changes from a position of the journal on.
    pub fn changes_since(&self, position: usize) -> impl Iterator<Item = Change> + '_ {
        self.changes(position..self.journal.len())
    }

    /// Records cells (by index) that the own sensor found free. Indices outside the map are
    /// ignored.
    pub fn note_free(&mut self, cells: &[u32]) {
        for &cell in cells {
            self.learn(cell, Finding::Free, OWN);
        }
    }

    /// Records cells (by index) that the own sensor found to be wall. Indices outside the map are
    /// ignored.
    pub fn note_wall(&mut self, cells: &[u32]) {
        for &cell in cells {
            self.learn(cell, Finding::Wall, OWN);
        }
    }

    /// Records a visit to a cell, which makes it free as well. Ignored in walls and outside the
    /// map.
    pub fn note_covered(&mut self, cell: Cell) {
        if let Some(index) = self.extent().index(cell) {
            self.learn(index as u32, Finding::Covered, OWN);
        }
    }

    /// Merges the report of another agent, except where it contradicts the own sensor. Indices
    /// outside the map are ignored.
    pub fn merge(&mut self, delta: &Delta, from: AgentId) {
        let offsets = self.layout.offsets();
        for block in &delta.blocks {
            let start = self.layout.start(block.index);
            for number in bits(self.news_of(block)) {
                self.learn(start + offsets[number as usize], block.finding(number), from.0);
            }
        }
    }

    /// The cells of a reported block whose finding differs from what is known. [`Self::learn`]
    /// would ignore all others.
    fn news_of(&self, block: &Block) -> u64 {
        let Some(&[known, wall, covered]) =
            self.blocks.get(3 * block.index as usize..).and_then(|words| words.first_chunk())
        else {
            return 0;
        };
        let visited = block.covered & !covered;
        block.known & self.layout.inside(block.index) & (!known | (block.wall ^ wall) | visited)
    }

    fn learn(&mut self, cell: u32, finding: Finding, from: u32) {
        let index = cell as usize;
        let Some(packed) = self.cells.as_mut_slice().get_mut(index) else {
            return;
        };
        let known = state_of(*packed);
        let is_new = known == CellState::Unexplored;
        let is_at_odds = !is_new && (known == CellState::Wall) != (finding == Finding::Wall);
        if is_at_odds && *packed & IS_OWN != 0 {
            self.contradictions += 1;
            return;
        }
        *packed |= if from == OWN { IS_OWN } else { 0 };
        let is_corrected = is_at_odds && (from == OWN || known == CellState::Wall);
        let is_visited = known == CellState::Free && finding == Finding::Covered;
        if !(is_new || is_corrected || is_visited) {
            return;
        }
        *packed = *packed & !3 | finding as u8;
        let packed = *packed;
        let place = Place::of(cell, self.extent().size());
        let (block, number) = self.layout.place(place.at.map(i32::cast_unsigned));
        let words = &mut self.blocks[3 * block as usize..][..3];
        let bit = 1 << number;
        words[0] |= bit;
        words[1] = words[1] & !bit | if finding == Finding::Wall { bit } else { 0 };
        words[2] = words[2] & !bit | if finding == Finding::Covered { bit } else { 0 };
        self.journal.push(Entry { what: cell << 2 | finding as u32, from });
        self.corrections += u64::from(is_corrected);
        match known {
            CellState::Unexplored => {}
            CellState::Free => self.free -= 1,
            CellState::Covered => (self.free, self.covered) = (self.free - 1, self.covered - 1),
            CellState::Wall => self.wall -= 1,
        }
        match finding {
            Finding::Free => self.free += 1,
            Finding::Covered => (self.free, self.covered) = (self.free + 1, self.covered + 1),
            Finding::Wall => self.wall += 1,
        }
        if finding == Finding::Wall {
            self.frontier.remove(index);
        } else if is_open(packed, place.outside) {
            self.frontier.insert(index);
        }
        if is_new {
            self.close(&place);
        }
    }

    /// Counts a newly explored cell with its neighbours.
    fn close(&mut self, place: &Place) {
        let cells = self.cells.as_mut_slice();
        for axis in 0..3 {
            for step in [-1, 1] {
                let Some((neighbour, outside)) = place.beside(axis, step) else { continue };
                let packed = &mut cells[neighbour];
                *packed += ONE_CLOSED;
                if !is_open(*packed, outside) {
                    self.frontier.remove(neighbour);
                }
            }
        }
    }
}

/// The location of a cell.
struct Place {
    index: usize,
    at: [i32; 3],
    size: [i32; 3],
    strides: [isize; 3],
    /// Number of face neighbours outside the map.
    outside: u8,
}

impl Place {
    fn of(cell: u32, size: [u32; 3]) -> Self {
        let [size_x, size_y, _] = size;
        let row = cell / size_x;
        let at = [cell % size_x, row % size_y, row / size_y].map(u32::cast_signed);
        let strides = [1, size_x as isize, (size_x * size_y) as isize];
        let size = size.map(u32::cast_signed);
        let outside = (0..3).map(|axis| outside_along(at[axis], size[axis])).sum();
        Self { index: cell as usize, at, size, strides, outside }
    }

    /// The index of the neighbour one step along an axis, and its number of face neighbours outside
    /// the map.
    fn beside(&self, axis: usize, step: i32) -> Option<(usize, u8)> {
        let at = self.at[axis] + step;
        let index = self.index.checked_add_signed(self.strides[axis] * step as isize)?;
        let size = self.size[axis];
        let outside = self.outside - outside_along(self.at[axis], size);
        (0..size).contains(&at).then(|| (index, outside + outside_along(at, size)))
    }
}

/// How many of the two neighbours along an axis are outside the map, for this coordinate and size.
fn outside_along(at: i32, size: i32) -> u8 {
    u8::from(at == 0) + u8::from(at + 1 == size)
}
