//! Wall-clock time: the only place of the server that reads it.
//!
//! Timeouts, pacing and progress reports use it; no result of a run depends on it.

use std::time::Instant;

/// The present wall time.
#[expect(clippy::disallowed_methods, reason = "the only place that reads wall time; no result depends on it")]
pub fn now() -> Instant {
    Instant::now()
}
