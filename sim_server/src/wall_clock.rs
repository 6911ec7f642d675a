//! The wall clock: the one place of this crate that reads it.
//!
//! Timeouts, pacing, flushing and reports depend on wall time; no result of a run does.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use msgs::builtin_interfaces::Time;

/// The present wall time, monotonic.
#[expect(
    clippy::disallowed_methods,
    reason = "timeouts, pacing and reports are in wall time; no result depends on them"
)]
#[must_use]
pub fn now() -> Instant {
    Instant::now()
}

/// The system time, which ROS nodes stamp log messages with.
#[expect(clippy::disallowed_methods, reason = "no result depends on the stamp of a log message")]
#[must_use]
pub fn system_time() -> Time {
    let passed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Time { sec: i32::try_from(passed.as_secs()).unwrap_or(i32::MAX), nanosec: passed.subsec_nanos() }
}

/// A duration in nanoseconds, `u64::MAX` where it would be longer (584 years).
#[must_use]
pub fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
