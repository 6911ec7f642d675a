//! Ray casting in bundles, written so that the compiler vectorises it.
//!
//! Every lane does what [`super::cast_ray`] does, operation by operation; Rust never fuses
//! multiplications and additions. All lanes compute in every round, and lanes whose rays have ended
//! keep their slots. The lanes of a bundle are cast side by side, or in parts of as many as the
//! registers of the processor hold.

use super::{Marks, NewCells, Start};
use crate::lidar::pattern::{Bundle, Cone, LANES};
use crate::lidar::slots::word;

/// A bit for each lane of a bundle, 1 if the lane is active.
type LaneSet = u16;

const _: () = assert!(LaneSet::BITS as usize == LANES);

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2")]
pub(super) fn scan_avx2(
    marks: &mut Marks,
    start: &Start,
    bundles: &[Bundle],
    clear: f64,
    new: &mut NewCells<'_>,
) -> u64 {
    scan::<{ LANES / 2 }>(marks, start, bundles, clear, new)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,avx512f,avx512vl,avx512dq,avx512bw")]
pub(super) fn scan_avx512(
    marks: &mut Marks,
    start: &Start,
    bundles: &[Bundle],
    clear: f64,
    new: &mut NewCells<'_>,
) -> u64 {
    scan::<LANES>(marks, start, bundles, clear, new)
}

/// Casts parts of `SIDE` lanes.
#[inline(always)]
fn scan<const SIDE: usize>(
    marks: &mut Marks,
    start: &Start,
    bundles: &[Bundle],
    clear: f64,
    new: &mut NewCells<'_>,
) -> u64 {
    let is_limited = start.limit < f64::INFINITY;
    let has_blind_range = start.has_blind_range();
    let mut rays = 0;
    for bundle in bundles {
        let mut on = lanes_on(bundle, start.cone());
        rays += u64::from(on.count_ones());
        if has_blind_range {
            on = start.sighted(marks, bundle, on);
        }
        for first in (0..LANES).step_by(SIDE) {
            let part = Part { bundle, first, on: on >> first & low_lanes::<SIDE>(), clear };
            if is_limited {
                cast::<true, SIDE>(marks, start, &part, new);
            } else {
                cast::<false, SIDE>(marks, start, &part, new);
            }
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

/// The lowest lanes.
const fn low_lanes<const SIDE: usize>() -> LaneSet {
    LaneSet::MAX >> (LANES - SIDE)
}

/// Neighbouring lanes of a bundle.
struct Part<'b> {
    bundle: &'b Bundle,
    /// The first of them.
    first: usize,
    /// Those whose rays are cast, the first one lowest.
    on: LaneSet,
    /// All cells that they enter up to this length pass.
    clear: f64,
}

/// Casts the rays of a part of a bundle.
#[inline(always)]
fn cast<const LIMITED: bool, const SIDE: usize>(
    marks: &mut Marks,
    start: &Start,
    &Part { bundle, first: first_lane, mut on, clear }: &Part<'_>,
    new: &mut NewCells<'_>,
) {
    let first = start.first(bundle);
    let flip = start.slots.flip(bundle.goes_down);
    let [mask_x, mask_y, mask_z] = start.slots.masks();
    // By loops, which are compiled for this processor; calls of `map` are not.
    let [mut x, mut y, mut z] = [[0.0; SIDE]; 3];
    let [mut next_x, mut next_y, mut next_z] = [[0.0; SIDE]; 3];
    for lane in 0..SIDE {
        x[lane] = bundle.inverse[0][first_lane + lane];
        y[lane] = bundle.inverse[1][first_lane + lane];
        z[lane] = bundle.inverse[2][first_lane + lane];
        next_x[lane] = x[lane] * first[0];
        next_y[lane] = y[lane] * first[1];
        next_z[lane] = z[lane] * first[2];
    }
    let mut flipped = [start.slot ^ flip; SIDE];
    if clear > 0.0 {
        // What is left is what rays that were followed cell by cell would come to.
        let until = clear.min(start.limit);
        let by_x = pass_boundaries(&mut next_x, &x, until);
        let by_y = pass_boundaries(&mut next_y, &y, until);
        let by_z = pass_boundaries(&mut next_z, &z, until);
        for lane in 0..SIDE {
            flipped[lane] = start.slots.ahead(flipped[lane], [by_x[lane], by_y[lane], by_z[lane]]);
        }
    }
    let mut slots = [0; SIDE];
    let mut is_beyond = [0; SIDE];
    let mut stopped = [0; SIDE];
    while on != 0 {
        // An array in which single lanes are ended would have to be in memory.
        let mut active = [0; SIDE];
        for (lane, active) in active.iter_mut().enumerate() {
            *active = mask(on >> lane & 1 != 0);
        }
        let passes = marks.passes();
        // Their number is a power of two and each combination of bits is a slot, so this changes no
        // place; it shows the compiler that all of them are in bounds.
        debug_assert!(passes.len().is_power_of_two(), "{} words", passes.len());
        let Some(places) = passes.len().checked_sub(1) else { return };
        // Up to a round in which a lane does not just pass.
        loop {
            for lane in 0..SIDE {
                let is_x = next_x[lane] <= next_y[lane] && next_x[lane] <= next_z[lane];
                let is_y = !is_x && next_y[lane] <= next_z[lane];
                let is_z = !is_x && !is_y;
                // By masks of bits, so that the compiler keeps all lanes in registers. To add 0
                // changes nothing.
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
            let mut words = [0; SIDE];
            for (lane, word_there) in words.iter_mut().enumerate() {
                *word_there = passes[word(slots[lane]) & places];
            }
            let mut is_any = 0;
            for lane in 0..SIDE {
                let stops = (words[lane] >> (slots[lane] & 63) & 1).wrapping_sub(1);
                stopped[lane] = if LIMITED { stops | is_beyond[lane] } else { stops } & active[lane];
                is_any |= stopped[lane];
            }
            if is_any != 0 {
                break;
            }
        }
        if LIMITED {
            on &= !lanes_of(&is_beyond);
        }
        let halted = on & lanes_of(&stopped);
        if halted != 0 {
            on &= !see_lanes(marks, &slots, halted, new);
        }
    }
}

/// A bit for each lane whose mask is set.
#[inline(always)]
fn lanes_of<const SIDE: usize>(masks: &[u64; SIDE]) -> LaneSet {
    let mut lanes = 0;
    for (lane, mask) in masks.iter().enumerate() {
        lanes |= (*mask as LaneSet & 1) << lane;
    }
    lanes
}

/// Moves the next crossings of boundaries across an axis beyond a length, in steps of `between`;
/// returns how many are passed. Crossings are sums of the same terms as in single steps.
#[inline(always)]
fn pass_boundaries<const SIDE: usize>(next: &mut [f64; SIDE], between: &[f64; SIDE], until: f64) -> [u64; SIDE] {
    let mut counts = [0_u64; SIDE];
    loop {
        let mut is_any = 0;
        for lane in 0..SIDE {
            let is_passed = mask(next[lane] <= until);
            next[lane] += f64::from_bits(between[lane].to_bits() & is_passed);
            counts[lane] = counts[lane].wrapping_sub(is_passed);
            is_any |= is_passed;
        }
        if is_any == 0 {
            return counts;
        }
    }
}

/// All bits if the condition holds, otherwise none.
#[inline(always)]
fn mask(condition: bool) -> u64 {
    u64::from(condition).wrapping_neg()
}

/// Sees the cells of the lanes that have met one that they do not just pass; returns the lanes
/// whose rays end there. Several lanes may have met the same cell.
#[inline(never)]
fn see_lanes(marks: &mut Marks, slots: &[u64], mut halted: LaneSet, new: &mut NewCells<'_>) -> LaneSet {
    let mut ended = 0;
    while halted != 0 {
        let lane = halted.trailing_zeros();
        halted &= halted - 1;
        ended |= LaneSet::from(!marks.see(slots[lane as usize], new)) << lane;
    }
    ended
}
