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
//! Cells may also be *assumed*, which is known to this agent alone and gives way to every finding
//! and report (`assumed.rs`).
//!
//! Invariants: a known cell stays known; only free cells are covered; the counts and the frontiers
//! agree with the cells; the journal holds each change once, in order, and an assumption that turns
//! out to be true once more: beside assumptions at most [`CHANGES_MAX`] entries for a cell, the
//! last of which is its present state.
//!
//! The states are kept as bits, twice: by rows, for who reads them, and by blocks of 4 x 4 x 4
//! cells, for what changes them. Of a report that says mostly what is known, only new cells are
//! looked at, and cells that were all unexplored are learnt at once.
//!
//! A *frontier* is a free or covered cell with an unexplored face neighbour inside the map. The set
//! of frontiers is updated after every batch of findings, in the blocks at what has changed;
//! nothing here ever iterates over the whole map.
//!
//! Beyond that, reports are not validated.

mod around;
mod assumed;
mod blocks;
mod cubes;
mod delta;
mod journal;
mod plane;
mod sight;
#[cfg(test)]
mod tests;

use std::ops::Range;

use msgs::ids::AgentId;
use voxels::{Cell, CellSet, Extent, Terrain, bits};

pub use around::Around;
use assumed::Assumed;
use blocks::{Blocks, Words, ends, row_from, row_of};
pub use delta::{Block, Delta};
pub(crate) use delta::{Layout, with_delta};
use delta::{Row, SIDE, cell_in};
use journal::{Entry, Journal};
use plane::Plane;

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
    /// The agent that reported it; `None`: the own sensor, or an assumption.
    pub from: Option<AgentId>,
}

/// The own sensor, as `from` of an entry: no agent has this id, since as a receiver it means
/// broadcast.
const OWN: u32 = msgs::maes_msgs::AgentMessage::BROADCAST;

/// Most entries of the journal for one cell: wall, free and covered as reported, and wall by the
/// own sensor.
pub const CHANGES_MAX: usize = 4;

/// The map of one agent.
#[derive(Debug, Clone)]
pub struct ExplorationMap {
    layout: Layout,
    /// The cells known to be free, covered ones included.
    free_cells: Plane,
    wall_cells: Plane,
    covered_cells: Plane,
    blocks: Blocks,
    frontier: CellSet,
    journal: Journal,
    assumed: Assumed,
    free: usize,
    wall: usize,
    covered: usize,
    contradictions: u64,
    corrections: u64,
    revisions: u64,
    seen_again: u64,
}

impl ExplorationMap {
    /// An unexplored map.
    #[must_use]
    pub fn new(extent: Extent) -> Self {
        let layout = Layout::new(extent);
        let plane = || Plane::new(extent.volume());
        Self {
            layout,
            free_cells: plane(),
            wall_cells: plane(),
            covered_cells: plane(),
            blocks: Blocks::new(layout),
            frontier: CellSet::new(extent.volume()),
            journal: Journal::default(),
            assumed: Assumed::default(),
            free: 0,
            wall: 0,
            covered: 0,
            contradictions: 0,
            corrections: 0,
            revisions: 0,
            seen_again: 0,
        }
    }

    /// The extent of the map.
    #[must_use]
    #[inline]
    pub fn extent(&self) -> Extent {
        self.layout.extent()
    }

    /// The state of a cell; outside the map all is wall.
    #[must_use]
    #[inline]
    pub fn state(&self, cell: Cell) -> CellState {
        self.extent().index(cell).map_or(CellState::Wall, |index| self.state_at(index))
    }

    /// The state of the cell with this index.
    ///
    /// # Panics
    /// If it is outside the map.
    #[must_use]
    #[inline]
    pub fn state_at(&self, index: usize) -> CellState {
        assert!(index < self.extent().volume(), "cell {index} is outside the map");
        match self.terrain_at(index) {
            Some(Terrain::Free) => match self.covered_cells.contains(index) {
                true => CellState::Covered,
                false => CellState::Free,
            },
            Some(Terrain::Wall) => CellState::Wall,
            None => CellState::Unexplored,
        }
    }

