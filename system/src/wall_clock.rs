//! The wall clock: the one place of the delivered crates that reads it.
//!
//! Timeouts, pacing, flushing and reports depend on wall time; no result of a run does.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// The present wall time, monotonic.
#[expect(
    clippy::disallowed_methods,
    reason = "timeouts, pacing and reports are in wall time; no result depends on them"
)]
#[must_use]
pub fn now() -> Instant {
    Instant::now()
}

/// The system time, which log messages, attachments of messages and files are stamped with.
#[expect(clippy::disallowed_methods, reason = "no result depends on the stamp of a log message or a file")]
#[must_use]
pub fn system_time() -> SystemTime {
    SystemTime::now()
}

/// What has passed since 1970 (UTC) by the system time; zero before.
#[must_use]
pub fn since_epoch() -> Duration {
    system_time().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// A duration in nanoseconds, `u64::MAX` where it would be longer (584 years).
#[must_use]
pub fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
