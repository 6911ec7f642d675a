//! Holds a run back to a rate.

use std::time::{Duration, Instant};

use msgs::ids::Tick;

use super::now;
use crate::scenario::Rtf;

/// The pace of a run, from a tick on that began at a known time.
#[derive(Debug)]
pub(super) struct Pace {
    rtf: Rtf,
    from: Tick,
    begun: Instant,
}

impl Pace {
    pub(super) fn new(rtf: Rtf) -> Self {
        Self { rtf, from: Tick::ZERO, begun: now() }
    }

    /// Goes at another rate from now on.
    pub(super) fn change(&mut self, rtf: Rtf, tick: Tick) {
        self.rtf = rtf;
        self.go_on(tick);
    }

    /// Counts from this tick and this moment on: what came before is no reason to hurry or to wait.
    pub(super) fn go_on(&mut self, tick: Tick) {
        self.from = tick;
        self.begun = now();
    }

    /// Wall time until `tick` may begin, if it may not yet.
    pub(super) fn wait(&self, tick: Tick) -> Option<Duration> {
        let Rtf::Limit(limit) = self.rtf else {
            return None;
        };
        let due = self.begun + Duration::from_nanos(tick.time_ns() - self.from.time_ns()).div_f64(limit);
        due.checked_duration_since(now())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_came_before_a_pause_does_not_count() {
        let mut pace = Pace::new(Rtf::Limit(1e-3));
        let second = Tick(50);
        assert!(pace.wait(second).unwrap() > Duration::from_secs(900));
        pace.go_on(second);
        assert!(pace.wait(second).is_none());
        assert!(pace.wait(second.after(1)).unwrap() > Duration::from_secs(19));
        pace.change(Rtf::Limit(1e6), second);
        assert!(pace.wait(second.after(1)).is_none_or(|wait| wait < Duration::from_secs(1)));
    }
}
