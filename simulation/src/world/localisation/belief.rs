//! The map that an agent gets from its own sensor: where each true cell is on it, block by block.
//!
//! The agent itself may know more, from other agents; those cells are not here.

use std::iter::Sum;
use std::ops::Add;

use nalgebra::Vector3;
use voxels::{Cell, Extent, Terrain};

/// Bits of a cell that hold its state; the others number the block that has entered it last.
const STATE_BITS: u32 = 2;
const UNKNOWN: u16 = 0;
const FREE: u16 = 1;
const WALL: u16 = 2;
const STATE_MASK: u16 = (1 << STATE_BITS) - 1;

/// Largest number of blocks of one agent: as many as have numbers. In the last one it stays.
const BLOCKS_MAX: usize = 1 << (u16::BITS - STATE_BITS);

/// The map of an agent from its own sensor.
#[derive(Debug)]
pub(super) struct Belief {
    extent: Extent,
    /// By index of a cell on the map of the agent: state and block.
    cells: Vec<u16>,
    /// What each block adds to a true cell, the present block last.
    offsets: Vec<[i32; 3]>,
}

/// What entering cells makes new for the agent, by index on its map.
#[derive(Debug, Default)]
pub(super) struct Entered {
    /// Cells that were unknown or in another state.
    pub(super) new: Vec<u32>,
    /// Those of them that were in another state.
    pub(super) revised: Vec<u32>,
}

/// Numbers of cells on maps by their displacement: the greatest along an axis, in cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MapErrors {
    /// Cells that are where they truly are.
    pub right: u64,
    /// Cells that are off by one.
    pub off_by_1: u64,
    /// Cells that are off by two.
    pub off_by_2: u64,
    /// Cells that are off by more.
    pub off_by_more: u64,
}

impl MapErrors {
    /// Number of cells on the maps.
    #[must_use]
    pub fn cells(&self) -> u64 {
        self.right + self.off_by_1 + self.off_by_2 + self.off_by_more
    }
}

impl Add for MapErrors {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            right: self.right + other.right,
            off_by_1: self.off_by_1 + other.off_by_1,
            off_by_2: self.off_by_2 + other.off_by_2,
            off_by_more: self.off_by_more + other.off_by_more,
        }
    }
}

impl Sum for MapErrors {
    fn sum<I: Iterator<Item = Self>>(errors: I) -> Self {
        errors.fold(Self::default(), Add::add)
    }
}

impl Belief {
    /// An empty map in its first block, which is where it truly is.
    pub(super) fn new(extent: Extent) -> Self {
        Self { extent, cells: vec![UNKNOWN; extent.volume()], offsets: vec![[0; 3]] }
    }

    /// What the present block adds to a true cell.
    pub(super) fn offset(&self) -> [i32; 3] {
        self.offsets.last().copied().unwrap_or_default()
    }

    /// What the present block adds to a true position, metres.
    pub(super) fn offset_m(&self) -> Vector3<f64> {
        Vector3::from(self.offset().map(f64::from)) * self.extent.cell_m()
    }

    /// Whether another block can begin.
    pub(super) fn has_room(&self) -> bool {
        self.offsets.len() < BLOCKS_MAX
    }

    /// Begins a block.
    pub(super) fn begin_block(&mut self, offset: [i32; 3]) {
        self.offsets.push(offset);
    }

    /// Number of blocks after the first.
    pub(super) fn blocks_begun(&self) -> u64 {
        self.offsets.len() as u64 - 1
    }

    /// Where the present block has a true cell, by index; `None`: outside the map.
    pub(super) fn cell_of(&self, cell: u32) -> Option<u32> {
        let Cell { x, y, z } = self.extent.cell_at(cell as usize);
        let [by_x, by_y, by_z] = self.offset();
        self.extent.index(Cell::new(x + by_x, y + by_y, z + by_z)).map(|index| index as u32)
    }

    /// Whether the map has something where the present block has a true cell.
    pub(super) fn knows(&self, cell: u32) -> bool {
        self.cell_of(cell).is_some_and(|cell| self.cells[cell as usize] & STATE_MASK != UNKNOWN)
    }

    /// Enters true cells where the present block has them.
    pub(super) fn enter(&mut self, cells: &[u32], terrain: Terrain) -> Entered {
        let state = match terrain {
            Terrain::Free => FREE,
            Terrain::Wall => WALL,
        };
        let block = (self.offsets.len() - 1) as u16;
        let mut entered = Entered::default();
        for &cell in cells {
            let Some(cell) = self.cell_of(cell) else { continue };
            let before = std::mem::replace(&mut self.cells[cell as usize], block << STATE_BITS | state) & STATE_MASK;
            if before != state {
                entered.new.push(cell);
                if before != UNKNOWN {
                    entered.revised.push(cell);
                }
            }
        }
        entered
    }

    /// Removes cells (by index on this map).
    pub(super) fn forget(&mut self, cells: Vec<u32>) {
        cells.into_iter().for_each(|cell| self.cells[cell as usize] = UNKNOWN);
    }

    /// The errors of the map.
    pub(super) fn errors(&self) -> MapErrors {
        let displaced = |offset: &[i32; 3]| offset.iter().map(|along| along.unsigned_abs()).max().unwrap_or(0);
        let displaced_by: Vec<u32> = self.offsets.iter().map(displaced).collect();
        let mut errors = MapErrors::default();
        for cell in self.cells.iter().filter(|&&cell| cell & STATE_MASK != UNKNOWN) {
            match displaced_by[usize::from(cell >> STATE_BITS)] {
                0 => errors.right += 1,
                1 => errors.off_by_1 += 1,
                2 => errors.off_by_2 += 1,
                _ => errors.off_by_more += 1,
            }
        }
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_enter_cells_where_they_are_believed_to_be() {
        let mut belief = Belief::new(Extent::new([10, 4, 4], 0.5).unwrap());
        let first = belief.enter(&[0, 1, 2], Terrain::Free);
        assert_eq!((first.new, first.revised.len()), (vec![0, 1, 2], 0));
        assert!(belief.enter(&[1], Terrain::Free).new.is_empty());
        belief.begin_block([2, 0, 0]);
        assert_eq!(belief.offset_m(), Vector3::new(1.0, 0.0, 0.0));
        // Cell 0 is at 2 now, and cell 9 outside.
        let second = belief.enter(&[0, 1, 9], Terrain::Wall);
        assert_eq!((second.new, second.revised), (vec![2, 3], vec![2]));
        assert_eq!(belief.errors(), MapErrors { right: 2, off_by_2: 2, ..MapErrors::default() });
        assert!(belief.knows(0) && !belief.knows(5) && !belief.knows(9));
        belief.forget(vec![3]);
        assert_eq!((belief.errors().cells(), belief.blocks_begun()), (3, 1));
    }
}
