//! What casts a scan, and why a scan or a ray of it is not cast.
//!
//! Every engine marks the same cells as seen and finds the same new ones; they differ in the rays
//! that they follow for that.

use super::{Scanner, SensorMemory};
use crate::body::Pose;

/// Casts the scans of one sensor, in order.
pub(crate) trait Engine {
    /// Casts a scan from `pose`: marks the cells it sees in `memory`, and adds those that the
    /// memory has not seen before to `new`. Returns the count of its rays.
    fn cast(&mut self, scanner: &Scanner, memory: &mut SensorMemory, pose: &Pose, new: NewCells<'_>) -> CastCount;
}

/// The indices of the cells that scans see for the first time, in no particular order.
#[derive(Debug)]
pub(crate) struct NewCells<'a> {
    /// Crossed free cells, and the body's own.
    pub(crate) free: &'a mut Vec<u32>,
    /// Walls that ended a ray.
    pub(crate) wall: &'a mut Vec<u32>,
}

/// Why a scan that is due, or a ray of it, is not cast. No reason changes what a run sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotCast {
    /// A scan: the last one of the sensor was exact and from a pose that sees the same
    /// ([`Scanner::sees_the_same`]).
    SamePose,
    /// A scan: a helper has cast it before it was due.
    CastAhead,
    /// A scan: the position is outside the map.
    OutsideMap,
    /// A ray: it can reach no cell that the sensor has not seen.
    NothingUnseen,
    /// A ray: it is outside the field of view.
    OutsideView,
}

impl NotCast {
    /// Number of reasons.
    const COUNT: usize = Self::OutsideView as usize + 1;

    /// Why a scan that is due from `pose` need not be cast; `None`: it has to be. `last` is the
    /// pose of the scan before, `sees_the_same` whether scans from two poses do; `differs`: two
    /// scans from one pose may see different things.
    #[must_use]
    pub fn of_scan(
        sees_the_same: impl FnOnce(&Pose, &Pose) -> bool,
        differs: bool,
        last: Option<&Pose>,
        pose: &Pose,
    ) -> Option<Self> {
        let is_repeated = !differs && last.is_some_and(|last| sees_the_same(last, pose));
        is_repeated.then_some(Self::SamePose)
    }
}

/// A count of scans or of rays: those that were due, and those of them that were not cast.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CastCount {
    due: u64,
    not_cast: [u64; NotCast::COUNT],
}

impl CastCount {
    /// A count of so many.
    #[must_use]
    pub fn of(due: u64) -> Self {
        Self { due, ..Self::default() }
    }

    /// So many that are not cast, all for the same reason.
    #[must_use]
    pub fn without(due: u64, reason: NotCast) -> Self {
        let mut count = Self::of(due);
        count.leave_out(due, reason);
        count
    }

    /// Notes that so many of those that were due are not cast.
    ///
    /// # Panics
    /// If more are left out than were due.
    pub fn leave_out(&mut self, count: u64, reason: NotCast) {
        self.not_cast[reason as usize] += count;
        assert!(self.not_cast.iter().sum::<u64>() <= self.due, "more is left out than is due");
    }

    /// Adds another count.
    pub fn add(&mut self, other: &Self) {
        self.due += other.due;
        self.not_cast.iter_mut().zip(other.not_cast).for_each(|(sum, count)| *sum += count);
    }

    /// How many were due.
    #[must_use]
    pub fn due(&self) -> u64 {
        self.due
    }

    /// How many were not cast for this reason.
    #[must_use]
    pub fn not_cast(&self, reason: NotCast) -> u64 {
        self.not_cast[reason as usize]
    }

    /// How many were cast.
    #[must_use]
    pub fn cast(&self) -> u64 {
        self.due - self.not_cast.iter().sum::<u64>()
    }
}
