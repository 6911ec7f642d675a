//! The seen free cells of a memory and their frontier, in blocks of 2 x 2 x 2 cells.
//!
//! Invariants: every seen free cell has its bit in `free`; every seen free cell with a neighbour
//! that has not been seen has its bit in `frontier`. A bit of `frontier` may be out of date;
//! whoever finds that clears it.

/// Blocks of a memory, one byte each with a bit for each cell: bit `x + 2 y + 4 z` for the cell at
/// that place in its block.
///
/// Blocks are numbered like slots. Each axis has spare blocks at both ends, so that a block with a
/// cell of the map has neighbours on all sides.
#[derive(Clone)]
pub(in crate::world::lidar) struct Frontier {
    slot_strides: [usize; 3],
    block_strides: [usize; 3],
    free: Vec<u8>,
    frontier: Vec<u8>,
}

/// Where a cell is in the blocks.
#[derive(Clone, Copy)]
pub(super) struct BlockPlace {
    pub(super) block: usize,
    /// 0 or 1 along each axis.
    pub(super) inside: [usize; 3],
}

impl Frontier {
    /// The blocks of a memory that has seen nothing, with `slots` along each axis.
    pub(in crate::world::lidar) fn new(slots: [usize; 3]) -> Self {
        let [x, y, z] = slots.map(|slots| slots.div_ceil(2) + 2);
        Self {
            slot_strides: [1, slots[0], slots[0] * slots[1]],
            block_strides: [1, x, x * y],
            free: vec![0; x * y * z],
            frontier: vec![0; x * y * z],
        }
    }

    /// Blocks of a memory of the same size that has seen nothing.
    pub(in crate::world::lidar) fn unused(&self) -> Self {
        let (free, frontier) = (vec![0; self.free.len()], vec![0; self.frontier.len()]);
        Self { free, frontier, ..*self }
    }

    /// Notes that a free cell has been seen.
    pub(in crate::world::lidar) fn note_free(&mut self, slot: usize) {
        let BlockPlace { block, inside } = self.place(slot);
        self.free[block] |= bit(inside);
        self.frontier[block] |= bit(inside);
    }

    /// Notes that a free cell has not been seen after all.
    pub(super) fn forget_free(&mut self, slot: usize) {
        let BlockPlace { block, inside } = self.place(slot);
        self.free[block] &= !bit(inside);
        self.frontier[block] &= !bit(inside);
    }

    pub(super) fn place(&self, slot: usize) -> BlockPlace {
        let [_, row, layer] = self.slot_strides;
        let at = [slot % row, slot % layer / row, slot / layer];
        let block = (0..3).map(|axis| (at[axis] / 2 + 1) * self.block_strides[axis]).sum();
        BlockPlace { block, inside: at.map(|slots| slots % 2) }
    }

    /// Steps in blocks along the axes.
    pub(super) fn block_strides(&self) -> [usize; 3] {
        self.block_strides
    }

    /// Whether a block has a free cell that has been seen.
    pub(super) fn has_free(&self, block: usize) -> bool {
        self.free[block] != 0
    }

    /// The cells of a block that may belong to the frontier.
    pub(super) fn of_block(&self, block: usize) -> u8 {
        self.frontier[block]
    }

    /// Removes cells from the frontier.
    pub(super) fn remove(&mut self, block: usize, cells: u8) {
        self.frontier[block] &= !cells;
    }
}

/// The bit of a cell at this place in its block.
fn bit(inside: [usize; 3]) -> u8 {
    1 << (inside[0] | inside[1] << 1 | inside[2] << 2)
}
