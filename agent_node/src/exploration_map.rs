//! What an agent believes of the world: each cell unexplored, free or wall, and covered as a mark of its own.
//!
//! **Who is believed.** What the own sensor finds overrules what others say, and stays; what it found first, if it is at odds
//! with itself. Among what others say, free overrules wall and covered overrules free, in whatever order it is heard: who saw
//! through a cell or stood in it knows more than who was stopped by it, and a rule that knows no order lets all who heard the
//! same believe the same. So a correction to free goes from agent to agent, and one to wall stays with those whose own sensor
//! found the wall; a mark of coverage only goes where the own sensor finds wall.
//!
//! Invariants: a known cell stays known; only free cells are covered; the counts and the frontier are those of the cells; the
//! journal holds each change once, in the order in which it was learnt, and nothing else: [`CHANGES_MAX`] entries for a cell at
//! the most, the last of which is what is known of it.
//!
//! A *frontier* is a free or covered cell with an unexplored face neighbour inside the map. The set of them is kept with every
//! change; nothing here ever goes through the whole map.
//!
//! This module does not judge beyond that whether what it is told is true.

mod cell_set;
mod delta;
#[cfg(test)]
pub(crate) mod drawing;
#[cfg(test)]
mod tests;

use std::ops::Range;

use msgs::ids::AgentId;
use voxels::{Cell, Extent, Grid};

use cell_set::CellSet;
pub use delta::{Block, Delta};
pub(crate) use delta::{Layout, bits};

/// What is known of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[repr(u8)]
pub enum CellState {
    /// Nothing.
    #[default]
    Unexplored,
    /// It is free.
    Free,
    /// It is free and has been visited.
    Covered,
    /// It is wall.
    Wall,
}

/// What can be learnt of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Finding {
    /// It is free.
    Free = CellState::Free as u8,
    /// It has been visited, and so is free.
    Covered = CellState::Covered as u8,
    /// It is wall.
    Wall = CellState::Wall as u8,
}

/// An entry of the journal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Change {
    /// Index of the cell.
    pub cell: u32,
    /// What was learnt.
    pub finding: Finding,
    /// From whom; `None`: from the own sensor.
    pub from: Option<AgentId>,
}

/// A change in 8 bytes: the cell in the upper 30 bits of `what`, the finding in the lower two.
#[derive(Debug, Clone, Copy)]
struct Entry {
    what: u32,
    from: u32,
}

/// As `from` of an entry: the own sensor. No agent has this id, because as a receiver it means everybody.
const OWN: u32 = msgs::maes_msgs::Parcel::BROADCAST;

/// Entries of the journal for one cell at the most: wall, free and covered by hearsay, and wall by the own sensor.
pub const CHANGES_MAX: usize = 4;

/// The byte of a cell: whether the own sensor has found it so (apart from the mark of coverage).
const IS_OWN: u8 = 4;
/// The byte of a cell: one face neighbour that is explored.
const ONE_CLOSED: u8 = 8;

fn state_of(packed: u8) -> CellState {
    match packed & 3 {
        0 => CellState::Unexplored,
        1 => CellState::Free,
        2 => CellState::Covered,
        _ => CellState::Wall,
    }
}

/// Whether a face neighbour inside the map is unexplored, of a cell with so many neighbours outside.
fn is_open(packed: u8, outside: u8) -> bool {
    packed / ONE_CLOSED + outside < 6
}

/// The map of one agent.
#[derive(Debug, Clone)]
pub struct ExplorationMap {
    /// The state in the lower two bits, above them [`IS_OWN`], and above that how many face neighbours are explored. All are 0 at
    /// first, which costs no memory where the system provides it page by page.
    cells: Grid<u8>,
    frontier: CellSet,
    journal: Vec<Entry>,
    free: usize,
    wall: usize,
    covered: usize,
    contradictions: u64,
    corrections: u64,
}

impl ExplorationMap {
    /// A map of which nothing is known.
    #[must_use]
    pub fn new(extent: Extent) -> Self {
        let cells = Grid::new(extent, 0);
        let frontier = CellSet::new(extent.volume());
        Self { cells, frontier, journal: Vec::new(), free: 0, wall: 0, covered: 0, contradictions: 0, corrections: 0 }
    }

