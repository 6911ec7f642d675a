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

    /// Passes the wall time until `tick` may begin with `idle`.
    pub(super) fn keep(&self, tick: Tick, idle: impl FnOnce(Duration)) {
        if let Rtf::Limit(limit) = self.rtf {
            let due = self.start + Duration::from_nanos(tick.time_ns()).div_f64(limit);
            if let Some(wait) = due.checked_duration_since(now()) {
                idle(wait);
            }
        }
    }
}
