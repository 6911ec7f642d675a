//! Which groups of the rays of an octant can enter a cell, or a block of 2 x 2 x 2 cells, by its
//! offset from the body's cell: tables that depend on the rays alone.
//!
//! Offsets count away from the body along each axis, so they are never negative. The tables hold
//! for every position in the body's cell.

use super::{Groups, SLACK_CELLS};
use crate::lidar::Pattern;
use crate::lidar::pattern::Bundle;

/// The tables of one octant.
pub(super) struct Passing {
    offset_bits: u32,
    /// By offset in cells, x first.
    cells: Vec<Groups>,
    /// By place of the body's cell in its block (see [`Passing::blocks`]), then by offset in
    /// blocks.
    blocks: [Vec<Groups>; 8],
}

impl Passing {
    /// The tables of bundles of one octant, of which `bundles_per_group` are a group, for offsets
    /// below `1 << offset_bits` cells along each axis.
    pub(super) fn new(pattern: &Pattern, bundles: &[Bundle], bundles_per_group: usize, offset_bits: u32) -> Self {
        let mut cells = vec![0; 1 << (3 * offset_bits)];
        for (group, bundles) in bundles.chunks(bundles_per_group).enumerate() {
            for bundle in bundles {
                for lane in bundle.lanes(None) {
                    let direction = [0, 1, 2].map(|axis| bundle.direction(lane)[axis].abs());
                    for_each_entered(pattern, direction, 1 << offset_bits, |[x, y, z]| {
                        cells[(x | y << offset_bits | z << (2 * offset_bits)) as usize] |= 1 << group;
                    });
                }
            }
        }
        let blocks = [0, 1, 2, 3, 4, 5, 6, 7].map(|place| of_blocks(&cells, place, offset_bits));
        Self { offset_bits, cells, blocks }
    }

    /// The groups that can enter the cell at an offset: all, beyond the table.
    pub(super) fn cell(&self, offset: [u32; 3]) -> Groups {
        let [x, y, z] = offset;
        if (x | y | z) >> self.offset_bits != 0 {
            return Groups::MAX;
        }
        self.cells[(x | y << self.offset_bits | z << (2 * self.offset_bits)) as usize]
    }

    /// By offset in blocks, the groups that can enter a block, if the body's cell has this place in
    /// its own: bit 0 is set if it is the farther cell along x, bit 1 along y, bit 2 along z, where
    /// rays go from the nearer to the farther.
    pub(super) fn blocks(&self, place: usize) -> &[Groups] {
        &self.blocks[place]
    }
}

fn of_blocks(cells: &[Groups], place: u32, offset_bits: u32) -> Vec<Groups> {
    let side = 1_u32 << offset_bits;
    let block_bits = offset_bits - 1;
    let mut blocks = vec![0; 1 << (3 * block_bits)];
    let along = |offset: u32, axis: u32| (offset + (place >> axis & 1)) / 2;
    for z in 0..side {
        for y in 0..side {
            for x in 0..side {
                let [bx, by, bz] = [along(x, 0), along(y, 1), along(z, 2)];
                if (bx | by | bz) >> block_bits == 0 {
                    blocks[(bx | by << block_bits | bz << (2 * block_bits)) as usize] |=
                        cells[(x | y << offset_bits | z << (2 * offset_bits)) as usize];
                }
            }
        }
    }
    blocks
}

/// Calls `enter` with the offset of each cell below `side` that a ray can enter from some position
/// in the body's cell; `direction` has no negative component.
fn for_each_entered(pattern: &Pattern, direction: [f64; 3], side: u32, mut enter: impl FnMut([u32; 3])) {
    let longest = direction.into_iter().fold(0.0, f64::max);
    // In lengths of the direction; from there on the ray is beyond all offsets.
    let mut end = f64::from(side + 1) / longest;
    if let Pattern::Shell { .. } = pattern {
        end = end.min(1.0 + SLACK_CELLS);
    }
    // The positions in the cell at an offset minus those in the body's cell are within this of it.
    let within = 1.0 + SLACK_CELLS;
    let narrow = |[from, to]: [f64; 2], axis: usize, offset: u32| {
        let first = (f64::from(offset) - within) / direction[axis];
        let last = (f64::from(offset) + within) / direction[axis];
        [from.max(first), to.min(last)]
    };
    let offsets = |[from, to]: [f64; 2], axis: usize| {
        let lowest = (from * direction[axis] - within).ceil().max(0.0) as u32;
        let highest = (to * direction[axis] + within).floor() as u32;
        lowest..(highest + 1).min(side)
    };
    let whole = [0.0, end];
    for z in offsets(whole, 2) {
        let in_layer = narrow(whole, 2, z);
        for y in offsets(in_layer, 1) {
            let in_row = narrow(in_layer, 1, y);
            if in_row[0] > in_row[1] {
                continue;
            }
            for x in offsets(in_row, 0) {
                enter([x, y, z]);
            }
        }
    }
}
