//! The map of an agent: each cell unexplored, free or wall, with a separate mark of coverage.
//!
//! **Conflicts.** A finding of the own sensor overrides reports of other agents, and stays until
//! the sensor finds otherwise: the world may change, and then the last own finding holds. Among
//! reports, free overrides wall and covered overrides free, in whatever order they arrive: an agent
//! that saw through a cell or was inside it knows more than one that was stopped by it, and since
//! the rule does not depend on the order, agents that merge the same reports have the same map. So
//! a correction to free propagates from agent to agent, and one to wall stays with agents whose own
//! sensor found the wall; a mark of coverage is only removed where the own sensor finds a wall.
//!
//! Invariants: a known cell stays known; only free cells are covered; the counts and the frontiers
//! agree with the cells; the journal holds each change once, in order, and nothing else: at most
//! [`CHANGES_MAX`] entries for a cell, the last of which is its present state, and two more for
//! each time that the own sensor finds it changed.
//!
//! The states are kept a second time as bits, by blocks of 4 x 4 x 4 cells: of a report that says
//! mostly what is known, only new cells are looked at.
//!
//! A *frontier* is a free or covered cell with an unexplored face neighbour inside the map. The set
//! of frontiers is updated with every change; nothing here ever iterates over the whole map.
//!
//! Beyond that, reports are not validated.

mod around;
mod cubes;
mod delta;
mod journal;
mod known_blocks;
mod place;
mod sight;
#[cfg(test)]
mod tests;

use std::ops::Range;

use msgs::ids::AgentId;
use voxels::{Cell, CellSet, Extent, Grid, bits};

pub use around::Around;
pub use delta::{Block, Delta};
pub(crate) use delta::{Layout, with_delta};
use delta::{SIDE, cell_in};
use journal::{Entry, Journal};
use known_blocks::KnownBlocks;
use place::Place;

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

impl CellState {
    /// Whether the cell is known to be free, visited or not.
    #[inline]
    #[must_use]
    pub fn is_free(self) -> bool {
        matches!(self, Self::Free | Self::Covered)
    }
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

/// The own sensor, as `from` of an entry: no agent has this id, since as a receiver it means
/// broadcast.
const OWN: u32 = msgs::maes_msgs::AgentMessage::BROADCAST;

/// Cells of a page of memory.
const PAGE_CELLS: usize = 4096;

/// Most entries of the journal for one cell: wall, free and covered as reported, and wall by the
/// own sensor.
pub const CHANGES_MAX: usize = 4;

/// Bit of a cell's byte: found by the own sensor (apart from the mark of coverage).
const IS_OWN: u8 = 4;
/// Bit of a cell's byte: scanned by the own sensor, and not only visited.
const IS_SCANNED: u8 = 8;
/// Unit of a cell's byte: one explored face neighbour.
const ONE_CLOSED: u8 = 16;

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
    /// The state in the lower two bits, above them [`IS_OWN`] and [`IS_SCANNED`], and above that
    /// the number of explored face neighbours. All are 0 at first, which costs no memory where the
    /// system provides it page by page.
    cells: Grid<u8>,
    layout: Layout,
    /// Which pages of [`PAGE_CELLS`] of them have been written to.
    written: CellSet,
    blocks: KnownBlocks,
    frontier: CellSet,
    journal: Journal,
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
            written: CellSet::new(extent.volume().div_ceil(PAGE_CELLS)),
            blocks: KnownBlocks::new(layout.count()),
            frontier: CellSet::new(extent.volume()),
            journal: Journal::default(),
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

    /// The state of the cell with this index.
    ///
    /// # Panics
    /// If it is outside the map.
    #[must_use]
    #[inline]
    pub fn state_at(&self, index: usize) -> CellState {
        state_of(self.cells[index])
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

    /// Number of ignored reports and visits that contradicted the own sensor: a free cell as a
    /// wall, or a wall as a free cell.
    #[must_use]
    pub fn contradictions(&self) -> u64 {
        self.contradictions
    }

    /// Number of cells that were overridden: a free cell became a wall, or a wall a free cell.
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
        self.journal.entries(positions).map(|entry| {
            let place = Place::new(self.layout.cell(entry.place()), self.extent().size());
            Change {
                cell: place.index as u32,
                finding: entry.finding(),
                from: (entry.from != OWN).then_some(AgentId(entry.from)),
            }
        })
    }

