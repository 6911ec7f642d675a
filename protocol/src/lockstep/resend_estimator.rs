//! When an observation without a reply is resent: once replies usually would have come, so that a
//! lost message costs little more than the delay of the network.
//!
//! Source: RFC 6298 (smoothed time and deviation), with Karn's rule: a wait with a resend says
//! nothing about the network, but the next one gets twice the time, until a reply comes without.
//!
//! Invariants: the first resend is [`FIRST_MIN`] to [`FIRST_MAX`] after the request; later
//! intervals double, up to [`INTERVAL_MAX`]. The result of a run does not depend on it.

use core::time::Duration;

/// Shortest wall time until the first resend: longer than most decisions take.
const FIRST_MIN: Duration = Duration::from_millis(20);

/// Longest wall time until the first resend, and that before any reply.
const FIRST_MAX: Duration = Duration::from_millis(100);

/// Longest wall time between two resends.
const INTERVAL_MAX: Duration = Duration::from_secs(1);

/// How often the time until the first resend is doubled at most.
const RESENT_MAX: u32 = 3;

/// How long replies take.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ResendEstimator {
    /// Smoothed wait and its smoothed deviation, seconds.
    usual_s: Option<(f64, f64)>,
    /// Waits with resends since the last one without.
    resent: u32,
}

impl ResendEstimator {
    /// Notes how long replies took that came without a resend.
    pub(super) fn note(&mut self, waited: Duration) {
        self.resent = 0;
        let waited_s = waited.as_secs_f64();
        self.usual_s = Some(match self.usual_s {
            None => (waited_s, waited_s / 2.0),
            Some((mean_s, deviation_s)) => {
                let off_s = waited_s - mean_s;
                (mean_s + off_s / 8.0, deviation_s + (off_s.abs() - deviation_s) / 4.0)
            }
        });
    }

    /// Notes that an observation was resent.
    pub(super) fn note_resent(&mut self) {
        self.resent = (self.resent + 1).min(RESENT_MAX);
    }

    /// Wall time until the first resend.
    pub(super) fn first(&self) -> Duration {
        let usual = |(mean_s, deviation_s)| Duration::from_secs_f64(mean_s + 4.0 * deviation_s);
        let first = self.usual_s.map_or(FIRST_MAX, usual).clamp(FIRST_MIN, FIRST_MAX);
        (first * (1 << self.resent)).min(FIRST_MAX)
    }

    /// The interval after one of this length.
    pub(super) fn next(interval: Duration) -> Duration {
        (interval * 2).min(INTERVAL_MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn first_after(waits: impl IntoIterator<Item = Duration>) -> Duration {
        let mut timer = ResendEstimator::default();
        waits.into_iter().for_each(|waited| timer.note(waited));
        timer.first()
    }

    #[test]
    fn first_resend_comes_after_what_is_usual_within_bounds() {
        assert_eq!(first_after([]), FIRST_MAX);
        assert_eq!(first_after([MS; 50]), FIRST_MIN);
        assert_eq!(first_after([3000 * MS; 50]), FIRST_MAX);
        let steady = first_after([40 * MS; 50]);
        assert!((40 * MS..45 * MS).contains(&steady), "{steady:?}");
        let uneven = first_after((0..50).map(|number| if number % 2 == 0 { 5 * MS } else { 25 * MS }));
        assert!((40 * MS..80 * MS).contains(&uneven), "{uneven:?}");
    }

    #[test]
    fn waits_with_resends_get_more_time_until_one_without() {
        let mut timer = ResendEstimator::default();
        (0..50).for_each(|_| timer.note(MS));
        let firsts: Vec<u128> = std::iter::repeat_with(|| {
            timer.note_resent();
            timer.first().as_millis()
        })
        .take(4)
        .collect();
        assert_eq!(firsts, [40, 80, 100, 100]);
        timer.note(MS);
        assert_eq!(timer.first(), FIRST_MIN);
    }

    #[test]
    fn intervals_double_up_to_a_second() {
        let intervals = std::iter::successors(Some(FIRST_MIN), |&interval| Some(ResendEstimator::next(interval)));
        let all: Vec<u128> = intervals.take(8).map(|interval| interval.as_millis()).collect();
        assert_eq!(all, [20, 40, 80, 160, 320, 640, 1000, 1000]);
    }
}
