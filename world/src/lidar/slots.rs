//! Slots: where the bits of a cell are.
//!
//! A word holds a block of 4 x 4 x 4 cells, a bit for each, and words are numbered x first, then y,
//! then z. In a block the bits of the coordinates alternate (Morton order): x0, y0, z0, x1, y1, z1
//! from the lowest. So each byte of a word holds 2 x 2 x 2 cells, an *octant*, a cache line holds
//! near cells, and rays rarely leave the cache.
//!
//! Each coordinate has bits of its own in a slot. To add 1 to it is to add 1 to the slot with all
//! other bits set, so that the carry passes them. Rays that go down an axis do the same with all
//! bits of that coordinate flipped.
//!
//! Invariants: there is a layer of slots around the map, in which every ray ends; each combination
//! of bits is a slot, so a step cannot lead out of the words.

use voxels::{Cell, Extent};

/// Bits of a slot that number the cell in its block.
const CELL_BITS: u32 = 6;

/// Bits of a coordinate in a block.
const AXIS_BITS: u32 = 2;

/// The slots of a map.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slots {
    extent: Extent,
    /// By axis the bits of the coordinate.
    masks: [u64; 3],
    /// By axis the lowest bit of the coordinate of the block.
    shifts: [u32; 3],
    words: usize,
}

impl Slots {
    pub(super) fn new(extent: Extent) -> Self {
        let bits = extent.size().map(|cells| (cells + 2).div_ceil(1 << AXIS_BITS).next_power_of_two().trailing_zeros());
        let shifts = [CELL_BITS, CELL_BITS + bits[0], CELL_BITS + bits[0] + bits[1]];
        let masks = [0, 1, 2].map(|axis| 1 << axis | 1 << (axis + 3) | ((1 << bits[axis]) - 1) << shifts[axis]);
        Self { extent, masks, shifts, words: 1 << bits.iter().sum::<u32>() }
    }

    pub(super) fn extent(&self) -> Extent {
        self.extent
    }

    /// Number of words that hold all slots.
    pub(super) fn words(&self) -> usize {
        self.words
    }

    /// By axis the bits of the coordinate in a slot.
    pub(super) fn masks(&self) -> [u64; 3] {
        self.masks
    }

    /// The slot of a cell of the map, or of one beside it.
    pub(super) fn of(&self, cell: Cell) -> u64 {
        let along = |axis: usize, at: i32| self.spread(axis, u64::from((at + 1).cast_unsigned()));
        along(0, cell.x) | along(1, cell.y) | along(2, cell.z)
    }

    /// The cell at a slot.
    pub(super) fn cell(&self, slot: u64) -> Cell {
        let along = |axis: usize| {
            let block = (slot & self.masks[axis]) >> self.shifts[axis];
            let at = block << AXIS_BITS | (slot >> (axis + 3) & 1) << 1 | slot >> axis & 1;
            at as i32 - 1
        };
        Cell::new(along(0), along(1), along(2))
    }

    /// The bits that are flipped for rays that go down these axes.
    pub(super) fn flip(&self, goes_down: [bool; 3]) -> u64 {
        (0..3).fold(0, |flip, axis| flip | if goes_down[axis] { self.masks[axis] } else { 0 })
    }

    /// A number of cells along an axis, as the bits of its coordinate in a slot.
    #[inline(always)]
    pub(super) fn spread(&self, axis: usize, cells: u64) -> u64 {
        (cells & 1) << axis | (cells >> 1 & 1) << (axis + 3) | cells >> AXIS_BITS << self.shifts[axis]
    }

    /// The slot so many cells up the axes.
    #[inline(always)]
    pub(super) fn ahead(&self, slot: u64, cells: [u64; 3]) -> u64 {
        let mut slot = slot;
        for (axis, cells) in cells.into_iter().enumerate() {
            let mask = self.masks[axis];
            slot = (slot | !mask).wrapping_add(self.spread(axis, cells)) & mask | slot & !mask;
        }
        slot
    }

    /// The slot of the next cell up an axis.
    #[inline(always)]
    pub(super) fn above(&self, slot: u64, axis: usize) -> u64 {
        step(slot, self.masks[axis])
    }

    /// The slots of the face neighbours of a cell.
    pub(super) fn beside(&self, slot: u64) -> [u64; 6] {
        let [x, y, z] = self.masks;
        [(x, 0), (x, x), (y, 0), (y, y), (z, 0), (z, z)].map(|(mask, flip)| step(slot ^ flip, mask) ^ flip)
    }
}

/// Adds 1 to the coordinate with these bits.
#[inline(always)]
pub(super) fn step(slot: u64, mask: u64) -> u64 {
    (slot | !mask).wrapping_add(1) & mask | slot & !mask
}

/// The bit of a slot in its word.
#[inline(always)]
pub(super) fn bit(slot: u64) -> u64 {
    1 << (slot & 63)
}

/// The word of a slot.
#[inline(always)]
pub(super) fn word(slot: u64) -> usize {
    (slot >> CELL_BITS) as usize
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn slots_are_distinct_and_neighbours_are_beside(size in prop::array::uniform3(1_u32..20)) {
            let slots = Slots::new(Extent::new(size, 1.0).unwrap());
            let around = |cells: u32| -1..=cells.cast_signed();
            let mut used = vec![0_u64; slots.words()];
            for z in around(size[2]) {
                for y in around(size[1]) {
                    for x in around(size[0]) {
                        let cell = Cell::new(x, y, z);
                        let slot = slots.of(cell);
                        prop_assert_eq!(used[word(slot)] & bit(slot), 0);
                        used[word(slot)] |= bit(slot);
                        prop_assert_eq!(slots.cell(slot), cell);
                        if slots.extent().contains(cell) {
                            let [east, west, north, south, up, down] = slots.beside(slot).map(|slot| slots.cell(slot));
                            prop_assert_eq!([east, west], [Cell::new(x + 1, y, z), Cell::new(x - 1, y, z)]);
                            prop_assert_eq!([north, south], [Cell::new(x, y + 1, z), Cell::new(x, y - 1, z)]);
                            prop_assert_eq!([up, down], [Cell::new(x, y, z + 1), Cell::new(x, y, z - 1)]);
                            prop_assert_eq!([0, 1, 2].map(|axis| slots.above(slot, axis)), [east, north, up].map(|cell| slots.of(cell)));
                            let last = Cell::new(size[0] as i32, size[1] as i32, size[2] as i32);
                            let by = [last.x - x, last.y - y, last.z - z].map(|cells| u64::from(cells.cast_unsigned()));
                            prop_assert_eq!(slots.cell(slots.ahead(slot, by)), last);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_largest_map_has_slots() {
        let slots = Slots::new(Extent::new([1024; 3], 1.0).unwrap());
        for cell in [Cell::new(-1, -1, -1), Cell::new(1024, 1024, 1024), Cell::new(1023, 0, 511)] {
            assert_eq!(slots.cell(slots.of(cell)), cell);
            assert!(word(slots.of(cell)) < slots.words());
        }
    }
}
