//! Changes of the map under the memories of the LiDARs.
//!
//! A memory forgets the cells that have changed, so that the next ray that meets one reports it
//! anew. What [culling](super::culling) knows holds for cells that stay known, so it starts again:
//! the neighbours of a forgotten cell belong to the edge, and no group of rays is known to find
//! nothing.

use voxels::Terrain;

use super::SensorMemory;
use super::marks::Marks;
use super::memory::Parts;

/// What a memory has forgotten.
#[derive(Debug, Default)]
pub(crate) struct ForgottenCells {
    /// Indices of the cells that it had seen, ascending if the changed ones were.
    pub(crate) cells: Vec<u32>,
    /// How many of them were free, and reported to be.
    pub(crate) explored: usize,
}

/// Changes cells (by index) in the map that all these memories share. Each of them has to forget
/// the cells as well: [`SensorMemory::revise`].
pub(crate) fn change_kinds(memories: &mut [&mut SensorMemory], changed: &[u32], terrain: Terrain) {
    let marks: Vec<&mut Marks> = memories.iter_mut().map(|memory| memory.parts().marks).collect();
    Marks::change(marks, changed, terrain == Terrain::Free);
}

impl SensorMemory {
    /// Forgets cells (by index) that have changed.
    pub(crate) fn revise(&mut self, changed: &[u32]) -> ForgottenCells {
        let mut forgotten = ForgottenCells::default();
        let extent = self.extent();
        for &index in changed {
            let votes = self.take_vote(index);
            let cell = extent.cell_at(index as usize);
            if self.has_seen(cell) {
                // With noise a free cell may have been reported as wall.
                let counted = self.marks().passes_at(cell) && votes.is_none_or(|votes| votes > 0);
                forgotten.explored += usize::from(counted);
                forgotten.cells.push(index);
            }
        }
        let Parts { marks, culling } = self.parts();
        marks.forget(changed.iter().copied());
        culling.forget_active();
        forgotten
    }
}
