//! Ray casting through the marks of a sensor; most of a run's time is spent here.
//!
//! The traversal of `voxels::traverse` (Amanatides and Woo), twice: ray by ray ([`cast_ray`]),
//! which is the definition, and in bundles of rays ([`bundles`]), which the compiler vectorises.
//! The lanes of a bundle do the same `f64` operations as a single ray, so only the order of new
//! cells depends on the processor.

#[cfg(any(target_arch = "x86_64", test))]
mod bundles;

use voxels::Cell;

use super::engine::NewCells;
use super::marks::Marks;
use super::pattern::{Bundle, Cone};
use super::slots::{Slots, bit, word};

/// The start of the rays of a scan, and their common parameters.
pub(super) struct Start {
    slots: Slots,
    slot: u64,
    /// The slot of the body's cell.
    own_slot: u64,
    /// Distances along the axes to the upper boundaries of the body's cell, in cells.
    above: [f64; 3],
    /// Distances to the lower boundaries.
    below: [f64; 3],
    /// Range of the rays in lengths of their directions.
    limit: f64,
    /// A ray that meets a wall up to here has no return, in the same lengths.
    blind: f64,
    cone: Option<Cone>,
}

impl Start {
    /// The cells are that of the body and that of the sensor; `position`, in cells, is that of the
    /// sensor. The lengths of rays are from `blind` to `limit`.
    pub(super) fn new(
        slots: Slots,
        [own, cell]: [Cell; 2],
        position: [f64; 3],
        [blind, limit]: [f64; 2],
        cone: Option<Cone>,
    ) -> Self {
        let floor = [cell.x, cell.y, cell.z].map(f64::from);
        Self {
            slots,
            slot: slots.of(cell),
            own_slot: slots.of(own),
            above: [0, 1, 2].map(|axis| floor[axis] + 1.0 - position[axis]),
            below: [0, 1, 2].map(|axis| position[axis] - floor[axis]),
            limit,
            blind,
            cone,
        }
    }

    /// Range of the rays in lengths of their directions.
    pub(super) fn limit(&self) -> f64 {
        self.limit
    }

    /// Whether something at this distance is too near, in the same lengths.
    pub(super) fn is_too_near(&self, distance: f64) -> bool {
        self.blind > 0.0 && distance <= self.blind
    }

    /// The slot of the cell in which rays begin.
    pub(super) fn slot(&self) -> u64 {
        self.slot
    }

    /// Sees the cells of the body and of the sensor, which are free.
    pub(super) fn see_own(&self, marks: &mut Marks, new: &mut NewCells<'_>) {
        marks.see(self.own_slot, new);
        marks.see(self.slot, new);
    }

    /// Whether a ray meets a wall so near that it has no return.
    #[inline(always)]
    pub(super) fn is_blind(&self, marks: &Marks, bundle: &Bundle, lane: usize) -> bool {
        self.blind > 0.0 && self.meets_wall(marks, bundle, lane)
    }

    /// The same for the lanes of a bundle that are given, one bit each; returns those that do not.
    #[cfg(any(target_arch = "x86_64", test))]
    #[inline(never)]
    pub(super) fn sighted(&self, marks: &Marks, bundle: &Bundle, lanes: u16) -> u16 {
        let is_sighted = |lane: &u32| !self.meets_wall(marks, bundle, *lane as usize);
        voxels::bits(lanes.into()).filter(is_sighted).fold(0, |sighted, lane| sighted | 1 << lane)
    }

    /// Whether rays may have no return because a wall is too near.
    #[inline(always)]
    pub(super) fn has_blind_range(&self) -> bool {
        self.blind > 0.0
    }

    fn meets_wall(&self, marks: &Marks, bundle: &Bundle, lane: usize) -> bool {
        let hit = cast_ray_within(self, self.blind, bundle, lane, |slot| marks.is_free(slot));
        hit.is_some_and(|(slot, _)| self.slots.extent().contains(self.slots.cell(slot)))
    }

    /// The slots of the map.
    pub(super) fn slots(&self) -> &Slots {
        &self.slots
    }

    /// The field of view, `None` if unlimited.
    pub(super) fn cone(&self) -> Option<&Cone> {
        self.cone.as_ref()
    }

    /// Distances to the boundaries that rays of this bundle cross first.
    fn first(&self, bundle: &Bundle) -> [f64; 3] {
        [0, 1, 2].map(|axis| if bundle.goes_down[axis] { self.below[axis] } else { self.above[axis] })
    }
}

