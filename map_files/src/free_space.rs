//! Where the free space of a map lies: around what the file holds, or within it.
//!
//! A run keeps the largest connected part of free space. Around a cave, or a house, there may be
//! more of it than inside, which is seldom meant.

use voxels::{Grid, Terrain, free_components};

use super::Note;
use super::options::ImportOptions;

/// Share of the kept cells from which on enclosed space is more than a hollow in a wall.
const ENCLOSED_SHARE: f64 = 0.05;

/// The free space of a map with a closed shell.
pub(super) struct FreeSpace {
    /// Cells of the largest connected part, which a run keeps.
    kept: usize,
    /// Whether that part lies beside the shell.
    is_around: bool,
    /// Cells of the largest part that does not.
    enclosed: usize,
}

impl FreeSpace {
    /// The free space of a map.
    pub(super) fn of(terrain: &Grid<Terrain>) -> Self {
        let components = free_components(terrain);
        let beside = components.beside_shell(terrain);
        let enclosed =
            components.sizes.iter().zip(&beside).filter(|(_, beside)| !**beside).map(|(&size, _)| size).max();
        let largest = components.largest().map(|largest| largest as usize);
        Self {
            kept: largest.map_or(0, |largest| components.sizes[largest]),
            is_around: largest.is_some_and(|largest| beside[largest]),
            enclosed: enclosed.unwrap_or_default(),
        }
    }

    /// Whether nothing of it is enclosed by what the file holds.
    pub(super) fn is_all_around(&self) -> bool {
        self.enclosed == 0
    }

    /// A warning that enclosed space is lost, unless a place in the space to keep is named.
    pub(super) fn warning(&self, options: &ImportOptions) -> Option<Note> {
        let is_lost = self.is_around && self.enclosed as f64 >= ENCLOSED_SHARE * self.kept as f64;
        (is_lost && options.free_from.is_none()).then(|| {
            let text = format!(
                "a run keeps the largest part of free space, {} cells around what the file holds, and fills {} cells \
                 enclosed by it: map.import.free_from (--free-from x,y,z) names a place in the part to keep",
                self.kept, self.enclosed
            );
            Note::warning("enclosed", text)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use voxels::Extent;

    /// A cube of 9 cells along each edge with cubes of such edges within each other around its
    /// middle, in turn of wall and free.
    fn space(edges: &[i32]) -> FreeSpace {
        let extent = Extent::new([9; 3], 1.0).unwrap();
        let mut terrain = Grid::new(extent, Terrain::Wall);
        for cell in extent.cells() {
            let from_middle = [cell.x, cell.y, cell.z].map(|along| (along - 4).abs()).into_iter().max().unwrap();
            if edges.iter().filter(|&&edge| from_middle <= edge / 2).count() % 2 == 1 {
                terrain.set(cell, Terrain::Free);
            }
        }
        FreeSpace::of(&terrain)
    }

    #[test]
    fn space_within_walls_is_told_from_that_around_them() {
        let warning = |edges: &[i32]| space(edges).warning(&ImportOptions::default()).map(|note| note.text);
        let text = warning(&[7, 5, 3]).unwrap();
        assert!(text.contains("218 cells around what the file holds, and fills 27 cells"), "{text}");
        let named = ImportOptions { free_from: Some([4.5; 3]), ..ImportOptions::default() };
        assert!(space(&[7, 5, 3]).warning(&named).is_none() && !space(&[7, 5, 3]).is_all_around());
        assert_eq!(warning(&[7, 5, 1]), None, "a hollow in a wall");
        assert_eq!(warning(&[5]), None, "what is enclosed is kept");
        assert!(warning(&[7, 5]).is_none() && space(&[7, 5]).is_all_around());
        assert!(space(&[]).is_all_around());
    }
}
