//! Holds a run back to a rate.

use std::time::{Duration, Instant};

use msgs::ids::Tick;

use super::now;
use crate::scenario::Rtf;

/// The pace of a run from its first tick on.
#[derive(Debug)]
pub(super) struct Pace {
    rtf: Rtf,
    start: Instant,
}

impl Pace {
    pub(super) fn new(rtf: Rtf, start: Instant) -> Self {
        Self { rtf, start }
    }

    /// Wall time until `tick` may begin, if it may not yet.
    pub(super) fn wait(&self, tick: Tick) -> Option<Duration> {
        let Rtf::Limit(limit) = self.rtf else {
            return None;
        };
        let due = self.start + Duration::from_nanos(tick.time_ns()).div_f64(limit);
        due.checked_duration_since(now())
    }
}
