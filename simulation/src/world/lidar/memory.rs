//! What the LiDAR of one agent has seen, and what is known of its rays.

use std::fmt;

use voxels::{Cell, Extent, Grid, Terrain};

use super::culling::CullingState;
use super::engine::NewCells;
use super::marks::Marks;

/// The cells that one agent's LiDAR has seen so far.
#[derive(Clone)]
pub struct SensorMemory {
    marks: Marks,
    /// By cell index the number of rays that crossed it minus those that ended in it; empty without
    /// noise.
    votes: Vec<i8>,
    culling: CullingState,
}

/// The parts of a memory that its engines change.
pub(super) struct Parts<'a> {
    pub(super) marks: &'a mut Marks,
    pub(super) culling: &'a mut CullingState,
}

/// Omits the cells, of which there are millions.
impl fmt::Debug for SensorMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SensorMemory").field("extent", &self.extent()).finish_non_exhaustive()
    }
}

impl SensorMemory {
    /// The memory of a LiDAR that has seen nothing yet.
    pub fn new(terrain: &Grid<Terrain>) -> Self {
        Self { marks: Marks::new(terrain), votes: Vec::new(), culling: CullingState::new() }
    }

    /// An empty memory for another LiDAR in the same terrain.
    #[must_use]
    pub fn unused(&self) -> Self {
        Self { marks: self.marks.unused(), votes: Vec::new(), culling: CullingState::new() }
    }

    /// The extent of the map.
    pub(super) fn extent(&self) -> Extent {
        self.marks.slots().extent()
    }

    /// What has been seen.
    pub(super) fn marks(&self) -> &Marks {
        &self.marks
    }

    /// Whether a cell of the map has been seen.
    pub(super) fn has_seen(&self, cell: Cell) -> bool {
        !self.marks.is_unseen(self.marks.slots().of(cell))
    }

    /// Whether a cell of the map is truly a wall.
    pub(super) fn is_wall(&self, cell: Cell) -> bool {
        !self.marks.is_free(self.marks.slots().of(cell))
    }

    /// Marks a cell of the map as seen, and adds it if it is new.
    pub(super) fn see(&mut self, cell: Cell, new: &mut NewCells<'_>) {
        self.marks.see(self.marks.slots().of(cell), new);
    }

    /// The indices of the cells that have been seen, ascending.
    #[cfg(test)]
    pub(super) fn seen_cells(&self) -> impl Iterator<Item = usize> + '_ {
        let extent = self.extent();
        (0..extent.volume()).filter(move |&index| self.has_seen(extent.cell_at(index)))
    }

    /// The parts that engines change.
    pub(super) fn parts(&mut self) -> Parts<'_> {
        Parts { marks: &mut self.marks, culling: &mut self.culling }
    }

    /// Takes the votes of noisy scans out of the memory, one for each cell: those of rays that
    /// crossed it minus those of rays that ended in it.
    pub(super) fn take_votes(&mut self) -> Vec<i8> {
        let mut votes = std::mem::take(&mut self.votes);
        votes.resize(self.extent().volume(), 0);
        votes
    }

    /// Takes the votes about a cell, by index; `None` without noise.
    pub(super) fn take_vote(&mut self, cell: u32) -> Option<i8> {
        self.votes.get_mut(cell as usize).map(std::mem::take)
    }

    /// Puts the votes of noisy scans back.
    pub(super) fn put_votes(&mut self, votes: Vec<i8>) {
        self.votes = votes;
    }
}