/// Follows one ray until `enter` returns false for a slot, and returns that slot and the distance
/// at which it was entered, in lengths of the ray's direction; `None` if the ray's length ends
/// first. The start's own cell is not entered.
#[inline(always)]
pub(super) fn cast_ray(
    start: &Start,
    bundle: &Bundle,
    lane: usize,
    enter: impl FnMut(u64) -> bool,
) -> Option<(u64, f64)> {
    cast_ray_within(start, start.limit, bundle, lane, enter)
}

/// The same for a ray of another length.
#[inline(always)]
pub(super) fn cast_ray_within(
    start: &Start,
    limit: f64,
    bundle: &Bundle,
    lane: usize,
    mut enter: impl FnMut(u64) -> bool,
) -> Option<(u64, f64)> {
    let first = start.first(bundle);
    let flip = start.slots.flip(bundle.goes_down);
    let [x, y, z] = [0, 1, 2].map(|axis| bundle.inverse[axis][lane]);
    let (mut next_x, mut next_y, mut next_z) = (first[0] * x, first[1] * y, first[2] * z);
    let mut flipped = start.slot ^ flip;
    loop {
        let entry;
        if next_x <= next_y && next_x <= next_z {
            entry = next_x;
            next_x += x;
            flipped = start.slots.above(flipped, 0);
        } else if next_y <= next_z {
            entry = next_y;
            next_y += y;
            flipped = start.slots.above(flipped, 1);
        } else {
            entry = next_z;
            next_z += z;
            flipped = start.slots.above(flipped, 2);
        }
        if entry > limit {
            return None;
        }
        let slot = flipped ^ flip;
        if !enter(slot) {
            return Some((slot, entry));
        }
    }
}

/// Implementations of a scan, all with the same result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kernel {
    /// Ray by ray, on any processor.
    Single,
    /// Bundle by bundle, in vector code for AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Bundle by bundle, in vector code for AVX-512.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Kernel {
    /// From the slowest to the fastest.
    const ALL: &[Kernel] = &[
        Kernel::Single,
        #[cfg(target_arch = "x86_64")]
        Kernel::Avx2,
        #[cfg(target_arch = "x86_64")]
        Kernel::Avx512,
    ];

    /// The fastest kernel that this processor can run.
    pub(super) fn best() -> Kernel {
        Self::available().next_back().unwrap_or(Kernel::Single)
    }

    /// The kernels that this processor can run, from the slowest to the fastest.
    pub(super) fn available() -> impl DoubleEndedIterator<Item = Kernel> {
        Self::ALL.iter().copied().filter(|kernel| kernel.is_available())
    }

    fn is_available(self) -> bool {
        match self {
            Kernel::Single => true,
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => {
                is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2")
            }
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx512 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
            }
        }
    }

    /// Casts the rays of these bundles that are in the field of view, marks the cells they hit and
    /// adds those that are seen for the first time to `new`; returns the number of rays. All cells
    /// that they enter up to a length of `clear` pass.
    #[cfg_attr(
        target_arch = "x86_64",
        expect(
            unsafe_code,
            reason = "vector code is two to three times as fast; only the caller can know that it may run"
        )
    )]
    pub(super) fn scan(
        self,
        marks: &mut Marks,
        start: &Start,
        bundles: &[Bundle],
        clear: f64,
        new: &mut NewCells<'_>,
    ) -> u64 {
        assert!(self.is_available(), "{self:?} is for another processor");
        match self {
            Kernel::Single => scan_singly(marks, start, bundles, new),
            // SAFETY: `scan_avx2` is safe except for the processor features that it requires, which
            // `is_available` has just checked.
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => unsafe { bundles::scan_avx2(marks, start, bundles, clear, new) },
            // SAFETY: as for `scan_avx2`.
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx512 => unsafe { bundles::scan_avx512(marks, start, bundles, clear, new) },
        }
    }
}

fn scan_singly(marks: &mut Marks, start: &Start, bundles: &[Bundle], new: &mut NewCells<'_>) -> u64 {
    let mut rays = 0;
    for bundle in bundles {
        for lane in bundle.lanes(start.cone()) {
            rays += 1;
            if start.is_blind(marks, bundle, lane) {
                continue;
            }
            cast_ray(start, bundle, lane, |slot| marks.passes()[word(slot)] & bit(slot) != 0 || marks.see(slot, new));
        }
    }
    rays
}