    /// The changes at these positions of the journal, in order; neighbours in the journal that are
    /// in the same block are one report.
    pub(crate) fn reports(&self, positions: Range<usize>) -> impl Iterator<Item = Block> + '_ {
        let mut entries = self.journal.entries(positions).peekable();
        std::iter::from_fn(move || {
            let mut report = entries.next()?.report();
            while let Some(entry) = entries.next_if(|entry| entry.place().0 == report.index) {
                report.say(entry.report());
            }
            Some(report)
        })
    }

    /// The cells changed from a position of the journal on, in order, each with what was found.
    pub fn cells_changed_since(&self, position: usize) -> impl Iterator<Item = (Cell, Finding)> + '_ {
        // Neighbours in the journal are mostly in the same block.
        let mut last = (u32::MAX, [0; 3]);
        self.journal.entries(position..self.journal.len()).map(move |entry| {
            let (block, number) = entry.place();
            if block != last.0 {
                last = (block, self.layout.lowest(block));
            }
            let [x, y, z] = cell_in(last.1, number);
            (Cell::new(x, y, z), entry.finding())
        })
    }

    /// The changes from a position of the journal on.
    pub fn changes_since(&self, position: usize) -> impl Iterator<Item = Change> + '_ {
        self.changes(position..self.journal.len())
    }

    /// Records cells (by index) that the own sensor found free. Indices outside the map are
    /// ignored.
    pub fn note_free(&mut self, cells: &[u32]) {
        self.note(cells, Finding::Free);
    }

    /// Records cells (by index) that the own sensor found to be wall. Indices outside the map are
    /// ignored.
    pub fn note_wall(&mut self, cells: &[u32]) {
        self.note(cells, Finding::Wall);
    }

    fn note(&mut self, cells: &[u32], finding: Finding) {
        let extent = self.extent();
        for &cell in cells.iter().filter(|&&cell| (cell as usize) < extent.volume()) {
            self.learn_at(&Place::of(cell, extent.size()), finding, OWN);
        }
    }

    /// Records a visit to a cell, which makes it free as well. Ignored in walls and outside the
    /// map.
    pub fn note_covered(&mut self, cell: Cell) {
        if self.extent().contains(cell) {
            self.learn_at(&Place::new([cell.x, cell.y, cell.z], self.extent().size()), Finding::Covered, OWN);
        }
    }

    /// Merges the report of another agent, except where it contradicts the own sensor. Indices
    /// outside the map are ignored.
    pub fn merge(&mut self, delta: &Delta, from: AgentId) {
        for block in &delta.blocks {
            let new_cells = self.new_cells_of(block);
            if new_cells == 0 {
                continue;
            }
            let (lowest, size) = (self.layout.lowest(block.index), self.extent().size());
            for number in bits(new_cells) {
                let place = Place::new(cell_in(lowest, number), size);
                self.learn(&place, (block.index, number), block.finding(number), from.0);
            }
        }
    }

    /// The cells of a reported block whose finding differs from what is known. [`Self::learn`]
    /// would ignore all others.
    fn new_cells_of(&self, block: &Block) -> u64 {
        let Some([known, wall, covered]) = self.blocks.get(block.index) else { return 0 };
        let visited = block.covered & !covered;
        block.known & self.layout.inside(block.index) & (!known | (block.wall ^ wall) | visited)
    }

    fn learn_at(&mut self, place: &Place, finding: Finding, from: u32) {
        let in_block = self.layout.place(place.at.map(i32::cast_unsigned));
        self.learn(place, in_block, finding, from);
    }

    /// Learns about a cell of the map, which has this number in this block.
    fn learn(&mut self, place: &Place, (block, number): (u32, u32), finding: Finding, from: u32) {
        if !self.blocks.is_occupied(block) {
            self.provide(block);
        }
        let index = place.index;
        let packed = &mut self.cells[index];
        let known = state_of(*packed);
        let is_new = known == CellState::Unexplored;
        let is_at_odds = !is_new && (known == CellState::Wall) != (finding == Finding::Wall);
        let is_scan = from == OWN && finding != Finding::Covered;
        // A sensor reports a cell again only if it has changed.
        if is_at_odds && *packed & IS_OWN != 0 && !(is_scan && *packed & IS_SCANNED != 0) {
            self.contradictions += 1;
            return;
        }
        *packed |= if is_scan { IS_OWN | IS_SCANNED } else { u8::from(from == OWN) * IS_OWN };
        let is_corrected = is_at_odds && (from == OWN || known == CellState::Wall);
        let is_visited = known == CellState::Free && finding == Finding::Covered;
        if !(is_new || is_corrected || is_visited) {
            return;
        }
        *packed = *packed & !3 | finding as u8;
        let packed = *packed;
        self.blocks.note(block, number, finding);
        self.journal.push(Entry::new((block, number), finding, from));
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
            self.close(place);
        }
    }

    /// Writes to all pages with cells of a block or beside it that nothing was written to. The
    /// system would provide a page that is read first and then written twice: with a thousand
    /// agents a tenth of the processor time.
    #[cold]
    fn provide(&mut self, block: u32) {
        let [size_x, size_y, size_z] = self.extent().size();
        let [low_x, low_y, low_z] = self.layout.lowest(block);
        let beside = |low: u32, size: u32| low.saturating_sub(1)..(low + SIDE + 1).min(size);
        let row = beside(low_x, size_x);
        for z in beside(low_z, size_z) {
            for y in beside(low_y, size_y) {
                let start = (z * size_y + y) * size_x;
                for index in [start + row.start, start + row.end - 1].map(|index| index as usize) {
                    let page = index / PAGE_CELLS;
                    if !self.written.contains(page) {
                        self.written.insert(page);
                        self.cells[index] = 0;
                    }
                }
            }
        }
    }

    /// Counts a newly explored cell with its neighbours.
    fn close(&mut self, place: &Place) {
        let cells = self.cells.as_mut_slice();
        if place.is_deep_inside() {
            for stride in place.strides.map(isize::cast_unsigned) {
                for neighbour in [place.index - stride, place.index + stride] {
                    let packed = &mut cells[neighbour];
                    *packed += ONE_CLOSED;
                    if !is_open(*packed, 0) {
                        self.frontier.remove(neighbour);
                    }
                }
            }
            return;
        }
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