    /// What the cell with this index, which is inside the map, is known to be; `None`: unexplored.
    #[must_use]
    #[inline]
    pub fn terrain_at(&self, index: usize) -> Option<Terrain> {
        match () {
            () if self.free_cells.contains(index) => Some(Terrain::Free),
            () if self.wall_cells.contains(index) => Some(Terrain::Wall),
            () => None,
        }
    }

    /// Whether a cell is known to be free, covered or not.
    #[must_use]
    #[inline]
    pub fn is_free(&self, cell: Cell) -> bool {
        self.extent().index(cell).is_some_and(|index| self.free_cells.contains(index))
    }

    /// Whether the cell with this index, which is inside the map, is known to be free.
    #[must_use]
    #[inline]
    pub fn is_free_at(&self, index: usize) -> bool {
        self.free_cells.contains(index)
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

    /// Number of overridden reports: a free cell became a wall, or a wall a free cell. Overridden
    /// assumptions do not count, because no other agent has heard of them.
    #[must_use]
    pub fn corrections(&self) -> u64 {
        self.corrections
    }

    /// Number of known cells whose state has changed: overridden reports and assumptions.
    #[must_use]
    pub fn revisions(&self) -> u64 {
        self.revisions
    }

    /// Number of cells that the own sensor found free after other agents had reported so.
    #[must_use]
    pub fn seen_again(&self) -> u64 {
        self.seen_again
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
        self.journal.entries(positions).map(|entry| Change {
            cell: self.layout.index_of(entry.place()) as u32,
            finding: entry.finding(),
            from: (entry.from != OWN).then_some(AgentId(entry.from)),
        })
    }

    /// The changes at these positions of the journal, in order; neighbours in the journal that are
    /// in the same block are one report.
    pub(crate) fn reports(&self, positions: Range<usize>) -> impl Iterator<Item = Block> + '_ {
        self.journal.reports(positions)
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

    /// Boxes that hold all cells changed from a position of the journal on, by their lowest and
    /// highest cells, and no cell more than three cells from a changed one along an axis: a way to
    /// go through what is near changes that does not look at each of them.
    pub fn boxes_changed_since(&self, position: usize) -> impl Iterator<Item = (Cell, Cell)> + '_ {
        self.reports(position..self.journal_len()).map(|report| self.box_of(&report))
    }

