//! What is taken for known without having been found.
//!
//! Invariants: an assumed cell has been neither found by the own sensor nor reported since; no
//! entry of the journal that is an assumption is sent to others.

use std::collections::BTreeMap;
use std::ops::Range;

use voxels::Cell;

use super::{Block, CellState, ExplorationMap, Finding, OWN};

/// The assumptions of a map.
#[derive(Debug, Clone, Default)]
pub(super) struct Assumed {
    /// By block the cells that are assumed.
    cells: BTreeMap<u32, u64>,
    /// Where the journal has assumptions, ascending; some may have been found since, as later
    /// entries say.
    positions: Vec<Range<usize>>,
}

impl Assumed {
    /// The assumed cells of a block.
    #[inline]
    pub(super) fn of(&self, block: u32) -> u64 {
        if self.cells.is_empty() { 0 } else { self.cells.get(&block).copied().unwrap_or_default() }
    }

    /// Removes a cell, given its block and its bit there, which has been found or reported; returns
    /// whether it was assumed.
    #[inline]
    pub(super) fn take(&mut self, block: u32, bit: u64) -> bool {
        let is_assumed = self.of(block) & bit != 0;
        if is_assumed && let Some(cells) = self.cells.get_mut(&block) {
            *cells &= !bit;
            if *cells == 0 {
                self.cells.remove(&block);
            }
        }
        is_assumed
    }

    /// Adds a cell, given its block and its bit there, with the positions of its entries.
    fn insert(&mut self, block: u32, bit: u64, entries: Range<usize>) {
        *self.cells.entry(block).or_default() |= bit;
        match self.positions.last_mut() {
            Some(last) if last.end == entries.start => last.end = entries.end,
            _ => self.positions.push(entries),
        }
    }

    /// The parts of a range of the journal that are no assumptions.
    fn without(&self, range: Range<usize>) -> impl Iterator<Item = Range<usize>> + '_ {
        let first = self.positions.partition_point(|assumed| assumed.end <= range.start);
        let mut at = range.start;
        let later = self.positions[first..].iter().take_while(move |assumed| assumed.start < range.end);
        later.cloned().chain(std::iter::once(range.end..range.end)).filter_map(move |assumed| {
            let found = at..assumed.start;
            at = assumed.end;
            (!found.is_empty()).then_some(found)
        })
    }
}

impl ExplorationMap {
    /// Takes those of some cells of the map that are unexplored to be free or wall: whatever is
    /// found or reported later overrules that.
    pub(crate) fn assume(&mut self, cells: &[Cell], finding: Finding) {
        for &cell in cells {
            let Some(index) = self.extent().index(cell) else { continue };
            if self.state_at(index) == CellState::Unexplored {
                self.learn_assumed(index, finding);
            }
        }
        self.update_frontiers();
    }

    /// Replaces what is [assumed](Self::assume) of a cell, unless it has been found or reported.
    pub(crate) fn correct_assumed(&mut self, cell: Cell, finding: Finding) {
        let Some(index) = self.extent().index(cell) else { return };
        let (block, number) = self.layout.place_of(index as u32);
        if self.assumed.of(block) >> number & 1 != 0 {
            self.learn_assumed(index, finding);
        }
        self.update_frontiers();
    }

    fn learn_assumed(&mut self, index: usize, finding: Finding) {
        let (block, number) = self.layout.place_of(index as u32);
        let start = self.journal.len();
        self.learn((block, number), index, finding, OWN);
        let words = self.blocks.of(block);
        words.own &= !(1 << number);
        words.scanned &= !(1 << number);
        self.assumed.insert(block, 1 << number, start..self.journal.len());
    }

    /// The [reports](Self::reports) of what has been found or reported, which others may be told.
    pub(crate) fn reports_to_share(&self, positions: Range<usize>) -> impl Iterator<Item = Block> + '_ {
        self.assumed.without(positions).flat_map(|found| self.reports(found))
    }
}
