//! How far the rays of a group surely cross only cells that pass: up to the nearest cell that does
//! not and that one of them may enter.
//!
//! The blocks around the body are gone through with growing distance, so that the first one in
//! which a group may enter a cell that does not pass is the nearest one.

use voxels::bits;

use super::{Groups, IN_BLOCK, IN_BLOCK_BITS, Octant, place_in_block};
use crate::lidar::cast::Start;
use crate::lidar::marks::Marks;
use crate::lidar::slots::Slots;

/// How much less than their distance blocks are taken to be away, because of rounding.
const DISTANCE_SLACK_CELLS: f64 = 1e-4;

/// The blocks around a body by their distance.
pub(super) struct ClearCells {
    /// By place of the body's cell in its block (see [`super::Passing::blocks`]), the nearest
    /// first.
    nearest: [Vec<NearBlock>; 8],
    block_bits: u32,
    /// All cells beyond the blocks are farther away than this.
    end_cells: f64,
}

/// A block that rays may enter.
struct NearBlock {
    /// Every point of it is farther than this from every point in the body's cell, cells.
    distance_cells: f32,
    /// Its offset in blocks, away from the body.
    offset: [u8; 3],
}

impl ClearCells {
    /// The blocks of 2 x 2 x 2 cells with offsets below `1 << offset_bits` cells along each axis.
    pub(super) fn new(offset_bits: u32) -> Self {
        let block_bits = offset_bits - 1;
        Self {
            nearest: [0, 1, 2, 3, 4, 5, 6, 7].map(|place| nearest_blocks(place, block_bits)),
            block_bits,
            // The last cell may lie beyond the last block, and the body at the far side of its own.
            end_cells: f64::from((1_u32 << offset_bits).saturating_sub(3)),
        }
    }

    /// By group, a length in cells up to which all cells that the rays of these groups enter pass.
    pub(super) fn of_groups(
        &self,
        octant: &Octant,
        mut groups: Groups,
        start: &Start,
        marks: &Marks,
    ) -> [f64; Groups::BITS as usize] {
        let slots = start.slots();
        let flip = slots.flip(octant.goes_down);
        let home = start.slot() ^ flip;
        let place = place_in_block(home);
        let passing = octant.passing.blocks(place);
        let along = self.octants_along(slots, home & !IN_BLOCK_BITS, flip);
        let mut clear_cells = [self.end_cells; Groups::BITS as usize];
        for &NearBlock { distance_cells, offset } in &self.nearest[place] {
            if groups == 0 {
                break;
            }
            let [x, y, z] = offset.map(usize::from);
            let entered = groups & passing[x | y << self.block_bits | z << (2 * self.block_bits)];
            if entered == 0 {
                continue;
            }
            let stops = marks.octant_stops(along[0][x] | along[1][y] | along[2][z]);
            let halted = entered & entering_any(octant, stops, flip, offset, place);
            groups &= !halted;
            for group in bits(halted) {
                clear_cells[group as usize] = f64::from(distance_cells).min(self.end_cells);
            }
        }
        clear_cells
    }

    /// By axis and offset in blocks, what the octant of the marks has of its number along the axis;
    /// `home` is the flipped slot of the first block.
    fn octants_along(&self, slots: &Slots, home: u64, flip: u64) -> [Vec<u64>; 3] {
        let masks = slots.masks();
        [0, 1, 2].map(|axis: usize| {
            let mut along = home;
            let octants = (0..1 << self.block_bits).map(|_: u32| {
                let octant = ((along ^ flip) & masks[axis] & !IN_BLOCK_BITS) >> IN_BLOCK;
                along = slots.above(slots.above(along, axis), axis);
                octant
            });
            octants.collect()
        })
    }
}

/// The groups that may enter one of these cells of a block with this offset; `place` is that of the
/// body's cell in its block.
fn entering_any(octant: &Octant, cells: u8, flip: u64, offset: [u8; 3], place: usize) -> Groups {
    let groups_of = |cell: u32| {
        let flipped = u64::from(cell) ^ flip & IN_BLOCK_BITS;
        let along = |axis: usize| 2 * i32::from(offset[axis]) + bit_of(flipped, axis) - bit_of(place as u64, axis);
        let offset = [along(0), along(1), along(2)];
        let is_ahead = offset.iter().all(|&cells| cells >= 0);
        if is_ahead { octant.passing.cell(offset.map(i32::cast_unsigned)) } else { 0 }
    };
    bits(cells.into()).map(groups_of).fold(0, |all, groups| all | groups)
}

fn bit_of(number: u64, place: usize) -> i32 {
    (number >> place & 1) as i32
}

/// The blocks with offsets below `1 << block_bits` along each axis, nearest first.
fn nearest_blocks(place: u64, block_bits: u32) -> Vec<NearBlock> {
    let side = 1_u32 << block_bits;
    let offset = |at: u32| [at % side, at / side % side, at / side / side].map(|along| along as u8);
    let mut offsets: Vec<[u8; 3]> = (0..side * side * side).map(offset).collect();
    let squared = |offset: &[u8; 3]| -> i32 {
        let gap = |axis: usize| (2 * i32::from(offset[axis]) - bit_of(place, axis) - 1).max(0);
        (0..3).map(|axis| gap(axis) * gap(axis)).sum()
    };
    offsets.sort_by_key(|offset| (squared(offset), *offset));
    let near = |offset| {
        let distance_cells = f64::from(squared(&offset)).sqrt() - DISTANCE_SLACK_CELLS;
        NearBlock { distance_cells: distance_cells.max(0.0) as f32, offset }
    };
    offsets.into_iter().map(near).collect()
}
