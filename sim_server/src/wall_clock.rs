//! The wall clock: the one place of this crate that reads it.
//!
//! Timeouts, pacing, flushing and reports depend on wall time; no result of a run does.

use std::time::{Duration, Instant};

/// The present wall time, monotonic.
#[expect(
    clippy::disallowed_methods,
    reason = "timeouts, pacing and reports are in wall time; no result depends on them"
)]
#[must_use]
pub fn now() -> Instant {
    Instant::now()
}

/// A duration in nanoseconds, `u64::MAX` where it would be longer (584 years).
#[must_use]
pub fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
