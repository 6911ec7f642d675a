//! Changes of the map under the memories of the LiDARs.
//!
//! A memory forgets the cells that have changed, so that the next ray that meets one reports it
//! anew. What [culling](super::culling) knows holds for cells that stay known, so it starts again:
//! the neighbours of a forgotten cell belong to the frontier, and no group of rays is known to find
//! nothing.

use std::sync::Arc;

use voxels::Terrain;

use super::cast::{FREE, WALL};
use super::{SensorMemory, kind_of};

/// What a memory has forgotten.
#[derive(Debug, Default)]
pub(in crate::world) struct ForgottenCells {
    /// Indices of the cells that it had seen, ascending if the changed ones were.
    pub(in crate::world) cells: Vec<u32>,
    /// How many of them were free, and reported to be.
    pub(in crate::world) explored: usize,
}

/// Changes the kinds of cells (by index) in the map that all these memories share. Each of them has
/// to forget the cells then: [`SensorMemory::revise`].
pub(in crate::world) fn change_kinds(memories: &mut [&mut SensorMemory], changed: &[u32], terrain: Terrain) {
    let Some(first) = memories.first_mut() else { return };
    let mut kinds = std::mem::take(&mut first.kinds);
    memories.iter_mut().skip(1).for_each(|memory| memory.kinds = Arc::default());
    // The only reference is left, so that nothing is copied.
    let cells = Arc::make_mut(&mut kinds);
    changed.iter().for_each(|&cell| cells[memories[0].slot_of_index(cell)] = kind_of(terrain));
    memories.iter_mut().for_each(|memory| memory.kinds = Arc::clone(&kinds));
}

impl SensorMemory {
    /// Forgets cells (by index) that have changed.
    pub(in crate::world) fn revise(&mut self, changed: &[u32]) -> ForgottenCells {
        let mut forgotten = ForgottenCells::default();
        for &cell in changed {
            let slot = self.slot_of_index(cell);
            let votes = self.votes.get_mut(cell as usize).map(std::mem::take);
            match std::mem::take(&mut self.seen[slot]) {
                FREE => {
                    self.culling.forget_free(slot);
                    // With noise it may have been reported as wall.
                    forgotten.explored += usize::from(votes.is_none_or(|votes| votes > 0));
                }
                WALL => {}
                _ => continue,
            }
            forgotten.cells.push(cell);
        }
        for &cell in changed {
            self.note_free_beside(self.slot_of_index(cell));
        }
        self.culling.forget_active();
        forgotten
    }

    fn slot_of_index(&self, cell: u32) -> usize {
        self.slot_of(self.extent.cell_at(cell as usize))
    }
}
