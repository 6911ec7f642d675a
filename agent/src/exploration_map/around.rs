//! What is known of a cell and the 26 around it: in counts, and which are free.

use voxels::Cell;

use super::plane::Plane;
use super::{CellState, ExplorationMap};

/// How many of a cell and the 26 around it are known to be walls, and how many to be free; those
/// outside the map are walls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Around {
    /// Number of walls, 0 to 27.
    pub walls: u8,
    /// Number of free cells, 0 to 27.
    pub free: u8,
}

impl ExplorationMap {
    /// What is known of a cell and the 26 around it.
    #[inline]
    pub fn around(&self, cell: Cell) -> Around {
        let Some(corner) = self.corner_around(cell) else {
            let mut around = Around::default();
            for beside in cell.neighbours26().into_iter().chain([cell]) {
                match self.state(beside) {
                    CellState::Wall => around.walls += 1,
                    CellState::Free | CellState::Covered => around.free += 1,
                    CellState::Unexplored => {}
                }
            }
            return around;
        };
        let [walls, free] = [&self.wall_cells, &self.free_cells].map(|plane| self.bits_around(plane, corner));
        Around { walls: walls.count_ones() as u8, free: free.count_ones() as u8 }
    }

    /// Which of a cell and the 26 around it are known to be free: one bit each, x first.
    #[inline]
    pub fn free_around(&self, cell: Cell) -> u32 {
        let Some(corner) = self.corner_around(cell) else {
            let one = Cell::new(1, 1, 1);
            let offsets = (0..3).flat_map(|z| (0..3).flat_map(move |y| (0..3).map(move |x| Cell::new(x, y, z) - one)));
            return offsets.enumerate().fold(0, |free, (place, by)| free | u32::from(self.is_free(cell + by)) << place);
        };
        self.bits_around(&self.free_cells, corner)
    }

    /// The index of the lowest of the 27 cells around a cell; `None` if one of them is outside the
    /// map.
    #[inline]
    fn corner_around(&self, cell: Cell) -> Option<usize> {
        let extent = self.extent();
        let one = Cell::new(1, 1, 1);
        extent.index(cell - one).filter(|_| extent.contains(cell + one))
    }

    /// The nine rows of three cells from a corner on that are in a plane, one bit each.
    #[inline]
    fn bits_around(&self, plane: &Plane, corner: usize) -> u32 {
        let [size_x, size_y, _] = self.extent().size().map(|cells| cells as usize);
        let start = |row: usize| corner + (row / 3 * size_y + row % 3) * size_x;
        (0..9).fold(0, |bits, row| bits | (plane.run(start(row), 3) as u32) << (3 * row))
    }
}
