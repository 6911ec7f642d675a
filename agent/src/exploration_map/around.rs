//! What is known of a cell and the 26 around it: in counts, and which are free.

use voxels::Cell;

use super::{CellState, ExplorationMap};

/// The lowest bit of each of three cells' bytes.
const LANES: u32 = 0x01_01_01;

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
        let Some(rows) = self.rows_around(cell) else {
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
        // A byte for each column of nine rows, in which no sum exceeds nine.
        let (mut walls, mut known) = (0, 0);
        for states in rows {
            let (low, high) = (states & LANES, states >> 1 & LANES);
            walls += low & high;
            known += low | high;
        }
        let sum = |lanes: u32| lanes.to_le_bytes().into_iter().sum::<u8>();
        Around { walls: sum(walls), free: sum(known) - sum(walls) }
    }

    /// Which of a cell and the 26 around it are known to be free: one bit each, x first.
    #[inline]
    pub fn free_around(&self, cell: Cell) -> u32 {
        let Some(rows) = self.rows_around(cell) else {
            let one = Cell::new(1, 1, 1);
            let offsets = (0..3).flat_map(|z| (0..3).flat_map(move |y| (0..3).map(move |x| Cell::new(x, y, z) - one)));
            return offsets
                .enumerate()
                .fold(0, |free, (place, by)| free | u32::from(self.state(cell + by).is_free()) << place);
        };
        (0..).zip(rows).fold(0, |free, (row, states): (u32, _)| {
            // One of the two lower bits of a byte is set.
            let lanes = (states ^ states >> 1) & LANES;
            free | ((lanes | lanes >> 7 | lanes >> 14) & 7) << (3 * row)
        })
    }

    /// The cells' bytes of the nine rows of three cells around a cell, from the lowest byte of each
    /// number; `None` if one of them is outside the map.
    #[inline]
    fn rows_around(&self, cell: Cell) -> Option<[u32; 9]> {
        let extent = self.extent();
        let one = Cell::new(1, 1, 1);
        let corner = extent.index(cell - one).filter(|_| extent.contains(cell + one))?;
        let [size_x, size_y, _] = extent.size().map(|cells| cells as usize);
        let cells = self.cells.as_slice();
        Some(std::array::from_fn(|row| {
            let start = corner + (row / 3 * size_y + row % 3) * size_x;
            u32::from_le_bytes([cells[start], cells[start + 1], cells[start + 2], 0])
        }))
    }
}
