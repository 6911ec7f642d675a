//! The map that an agent gets from its own sensor: where each true cell is on it, block by block.
//!
//! The agent itself may know more, from other agents; those cells are not here.

use std::collections::BTreeMap;
use std::iter::Sum;
use std::ops::Add;

use nalgebra::Vector3;
use voxels::{Cell, Extent, Terrain};

/// Bits of a cell that hold its state; the others number the block that has entered it last.
const STATE_BITS: u32 = 2;
const UNKNOWN: u32 = 0;
const FREE: u32 = 1;
const WALL: u32 = 2;
const STATE_MASK: u32 = (1 << STATE_BITS) - 1;

/// Largest number of blocks of one agent: as many as have numbers. One in each tick makes so many
/// in 248 days of sim time; in the last one it stays.
const BLOCKS_MAX: usize = 1 << (u32::BITS - STATE_BITS);

/// The map of an agent from its own sensor.
#[derive(Debug)]
pub(super) struct Belief {
    extent: Extent,
    /// By index of a cell on the map of the agent: state and block.
    cells: Vec<u32>,
    /// What each block adds to a true cell.
    offsets: Vec<[i32; 3]>,
    /// Whether a block is what others have left behind, rather than one that was built.
    is_left: Vec<bool>,
    /// By offset the block of what others have left behind there, which never moves again.
    left: BTreeMap<[i32; 3], usize>,
    /// The block that is being built.
    present: usize,
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
        let cells = vec![UNKNOWN; extent.volume()];
        Self { extent, cells, offsets: vec![[0; 3]], is_left: vec![false], left: BTreeMap::new(), present: 0 }
    }

    /// What the present block adds to a true cell.
    pub(super) fn offset(&self) -> [i32; 3] {
        self.offset_of(self.present)
    }

    /// What a block adds to a true cell.
    pub(super) fn offset_of(&self, block: usize) -> [i32; 3] {
        self.offsets.get(block).copied().unwrap_or_default()
    }

    /// The number of the present block.
    pub(super) fn present(&self) -> usize {
        self.present
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
        self.present = self.add_block(offset, false);
    }

    fn add_block(&mut self, offset: [i32; 3], is_left: bool) -> usize {
        self.offsets.push(offset);
        self.is_left.push(is_left);
        self.offsets.len() - 1
    }

    /// The block of what others have left behind at an offset.
    fn left_at(&mut self, offset: [i32; 3]) -> usize {
        if let Some(&block) = self.left.get(&offset) {
            return block;
        }
        let block = self.add_block(offset, true);
        self.left.insert(offset, block);
        block
    }

    /// Number of blocks that were built after the first.
    pub(super) fn blocks_begun(&self) -> u64 {
        self.is_left.iter().filter(|&&is_left| !is_left).count() as u64 - 1
    }

    /// The blocks that were built after this one, ascending.
    pub(super) fn built_after(&self, block: usize) -> impl Iterator<Item = usize> + '_ {
        (block + 1..self.offsets.len()).filter(|&later| !self.is_left[later])
    }

    /// Moves blocks by so many cells each, by ascending number. Of two blocks that have the same
    /// cell then, the later one holds. What they leave behind stays until something else is entered
    /// there. Nothing moves if there are no numbers left for that.
    pub(super) fn move_blocks(&mut self, moved: &BTreeMap<usize, [i32; 3]>) -> [Entered; 2] {
        if self.offsets.len() + moved.len() >= BLOCKS_MAX {
            return Default::default();
        }
        let mut entries = Vec::new();
        for (cell, &entry) in (0_u32..).zip(&self.cells) {
            let block = (entry >> STATE_BITS) as usize;
            if entry & STATE_MASK != UNKNOWN && moved.contains_key(&block) {
                entries.push((block, cell, entry & STATE_MASK));
            }
        }
        entries.sort_unstable();
        let left: BTreeMap<usize, usize> =
            moved.keys().map(|&block| (block, self.left_at(self.offset_of(block)))).collect();
        for &(block, cell, state) in &entries {
            self.cells[cell as usize] = (left[&block] as u32) << STATE_BITS | state;
        }
        for (&block, by) in moved {
            (0..3).for_each(|axis| self.offsets[block][axis] += by[axis]);
        }
        let mut before: BTreeMap<u32, u32> = BTreeMap::new();
        for (block, cell, state) in entries {
            let Some(cell) = neighbour(self.extent, cell, moved[&block]) else { continue };
            let present = self.cells[cell as usize];
            let holder = (present >> STATE_BITS) as usize;
            if present & STATE_MASK != UNKNOWN && !self.is_left[holder] && holder > block {
                continue;
            }
            before.entry(cell).or_insert(present & STATE_MASK);
            self.cells[cell as usize] = (block as u32) << STATE_BITS | state;
        }
        let mut entered: [Entered; 2] = Default::default();
        for (cell, before) in before {
            let state = self.cells[cell as usize] & STATE_MASK;
            if state != before {
                let of_state = &mut entered[usize::from(state == WALL)];
                of_state.new.push(cell);
                of_state.revised.extend((before != UNKNOWN).then_some(cell));
            }
        }
        entered
    }

    /// Where the present block has a true cell, by index; `None`: outside the map.
    pub(super) fn cell_of(&self, cell: u32) -> Option<u32> {
        neighbour(self.extent, cell, self.offset())
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
        let block = self.present as u32;
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
            match displaced_by[(cell >> STATE_BITS) as usize] {
                0 => errors.right += 1,
                1 => errors.off_by_1 += 1,
                2 => errors.off_by_2 += 1,
                _ => errors.off_by_more += 1,
            }
        }
        errors
    }
}

