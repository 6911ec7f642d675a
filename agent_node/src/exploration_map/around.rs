//! What is known of a cell and the 26 around it, in counts.

use voxels::Cell;

use super::{CellState, ExplorationMap};

/// The lowest bit of each of three cells' bytes.
const LANES: u32 = 0x01_01_01;

/// How many of a cell and the 26 around it are known to be walls, and how many to be free; those
/// outside the map are walls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Around {
    pub(crate) walls: u8,
    pub(crate) free: u8,
}

impl ExplorationMap {
    /// What is known of a cell and the 26 around it.
    #[inline]
    pub(crate) fn around(&self, cell: Cell) -> Around {
        let extent = self.extent();
        let one = Cell::new(1, 1, 1);
        let Some(corner) = extent.index(cell - one).filter(|_| extent.contains(cell + one)) else {
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
        let [size_x, size_y, _] = extent.size().map(|cells| cells as usize);
        let cells = self.cells.as_slice();
        // A byte for each column of nine rows, in which no sum exceeds nine.
        let (mut walls, mut known) = (0, 0);
        for row in (0..9).map(|row| corner + (row / 3 * size_y + row % 3) * size_x) {
            let states = u32::from_le_bytes([cells[row], cells[row + 1], cells[row + 2], 0]);
            let (low, high) = (states & LANES, states >> 1 & LANES);
            walls += low & high;
            known += low | high;
        }
        let sum = |lanes: u32| lanes.to_le_bytes().into_iter().sum::<u8>();
        Around { walls: sum(walls), free: sum(known) - sum(walls) }
    }
}
