//! Ray casting through a sensor memory; most of a run's time is spent here.
//!
//! The traversal of `voxels::traverse` (Amanatides and Woo), twice: ray by ray ([`cast_ray`]),
//! which is the definition, and in bundles of rays ([`bundles`]), which the compiler vectorises.
//! The lanes of a bundle do the same `f64` operations as a single ray, so only the order of new
//! cells depends on the processor. Marks are plain bits of a byte, not `bitflags`, because the
//! bundles compute with the marks of eight lanes in one word.

#[cfg(any(target_arch = "x86_64", test))]
mod bundles;

use voxels::Cell;

use super::pattern::{Bundle, Cone};

/// The mark of a free cell.
pub(super) const FREE: u8 = SEEN;
/// The mark of a wall.
pub(super) const WALL: u8 = SEEN | IS_WALL;
/// The mark of slots outside the map.
pub(super) const OUTSIDE: u8 = SEEN | IS_OUTSIDE;
/// The bit of every mark; a cell that has not been seen has the mark 0.
const SEEN: u8 = 1;
const IS_WALL: u8 = 2;
const IS_OUTSIDE: u8 = 4;

/// Whether a ray ends in a cell of this kind.
pub(super) fn is_stop(kind: u8) -> bool {
    kind & (IS_WALL | IS_OUTSIDE) != 0
}

/// Whether this kind is a wall.
pub(super) fn is_wall(kind: u8) -> bool {
    kind & IS_WALL != 0
}

/// The field that rays cross: the kinds of all cells, shared by all agents, and the cells that one
/// agent has seen.
pub(super) struct Field<'a> {
    pub(super) kinds: &'a [u8],
    pub(super) seen: &'a mut [u8],
}

/// Slots (see [`super::memory`]) of cells that a scan sees for the first time.
pub(super) struct CellLists<'a> {
    pub(super) free: &'a mut Vec<u32>,
    pub(super) wall: &'a mut Vec<u32>,
}

impl CellLists<'_> {
    /// Marks a cell as seen, adds it if it is new, and returns its kind.
    pub(super) fn mark(&mut self, field: &mut Field<'_>, slot: usize) -> u8 {
        let kind = field.kinds[slot];
        if std::mem::replace(&mut field.seen[slot], kind) == 0 {
            self.add(kind, slot);
        }
        kind
    }

    /// Adds a cell to the list of its kind; slots outside the map are not listed.
    pub(super) fn add(&mut self, kind: u8, slot: usize) {
        let slot = slot as u32;
        match kind {
            FREE => self.free.push(slot),
            WALL => self.wall.push(slot),
            _ => {}
        }
    }
}

/// The start of the rays of a scan, and their common parameters.
pub(super) struct Start {
    slot: usize,
    /// Distances along the axes to the upper boundaries of the body's cell, in cells.
    above: [f64; 3],
    /// Distances to the lower boundaries.
    below: [f64; 3],
    strides: [i64; 3],
    /// Range of the rays in lengths of their directions.
    limit: f64,
    cone: Option<Cone>,
}

impl Start {
    /// `position` is in cells; `slot` is that of its cell in the memory.
    pub(super) fn new(
        cell: Cell,
        slot: usize,
        strides: [usize; 3],
        position: [f64; 3],
        limit: f64,
        cone: Option<Cone>,
    ) -> Self {
        let floor = [cell.x, cell.y, cell.z].map(f64::from);
        Self {
            slot,
            above: [0, 1, 2].map(|axis| floor[axis] + 1.0 - position[axis]),
            below: [0, 1, 2].map(|axis| position[axis] - floor[axis]),
            strides: strides.map(|stride| stride as i64),
            limit,
            cone,
        }
    }

    /// The slot of the body's own cell.
    pub(super) fn slot(&self) -> usize {
        self.slot
    }

    /// The field of view, `None` if unlimited.
    pub(super) fn cone(&self) -> Option<&Cone> {
        self.cone.as_ref()
    }

    /// Distances to the boundaries that rays of this bundle cross first, and the steps in slots
    /// across them.
    fn towards(&self, bundle: &Bundle) -> ([f64; 3], [i64; 3]) {
        let pick = |axis: usize| if bundle.goes_down[axis] { self.below[axis] } else { self.above[axis] };
        ([0, 1, 2].map(pick), self.steps(bundle.goes_down))
    }

    /// The steps in slots along the axes, for rays that go down those named.
    pub(super) fn steps(&self, goes_down: [bool; 3]) -> [i64; 3] {
        [0, 1, 2].map(|axis| if goes_down[axis] { -self.strides[axis] } else { self.strides[axis] })
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
    mut enter: impl FnMut(usize) -> bool,
) -> Option<(usize, f64)> {
    let (first, [step_x, step_y, step_z]) = start.towards(bundle);
    let [x, y, z] = [0, 1, 2].map(|axis| bundle.inverse[axis][lane]);
    let (mut next_x, mut next_y, mut next_z) = (first[0] * x, first[1] * y, first[2] * z);
    let mut slot = start.slot as i64;
    loop {
        let entry;
        if next_x <= next_y && next_x <= next_z {
            entry = next_x;
            next_x += x;
            slot += step_x;
        } else if next_y <= next_z {
            entry = next_y;
            next_y += y;
            slot += step_y;
        } else {
            entry = next_z;
            next_z += z;
            slot += step_z;
        }
        if entry > start.limit {
            return None;
        }
        if !enter(slot as usize) {
            return Some((slot as usize, entry));
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
            Kernel::Avx2 => is_x86_feature_detected!("avx2"),
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
    /// adds the new ones to `found`; returns the number of rays.
    #[cfg_attr(
        target_arch = "x86_64",
        expect(
            unsafe_code,
            reason = "vector code is two to three times as fast; only the caller can know that it may run"
        )
    )]
    pub(super) fn scan(
        self,
        field: &mut Field<'_>,
        start: &Start,
        bundles: &[Bundle],
        found: &mut CellLists<'_>,
    ) -> u64 {
        assert!(self.is_available(), "{self:?} is for another processor");
        match self {
            Kernel::Single => scan_singly(field, start, bundles, found),
            // SAFETY: `scan_avx2` is safe except for the processor features that it requires, which
            // `is_available` has just checked.
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => unsafe { bundles::scan_avx2(field, start, bundles, found) },
            // SAFETY: as for `scan_avx2`.
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx512 => unsafe { bundles::scan_avx512(field, start, bundles, found) },
        }
    }
}

fn scan_singly(field: &mut Field<'_>, start: &Start, bundles: &[Bundle], found: &mut CellLists<'_>) -> u64 {
    let mut rays = 0;
    for bundle in bundles {
        for lane in bundle.lanes(start.cone()) {
            rays += 1;
            cast_ray(start, bundle, lane, |slot| field.seen[slot] == FREE || !is_stop(found.mark(field, slot)));
        }
    }
    rays
}
