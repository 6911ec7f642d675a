//! The timers of the protocol, and the time by which they run.
//!
//! Invariants: a timer expires once, and then is set anew or stays off; time in which this process
//! did not run counts for no timer.

use core::time::Duration;

/// Longest wall time between two calls of the protocol that counts towards its timers. A longer gap
/// means that this process was stopped or busy, for which no agent is to blame.
pub(super) const GAP_MAX: Duration = Duration::from_millis(200);

/// What a timer is for. Both run while replies are awaited, and both are set anew when a replay
/// makes progress: the other agents have been waiting for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Timer {
    /// When the observations without a reply are resent.
    Resend = 0,
    /// When an agent without a reply counts as lost; set anew when a lost one answers after all.
    Reply = 1,
}

impl Timer {
    pub(super) const ALL: [Self; 2] = [Self::Resend, Self::Reply];
}

/// When each timer expires, in the time of [`AwakeClock`].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TimerTable([Option<Duration>; Timer::ALL.len()]);

impl TimerTable {
    pub(super) fn set(&mut self, timer: Timer, at: Duration) {
        self.0[timer as usize] = Some(at);
    }

    /// Turns all timers off.
    pub(super) fn stop(&mut self) {
        *self = Self::default();
    }

    /// When a timer expires, if it is on.
    pub(super) fn get(&self, timer: Timer) -> Option<Duration> {
        self.0[timer as usize]
    }

    /// The earliest time at which a timer expires.
    pub(super) fn next(&self) -> Option<Duration> {
        self.0.iter().flatten().min().copied()
    }

    /// Whether a timer has expired; then it is off.
    pub(super) fn take(&mut self, timer: Timer, now: Duration) -> bool {
        let slot = &mut self.0[timer as usize];
        let has_expired = slot.is_some_and(|at| now >= at);
        if has_expired {
            *slot = None;
        }
        has_expired
    }
}

/// Wall time without the gaps in which this process did not run.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct AwakeClock {
    /// The time of the last call, since the start of the session.
    called: Duration,
    awake: Duration,
}

impl AwakeClock {
    /// Counts what has passed since the last call, up to [`GAP_MAX`].
    pub(super) fn advance(&mut self, now: Duration) {
        self.awake += now.saturating_sub(self.called).min(GAP_MAX);
        self.called = now;
    }

    /// Counts nothing of what has passed since the last call.
    pub(super) fn resume(&mut self, now: Duration) {
        self.called = now;
    }

    /// The time that has been counted.
    pub(super) fn awake(&self) -> Duration {
        self.awake
    }

    /// The wall time until which the protocol need not be called for a timer that expires `at`.
    pub(super) fn until(&self, at: Duration) -> Duration {
        self.called + at.saturating_sub(self.awake).min(GAP_MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_stopped_process_takes_no_time() {
        let mut clock = AwakeClock::default();
        clock.resume(1000 * MS);
        clock.advance(1050 * MS);
        assert_eq!(clock.awake(), 50 * MS);
        clock.advance(9000 * MS);
        assert_eq!(clock.awake(), 50 * MS + GAP_MAX);
        assert_eq!(clock.until(260 * MS), 9010 * MS);
        assert_eq!(clock.until(9000 * MS), 9000 * MS + GAP_MAX, "it asks to be called in between");
        assert_eq!(clock.until(MS), 9000 * MS, "overdue");
    }

    #[test]
    fn a_timer_expires_once() {
        let mut timers = TimerTable::default();
        timers.set(Timer::Reply, 30 * MS);
        timers.set(Timer::Resend, 20 * MS);
        assert_eq!(timers.next(), Some(20 * MS));
        assert!(!timers.take(Timer::Reply, 20 * MS));
        assert!(timers.take(Timer::Resend, 20 * MS) && !timers.take(Timer::Resend, 20 * MS));
        assert_eq!(timers.next(), Some(30 * MS));
        timers.stop();
        assert_eq!(timers.next(), None);
    }
}