    /// Where the map lies.
    #[must_use]
    pub fn extent(&self) -> Extent {
        self.cells.extent()
    }

    /// What is known of a cell; outside the map all is wall.
    #[must_use]
    pub fn state(&self, cell: Cell) -> CellState {
        self.cells.get(cell).map_or(CellState::Wall, |&packed| state_of(packed))
    }

    /// Free cells known, covered ones included.
    #[must_use]
    pub fn free(&self) -> usize {
        self.free
    }

    /// Walls known.
    #[must_use]
    pub fn wall(&self) -> usize {
        self.wall
    }

    /// Cells known to be covered.
    #[must_use]
    pub fn covered(&self) -> usize {
        self.covered
    }

    /// How often something was learnt that contradicts what the own sensor had found, and was left out: a free cell as a wall,
    /// or a wall as a free cell.
    #[must_use]
    pub fn contradictions(&self) -> u64 {
        self.contradictions
    }

    /// How often hearsay was overruled: a free cell became a wall, or a wall a free cell.
    #[must_use]
    pub fn corrections(&self) -> u64 {
        self.corrections
    }

    /// Whether a cell is a frontier.
    #[must_use]
    pub fn is_frontier(&self, cell: Cell) -> bool {
        self.extent().index(cell).is_some_and(|index| self.frontier.contains(index))
    }

    /// The indices of all frontiers, ascending.
    pub fn frontiers(&self) -> impl Iterator<Item = u32> + '_ {
        self.frontier.iter().map(|index| index as u32)
    }

    /// How many frontiers there are.
    #[must_use]
    pub fn frontier_count(&self) -> usize {
        self.frontier.len()
    }

    /// How many changes there have been, and so the position of the next one in the journal.
    #[must_use]
    pub fn journal_len(&self) -> usize {
        self.journal.len()
    }

    /// The changes at these positions of the journal, in the order in which they were learnt. Positions that are not in the
    /// journal yet are left out.
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

    /// Notes that the own sensor found cells (by index) free. Indices outside the map are left out.
    pub fn note_free(&mut self, cells: &[u32]) {
        for &cell in cells {
            self.learn(cell, Finding::Free, OWN);
        }
    }

    /// Notes that the own sensor found cells (by index) to be wall. Indices outside the map are left out.
    pub fn note_wall(&mut self, cells: &[u32]) {
        for &cell in cells {
            self.learn(cell, Finding::Wall, OWN);
        }
    }

    /// Notes that a cell has been visited, which makes it free as well. Outside the map nothing is noted, nor in a wall.
    pub fn note_covered(&mut self, cell: Cell) {
        if let Some(index) = self.extent().index(cell) {
            self.learn(index as u32, Finding::Covered, OWN);
        }
    }

    /// Takes in what another agent says, as far as it does not contradict the own sensor. Indices outside the map are left out.
    pub fn merge(&mut self, delta: &Delta, from: AgentId) {
        delta.findings(self.extent()).for_each(|(cell, finding)| self.learn(cell, finding, from.0));
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

    /// Tells the neighbours of a cell that it is unexplored no more.
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

/// Where a cell lies.
struct Place {
    index: usize,
    at: [i32; 3],
    size: [i32; 3],
    strides: [isize; 3],
    /// How many of its face neighbours are outside the map.
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

    /// The index of the neighbour one step on along an axis, and how many of its face neighbours are outside the map.
    fn beside(&self, axis: usize, step: i32) -> Option<(usize, u8)> {
        let at = self.at[axis] + step;
        let index = self.index.checked_add_signed(self.strides[axis] * step as isize)?;
        let size = self.size[axis];
        let outside = self.outside - outside_along(self.at[axis], size);
        (0..size).contains(&at).then(|| (index, outside + outside_along(at, size)))
    }
}

/// How many of the two neighbours along an axis are outside a map of this size, of a cell with this coordinate.
fn outside_along(at: i32, size: i32) -> u8 {
    u8::from(at == 0) + u8::from(at + 1 == size)
}