/// The cell that is so many cells from a cell, by index; `None`: outside the map.
fn neighbour(extent: Extent, cell: u32, [by_x, by_y, by_z]: [i32; 3]) -> Option<u32> {
    let Cell { x, y, z } = extent.cell_at(cell as usize);
    extent.index(Cell::new(x + by_x, y + by_y, z + by_z)).map(|index| index as u32)
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

    #[test]
    fn moved_blocks_leave_what_nothing_else_holds() {
        let mut belief = Belief::new(Extent::new([10, 4, 4], 1.0).unwrap());
        belief.enter(&[0, 1], Terrain::Free);
        belief.begin_block([2, 0, 0]);
        belief.enter(&[1, 2], Terrain::Free);
        belief.enter(&[3], Terrain::Wall);
        assert_eq!(belief.built_after(0).collect::<Vec<_>>(), [1]);
        // The free cells of the block are at 3 and 4, its wall at 5: now at 1, 2 and 3.
        let [free, wall] = belief.move_blocks(&[(1, [-2, 0, 0])].into());
        assert_eq!((free.new, free.revised.len()), (vec![2], 0));
        assert_eq!((wall.new, wall.revised), (vec![3], vec![3]));
        assert_eq!((belief.offset(), belief.blocks_begun()), ([0; 3], 1));
        // 0, 1, 2 and 3 are right; what is left at 4 and 5 is off by two.
        assert_eq!(belief.errors(), MapErrors { right: 4, off_by_2: 2, ..MapErrors::default() });
    }

    #[test]
    fn blocks_begin_and_move_however_many_there_were() {
        let mut belief = Belief::new(Extent::new([10, 4, 4], 0.1).unwrap());
        for number in 1..40_000 {
            assert!(belief.has_room());
            belief.begin_block([number % 3, 0, 0]);
            belief.enter(&[1], Terrain::Free);
            // To where the block before it was.
            belief.move_blocks(&[(belief.present(), [(number + 2) % 3 - number % 3, 0, 0])].into());
        }
        assert_eq!((belief.offset(), belief.blocks_begun()), ([2, 0, 0], 39_999));
        // Beside those that were built, one block for each offset that was left.
        assert_eq!(belief.offsets.len(), 40_000 + 3);
    }
}
