//! Ray casting in bundles, written so that the compiler vectorises it.
//!
//! Every lane does what [`super::cast_ray`] does, operation by operation; Rust never fuses
//! multiplications and additions. All lanes compute in every round, and lanes whose rays have ended
//! keep their slots.

use super::{CellLists, Field, SEEN, Start};
use crate::world::lidar::pattern::{Bundle, Cone, LANES};

/// Lanes in one word of marks.
const WORD: usize = 8;

/// A word with all lanes active.
const EACH: u64 = 0x0101_0101_0101_0101;

/// One byte per lane of a bundle, the lowest byte first: 1 if the lane is active.
type LaneMarks = [u64; LANES / WORD];

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
pub(super) fn scan_avx2(field: &mut Field<'_>, start: &Start, bundles: &[Bundle], found: &mut CellLists<'_>) -> u64 {
    scan(field, start, bundles, found)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,avx512f,avx512vl,avx512dq,avx512bw")]
pub(super) fn scan_avx512(field: &mut Field<'_>, start: &Start, bundles: &[Bundle], found: &mut CellLists<'_>) -> u64 {
    scan(field, start, bundles, found)
}

#[inline(always)]
fn scan(field: &mut Field<'_>, start: &Start, bundles: &[Bundle], found: &mut CellLists<'_>) -> u64 {
    let is_limited = start.limit < f64::INFINITY;
    let mut rays = 0;
    for bundle in bundles {
        let on = lanes_on(bundle, start.cone());
        rays += on.iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
        if is_limited {
            cast::<true>(field, start, bundle, on, found);
        } else {
            cast::<false>(field, start, bundle, on, found);
        }
    }
    rays
}

/// The lanes whose rays are within the field of view.
#[inline(always)]
fn lanes_on(bundle: &Bundle, cone: Option<&Cone>) -> LaneMarks {
    if cone.is_none() && bundle.is_full() {
        return [EACH; LANES / WORD];
    }
    let mut on = LaneMarks::default();
    for lane in bundle.lanes(cone) {
        on[lane / WORD] |= 1 << (8 * (lane % WORD));
    }
    on
}

/// Casts the rays of the lanes that are `on`.
#[inline(always)]
fn cast<const LIMITED: bool>(
    field: &mut Field<'_>,
    start: &Start,
    bundle: &Bundle,
    mut on: LaneMarks,
    found: &mut CellLists<'_>,
) {
    let (first, [step_x, step_y, step_z]) = start.towards(bundle);
    let [x, y, z] = bundle.inverse;
    // By loops, which are compiled for this processor; calls of `map` are not.
    let [mut next_x, mut next_y, mut next_z] = [x, y, z];
    for lane in 0..LANES {
        next_x[lane] *= first[0];
        next_y[lane] *= first[1];
        next_z[lane] *= first[2];
    }
    let mut slot = [start.slot as i64; LANES];
    while on != LaneMarks::default() {
        for lane in 0..LANES {
            let is_x = next_x[lane] <= next_y[lane] && next_x[lane] <= next_z[lane];
            let is_y = !is_x && next_y[lane] <= next_z[lane];
            let is_z = !is_x && !is_y;
            // By masks of bits, so that the compiler keeps all lanes in registers. To add 0 changes
            // nothing.
            let [of_x, of_y, of_z] = [is_x, is_y, is_z].map(mask);
            let entry = f64::from_bits(
                next_x[lane].to_bits() & of_x | next_y[lane].to_bits() & of_y | next_z[lane].to_bits() & of_z,
            );
            next_x[lane] += f64::from_bits(x[lane].to_bits() & of_x);
            next_y[lane] += f64::from_bits(y[lane].to_bits() & of_y);
            next_z[lane] += f64::from_bits(z[lane].to_bits() & of_z);
            let is_on = on[lane / WORD] & 1 << (8 * (lane % WORD)) != 0;
            let step = step_x as u64 & of_x | step_y as u64 & of_y | step_z as u64 & of_z;
            slot[lane] += (step & mask(is_on)) as i64;
            // Slot 0 is a corner of the layer around the map, where every ray ends.
            slot[lane] = if LIMITED && entry > start.limit { 0 } else { slot[lane] };
        }
        for (word, on) in on.iter_mut().enumerate() {
            let slots = &slot[word * WORD..][..WORD];
            let mut marks = u64::from_le_bytes(std::array::from_fn(|lane| field.seen[slots[lane] as usize]));
            let new = !marks & *on & (EACH * u64::from(SEEN));
            if new != 0 {
                marks |= mark_lanes(field, slots, new, found);
            }
            // The bits of walls and of the outside, each shifted to the lowest bit of its lane.
            *on &= !(marks >> 1 | marks >> 2);
        }
    }
}

/// All bits if the condition holds, otherwise none.
#[inline(always)]
fn mask(condition: bool) -> u64 {
    u64::from(condition).wrapping_neg()
}

/// Marks the cells of the lanes that have hit a new cell, and returns their marks. Several lanes
/// may have hit the same cell.
#[cold]
#[inline(never)]
fn mark_lanes(field: &mut Field<'_>, slots: &[i64], mut new: u64, found: &mut CellLists<'_>) -> u64 {
    let mut marks = 0;
    while new != 0 {
        let lane = new.trailing_zeros() as usize / 8;
        new &= new - 1;
        marks |= u64::from(found.mark(field, slots[lane] as usize)) << (8 * lane);
    }
    marks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::lidar::cast::{OUTSIDE, WALL};

    #[test]
    fn every_stop_ends_a_lane() {
        for mark in [WALL, OUTSIDE] {
            let marks = EACH * u64::from(mark);
            assert_eq!(EACH & !(marks >> 1 | marks >> 2), 0);
        }
    }
}