    /// Those of the [boxes](Self::boxes_changed_since) that lie in blocks in which a cell has
    /// become known or another terrain since then, so that not all changes are marks of coverage.
    pub fn boxes_revealed_since(&self, position: usize) -> impl Iterator<Item = (Cell, Cell)> + '_ {
        let is_revealed =
            move |report: &Block| self.blocks.get(report.index).is_some_and(|words| words.revealed as usize > position);
        self.reports(position..self.journal_len()).filter(is_revealed).map(|report| self.box_of(&report))
    }

    /// The lowest and the highest cell of the cells of a report.
    fn box_of(&self, report: &Block) -> (Cell, Cell) {
        let corner = self.layout.lowest(report.index).map(u32::cast_signed);
        let cell = |at: [i32; 3]| Cell::new(corner[0] + at[0], corner[1] + at[1], corner[2] + at[2]);
        let [low, high] = ends(report.known).map(cell);
        (low, high)
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
        let volume = self.extent().volume();
        let mut row = Row::default();
        let mut rest = cells;
        while let Some(&first) = rest.first() {
            if first as usize >= volume {
                rest = &rest[1..];
                continue;
            }
            if !row.cells.contains(&first) {
                row = self.layout.row_of(first);
            }
            let room = row.room(first).min(rest.len());
            let count = 1 + (1..room).take_while(|&by| rest[by].checked_sub(first) == Some(by as u32)).count();
            let (run, left) = rest.split_at(count);
            rest = left;
            if !self.explore_row(run, row.place_of(first), finding) {
                for &cell in run {
                    self.learn(row.place_of(cell), cell as usize, finding, OWN);
                }
            }
        }
        self.update_frontiers();
    }

    /// Learns what the own sensor has found of cells of the map in a row of one block, if they are
    /// all unexplored; returns whether they are. The place is that of the first of them.
    #[inline]
    fn explore_row(&mut self, run: &[u32], (index, first): (u32, u32), finding: Finding) -> bool {
        let cells = row_from(first, run.len());
        let words = self.blocks.of(index);
        if words.known & cells != 0 {
            return false;
        }
        words.own |= cells;
        words.scanned |= cells;
        let is_wall = finding == Finding::Wall;
        self.learn_new(&Block { index, known: cells, wall: if is_wall { cells } else { 0 }, covered: 0 }, OWN);
        let (start, row) = (run[0] as usize, (1 << run.len()) - 1);
        let of_finding = if is_wall { &mut self.wall_cells } else { &mut self.free_cells };
        of_finding.insert_four(start, row);
        true
    }

    /// Records a visit to a cell, which makes it free as well. Ignored in walls and outside the
    /// map.
    pub fn note_covered(&mut self, cell: Cell) {
        self.note_all_covered(&[cell]);
    }

    /// Records visits to cells, in this order.
    pub fn note_all_covered(&mut self, cells: &[Cell]) {
        for &cell in cells {
            if let Some(index) = self.extent().index(cell) {
                self.learn(self.layout.place_of(index as u32), index, Finding::Covered, OWN);
            }
        }
        self.update_frontiers();
    }

    /// Merges the report of another agent, except where it contradicts the own sensor. Indices
    /// outside the map are ignored.
    pub fn merge(&mut self, delta: &Delta, from: AgentId) {
        for block in &delta.blocks {
            let Some(words) = self.blocks.get(block.index) else { continue };
            let new_cells = self.new_cells_of(block, &words);
            if new_cells == 0 {
                continue;
            }
            if new_cells & words.known == 0 {
                self.explore(block, new_cells, from.0);
                continue;
            }
            for number in bits(new_cells) {
                let place = (block.index, number);
                self.learn(place, self.layout.index_of(place), block.finding(number), from.0);
            }
        }
        self.update_frontiers();
    }

    /// The cells of a reported block whose finding differs from what is known, or that are only
    /// assumed. [`Self::learn`] would ignore all others.
    fn new_cells_of(&self, block: &Block, &Words { known, wall, covered, .. }: &Words) -> u64 {
        let visited = block.covered & !covered;
        let new = !known | (block.wall ^ wall) | visited | self.assumed.of(block.index);
        block.known & self.layout.inside(block.index) & new
    }

    /// Learns about unexplored cells of a block, those that the report knows, but for the sets of
    /// cells by index.
    #[inline]
    fn learn_new(&mut self, report: &Block, from: u32) {
        let &Block { index, known, wall, covered } = report;
        let words = self.blocks.change(index, known);
        words.known |= known;
        words.wall |= wall;
        words.covered |= covered;
        words.revealed = self.journal.len() as u32 + known.count_ones();
        for number in bits(known) {
            self.journal.push(Entry::new((index, number), report.finding(number), from));
        }
        let [free, wall, covered] = [known & !wall, wall, covered].map(|cells| cells.count_ones() as usize);
        self.free += free;
        self.wall += wall;
        self.covered += covered;
    }

    /// Learns about cells of a reported block that are all unexplored.
    fn explore(&mut self, report: &Block, cells: u64, from: u32) {
        let (wall, covered) = (report.wall & cells, report.covered & cells & !report.wall);
        self.learn_new(&Block { index: report.index, known: cells, wall, covered }, from);
        let [_, size_y, size_z] = self.extent().size();
        let [low_x, low_y, low_z] = self.layout.lowest(report.index);
        for z in 0..SIDE.min(size_z - low_z) {
            for y in 0..SIDE.min(size_y - low_y) {
                let row = row_of(cells, y, z);
                if row == 0 {
                    continue;
                }
                let start = self.layout.index([low_x, low_y + y, low_z + z]);
                let walls = row_of(wall, y, z);
                self.free_cells.insert_four(start, row & !walls);
                self.wall_cells.insert_four(start, walls);
                if covered != 0 {
                    self.covered_cells.insert_four(start, row_of(covered, y, z));
                }
            }
        }
    }

    /// Learns about a cell of the map: its block with its number in it, and its index. The
    /// frontiers are out of date then.
    #[inline]
    fn learn(&mut self, (block, number): (u32, u32), index: usize, finding: Finding, from: u32) {
        let bit = 1 << number;
        let words = self.blocks.of(block);
        let is_new = words.known & bit == 0;
        let was_wall = words.wall & bit != 0;
        let was_covered = words.covered & bit != 0;
        let is_at_odds = !is_new && was_wall != (finding == Finding::Wall);
        let is_scan = from == OWN && finding != Finding::Covered;
        // A sensor reports a cell again only if it has changed.
        if is_at_odds && words.own & bit != 0 && !(is_scan && words.scanned & bit != 0) {
            self.contradictions += 1;
            return;
        }
        let was_assumed = self.assumed.take(block, bit);
        if from == OWN {
            let is_first = words.own & bit == 0 && !was_assumed;
            self.seen_again += u64::from(is_first && !is_new && !is_at_odds && finding != Finding::Wall);
            words.own |= bit;
            words.scanned |= if is_scan { bit } else { 0 };
        }
        let is_revised = is_at_odds && (from == OWN || was_wall || was_assumed);
        let is_visited = !is_new && !was_wall && !was_covered && finding == Finding::Covered;
        if !(is_new || is_revised || is_visited || was_assumed) {
            return;
        }
        let only_if = |condition| if condition { bit } else { 0 };
        let words = self.blocks.change(block, only_if(is_new));
        words.known |= bit;
        words.wall = words.wall & !bit | only_if(finding == Finding::Wall);
        words.covered = words.covered & !bit | only_if(finding == Finding::Covered);
        self.journal.push(Entry::new((block, number), finding, from));
        if is_new || is_revised {
            words.revealed = self.journal.len() as u32;
        }
        self.revisions += u64::from(is_revised);
        self.corrections += u64::from(is_revised && !was_assumed);
        match () {
            () if is_new => {}
            () if was_wall => {
                self.wall -= 1;
                self.wall_cells.remove(index);
            }
            () => {
                self.free -= 1;
                self.free_cells.remove(index);
                if was_covered {
                    self.covered -= 1;
                    self.covered_cells.remove(index);
                }
            }
        }
        if finding == Finding::Wall {
            self.wall += 1;
            self.wall_cells.insert(index);
            return;
        }
        self.free += 1;
        self.free_cells.insert(index);
        if finding == Finding::Covered {
            self.covered += 1;
            self.covered_cells.insert(index);
        }
    }

    /// Brings the frontiers up to date with all cells.
    fn update_frontiers(&mut self) {
        let Self { layout, blocks, frontier, .. } = self;
        blocks.update_frontiers(|block, before, now| {
            let [low_x, low_y, low_z] = layout.lowest(block);
            for (z, y) in (0..SIDE).flat_map(|z| (0..SIDE).map(move |y| (z, y))) {
                let changed = row_of(before ^ now, y, z);
                if changed != 0 {
                    frontier.toggle(layout.index([low_x, low_y + y, low_z + z]), changed.into());
                }
            }
        });
    }
}
