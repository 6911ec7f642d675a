//! What the LiDAR of one agent has seen.

use std::fmt;
use std::sync::Arc;

use voxels::{Cell, Extent, Grid, Terrain};

use super::cast::{FREE, Field, OUTSIDE, WALL};
use super::culling::{CullingState, Frontier};
use super::engine::NewCells;

/// The cells that one agent's LiDAR has seen so far. One byte per cell holds its kind once it has
/// been seen; the kinds of all cells are shared by all agents. Pages of cells that were never seen
/// take no memory where the system commits it on first write.
///
/// One layer of marks for the outside surrounds the cells, so that a ray needs no range test.
#[derive(Clone)]
pub struct SensorMemory {
    extent: Extent,
    strides: [usize; 3],
    kinds: Arc<Vec<u8>>,
    /// The kind of each cell that has been seen, 0 for the others.
    seen: Vec<u8>,
    /// By cell index the number of rays that crossed it minus those that ended in it; empty without
    /// noise.
    votes: Vec<i8>,
    culling: CullingState,
}

/// The parts of a memory that its engines change.
pub(super) struct Parts<'a> {
    pub(super) field: Field<'a>,
    pub(super) culling: &'a mut CullingState,
}

/// Omits the cells, of which there are millions.
impl fmt::Debug for SensorMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SensorMemory").field("extent", &self.extent).finish_non_exhaustive()
    }
}

impl SensorMemory {
    /// The memory of a LiDAR that has seen nothing yet.
    pub fn new(terrain: &Grid<Terrain>) -> Self {
        let extent = terrain.extent();
        let [x, y, z] = extent.size().map(|cells| cells as usize + 2);
        let nothing = Self {
            extent,
            strides: [1, x, x * y],
            kinds: Arc::default(),
            seen: Vec::new(),
            votes: Vec::new(),
            culling: CullingState::new(Frontier::new([x, y, z])),
        };
        let mut kinds = vec![OUTSIDE; x * y * z];
        for (number, row) in terrain.as_slice().chunks_exact(x - 2).enumerate() {
            let (at_y, at_z) = (number % (y - 2), number / (y - 2));
            let first = (at_z + 1) * x * y + (at_y + 1) * x + 1;
            for (kind, terrain) in kinds[first..].iter_mut().zip(row) {
                *kind = match terrain {
                    Terrain::Free => FREE,
                    Terrain::Wall => WALL,
                };
            }
        }
        let seen = vec![0; kinds.len()];
        Self { kinds: Arc::new(kinds), seen, ..nothing }
    }

    /// An empty memory for another LiDAR in the same terrain.
    #[must_use]
    pub fn unused(&self) -> Self {
        let (extent, strides, kinds) = (self.extent, self.strides, Arc::clone(&self.kinds));
        let (seen, culling) = (vec![0; self.seen.len()], self.culling.unused());
        Self { extent, strides, kinds, seen, votes: Vec::new(), culling }
    }

    /// The extent of the map.
    pub(super) fn extent(&self) -> Extent {
        self.extent
    }

    /// Steps in slots along the axes.
    pub(super) fn strides(&self) -> [usize; 3] {
        self.strides
    }

    /// The true kind of the cell at a slot.
    pub(super) fn kind(&self, slot: usize) -> u8 {
        self.kinds[slot]
    }

    /// Whether the cell at a slot has been seen.
    pub(super) fn has_seen(&self, slot: usize) -> bool {
        self.seen[slot] != 0
    }

    /// The indices of the cells that have been seen, ascending.
    #[cfg(test)]
    pub(super) fn seen_cells(&self) -> impl Iterator<Item = usize> + '_ {
        let is_seen = |&index: &usize| self.has_seen(self.slot_of(self.extent.cell_at(index)));
        (0..self.extent.volume()).filter(is_seen)
    }

    /// Marks the cell at a slot as seen, adds it if it is new, and returns its true kind.
    pub(super) fn see(&mut self, slot: usize, new: &mut NewCells<'_>) -> u8 {
        let kind = self.kinds[slot];
        if std::mem::replace(&mut self.seen[slot], kind) == 0 {
            match kind {
                FREE => {
                    self.culling.note_free(slot);
                    new.free.push(self.index_of(slot as u32));
                }
                WALL => new.wall.push(self.index_of(slot as u32)),
                _ => {}
            }
        }
        kind
    }

    /// The parts that engines change.
    pub(super) fn parts(&mut self) -> Parts<'_> {
        Parts { field: Field { kinds: &self.kinds, seen: &mut self.seen }, culling: &mut self.culling }
    }

    /// Marks cells as not seen that have just been seen for the first time, by index.
    pub(super) fn forget(&mut self, free: &[u32], wall: &[u32]) {
        let slot = |&index: &u32| self.slot_of(self.extent.cell_at(index as usize));
        let [free, wall] = [free, wall].map(|cells| cells.iter().map(slot).collect::<Vec<usize>>());
        // Marks of the outside may stay: no cell is there.
        free.iter().chain(&wall).for_each(|&slot| self.seen[slot] = 0);
        free.iter().for_each(|&slot| self.culling.forget_free(slot));
        for &slot in free.iter().chain(&wall) {
            let neighbours = self.strides.iter().flat_map(|stride| [slot - stride, slot + stride]);
            for neighbour in neighbours.filter(|&neighbour| self.seen[neighbour] == FREE) {
                self.culling.note_free(neighbour);
            }
        }
    }

    /// Takes the votes of noisy scans out of the memory, one for each cell: those of rays that
    /// crossed it minus those of rays that ended in it.
    pub(super) fn take_votes(&mut self) -> Vec<i8> {
        let mut votes = std::mem::take(&mut self.votes);
        votes.resize(self.extent.volume(), 0);
        votes
    }

    /// Puts the votes of noisy scans back.
    pub(super) fn put_votes(&mut self, votes: Vec<i8>) {
        self.votes = votes;
    }

    /// The slot of a cell of the map.
    pub(super) fn slot_of(&self, cell: Cell) -> usize {
        let [x, y, z] = self.strides;
        (cell.x + 1) as usize * x + (cell.y + 1) as usize * y + (cell.z + 1) as usize * z
    }

    /// The cell index of a slot that holds a cell of the map.
    pub(super) fn index_of(&self, slot: u32) -> u32 {
        let [_, row, layer] = self.strides.map(|stride| stride as u32);
        let [size_x, size_y, _] = self.extent.size();
        let (z, in_layer) = (slot / layer - 1, slot % layer);
        (z * size_y + in_layer / row - 1) * size_x + in_layer % row - 1
    }
}
