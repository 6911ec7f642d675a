//! Ray casting in bundles, written so that the compiler vectorises it.
//!
//! Every lane does what [`super::cast_ray`] does, operation by operation; Rust never fuses
//! multiplications and additions. All lanes compute in every round, and lanes whose rays have ended
//! keep their slots.

use super::{Marks, NewCells, Start};
use crate::world::lidar::pattern::{Bundle, Cone, LANES};
use crate::world::lidar::slots::{bit, word};

/// A bit for each lane of a bundle, 1 if the lane is active.
type LaneSet = u16;

const _: () = assert!(LaneSet::BITS as usize == LANES);

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
pub(super) fn scan_avx2(marks: &mut Marks, start: &Start, bundles: &[Bundle], new: &mut NewCells<'_>) -> u64 {
    scan(marks, start, bundles, new)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,avx512f,avx512vl,avx512dq,avx512bw")]
pub(super) fn scan_avx512(marks: &mut Marks, start: &Start, bundles: &[Bundle], new: &mut NewCells<'_>) -> u64 {
    scan(marks, start, bundles, new)
}

#[inline(always)]
fn scan(marks: &mut Marks, start: &Start, bundles: &[Bundle], new: &mut NewCells<'_>) -> u64 {
    let is_limited = start.limit < f64::INFINITY;
    let mut rays = 0;
    for bundle in bundles {
        let on = lanes_on(bundle, start.cone());
        rays += u64::from(on.count_ones());
        if is_limited {
            cast::<true>(marks, start, bundle, on, new);
        } else {
            cast::<false>(marks, start, bundle, on, new);
        }
    }
    rays
}

/// The lanes whose rays are within the field of view.
#[inline(always)]
fn lanes_on(bundle: &Bundle, cone: Option<&Cone>) -> LaneSet {
    if cone.is_none() && bundle.is_full() {
        return LaneSet::MAX;
    }
    bundle.lanes(cone).fold(0, |on, lane| on | 1 << lane)
}

/// Casts the rays of the lanes that are `on`.
#[inline(always)]
fn cast<const LIMITED: bool>(
    marks: &mut Marks,
    start: &Start,
    bundle: &Bundle,
    mut on: LaneSet,
    new: &mut NewCells<'_>,
) {
    let first = start.first(bundle);
    let flip = start.slots.flip(bundle.goes_down);
    let [mask_x, mask_y, mask_z] = start.slots.masks();
    let [x, y, z] = bundle.inverse;
    // By loops, which are compiled for this processor; calls of `map` are not.
    let [mut next_x, mut next_y, mut next_z] = [x, y, z];
    for lane in 0..LANES {
        next_x[lane] *= first[0];
        next_y[lane] *= first[1];
        next_z[lane] *= first[2];
    }
    let mut flipped = [start.slot ^ flip; LANES];
    let mut slots = [0; LANES];
    let mut is_beyond = [0; LANES];
    let mut active = [0; LANES];
    for (lane, active) in active.iter_mut().enumerate() {
        *active = mask(on >> lane & 1 != 0);
    }
    while on != 0 {
        for lane in 0..LANES {
            let is_x = next_x[lane] <= next_y[lane] && next_x[lane] <= next_z[lane];
            let is_y = !is_x && next_y[lane] <= next_z[lane];
            let is_z = !is_x && !is_y;
            // By masks of bits, so that the compiler keeps all lanes in registers. To add 0 changes
            // nothing.
            let [of_x, of_y, of_z] = [is_x, is_y, is_z].map(mask);
            if LIMITED {
                let entry = f64::from_bits(
                    next_x[lane].to_bits() & of_x | next_y[lane].to_bits() & of_y | next_z[lane].to_bits() & of_z,
                );
                is_beyond[lane] = mask(entry > start.limit);
            }
            next_x[lane] += f64::from_bits(x[lane].to_bits() & of_x);
            next_y[lane] += f64::from_bits(y[lane].to_bits() & of_y);
            next_z[lane] += f64::from_bits(z[lane].to_bits() & of_z);
            // As `slots::step`; with no bits to add to, the slot stays.
            let along = (mask_x & of_x | mask_y & of_y | mask_z & of_z) & active[lane];
            let stepped = (flipped[lane] | !along).wrapping_add(1);
            flipped[lane] = stepped & along | flipped[lane] & !along;
            slots[lane] = flipped[lane] ^ flip;
        }
        if LIMITED {
            let mut beyond: LaneSet = 0;
            for lane in 0..LANES {
                beyond |= ((is_beyond[lane] & active[lane]) as LaneSet & 1) << lane;
            }
            on &= !end(beyond, &mut active);
        }
        let passes = marks.passes();
        let mut halted: LaneSet = 0;
        for (lane, &slot) in slots.iter().enumerate() {
            halted |= LaneSet::from(passes[word(slot)] & bit(slot) == 0) << lane;
        }
        halted &= on;
        if halted != 0 {
            let ended = see_lanes(marks, &slots, halted, new);
            on &= !end(ended, &mut active);
        }
    }
}

/// All bits if the condition holds, otherwise none.
#[inline(always)]
fn mask(condition: bool) -> u64 {
    u64::from(condition).wrapping_neg()
}

/// Ends the rays of these lanes.
#[inline(always)]
fn end(lanes: LaneSet, active: &mut [u64; LANES]) -> LaneSet {
    let mut left = lanes;
    while left != 0 {
        active[left.trailing_zeros() as usize] = 0;
        left &= left - 1;
    }
    lanes
}

/// Sees the cells of the lanes that have met one that they do not just pass; returns the lanes
/// whose rays end there. Several lanes may have met the same cell.
#[inline(never)]
fn see_lanes(marks: &mut Marks, slots: &[u64; LANES], mut halted: LaneSet, new: &mut NewCells<'_>) -> LaneSet {
    let mut ended = 0;
    while halted != 0 {
        let lane = halted.trailing_zeros();
        halted &= halted - 1;
        ended |= LaneSet::from(!marks.see(slots[lane as usize], new)) << lane;
    }
    ended
}
