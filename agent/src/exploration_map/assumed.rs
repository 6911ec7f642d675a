//! What is taken for known without having been seen.

use voxels::Cell;

use super::{CellState, ExplorationMap, Finding, OWN};

impl ExplorationMap {
    /// Takes those of some cells of the map that are unexplored to be free or wall, as if another
    /// agent had reported it: whatever the own sensor finds later overrules that.
    pub(crate) fn assume(&mut self, cells: &[Cell], finding: Finding) {
        for &cell in cells {
            let Some(index) = self.extent().index(cell) else { continue };
            if self.state_at(index) == CellState::Unexplored {
                self.learn_assumed(index, finding);
            }
        }
        self.update_frontiers();
    }

    /// Replaces what was [assumed](Self::assume) of a cell, unless the own sensor has found it.
    pub(crate) fn correct_assumed(&mut self, cell: Cell, finding: Finding) {
        let Some(index) = self.extent().index(cell) else { return };
        let (block, number) = self.layout.place_of(index as u32);
        if self.blocks.of(block).own >> number & 1 == 0 {
            self.learn_assumed(index, finding);
        }
        self.update_frontiers();
    }

    fn learn_assumed(&mut self, index: usize, finding: Finding) {
        let (block, number) = self.layout.place_of(index as u32);
        self.learn((block, number), index, finding, OWN);
        let words = self.blocks.of(block);
        words.own &= !(1 << number);
        words.scanned &= !(1 << number);
    }
}
