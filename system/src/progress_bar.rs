//! The progress of a program on a terminal: one line that fits into it.

use std::collections::VecDeque;
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, WeakProgressBar};

/// The bar of this process, which has one at a time; who shows it may drop it.
static SHOWN: Mutex<Option<WeakProgressBar>> = Mutex::new(None);

/// A bar on stderr with a message behind it, which is cut where the terminal ends; `None` if stderr
/// is no terminal.
///
/// # Panics
/// Never: the template of the bar is valid.
#[must_use]
pub fn on_stderr(length: u64) -> Option<ProgressBar> {
    std::io::stderr().is_terminal().then(|| {
        let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{bar:10} {wide_msg}").expect("the template is right");
        bar.set_style(style);
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.downgrade());
        bar
    })
}

/// Writes to stderr what is to stay above the bar.
pub fn above(write: impl FnOnce()) {
    let shown = SHOWN.lock().unwrap_or_else(PoisonError::into_inner);
    match shown.as_ref().and_then(WeakProgressBar::upgrade) {
        Some(bar) => bar.suspend(write),
        None => write(),
    }
}

/// The time left of what makes progress at a changing rate.
///
/// The rate is that of the last third of the time so far: exploration slows down towards its end.
#[derive(Debug, Clone, Default)]
pub struct TimeLeft {
    samples: VecDeque<(Instant, f64)>,
}

/// Samples that an estimate keeps.
const SAMPLES_MAX: usize = 256;

impl TimeLeft {
    /// Adds how much is done at a time, 0 to 1, and estimates the time until it is 1; `None`
    /// without progress.
    pub fn estimate(&mut self, now: Instant, done: f64) -> Option<Duration> {
        if self.samples.len() == SAMPLES_MAX {
            // Every other one, so that a long run keeps its beginning.
            let mut number = 0;
            self.samples.retain(|_| {
                number += 1;
                number % 2 == 1
            });
        }
        self.samples.push_back((now, done));
        let (start, _) = *self.samples.front()?;
        let since = start + now.duration_since(start) * 2 / 3;
        let place = self.samples.partition_point(|(at, _)| *at <= since).saturating_sub(1);
        let (at, before) = self.samples[place];
        let rate = (done - before) / now.duration_since(at).as_secs_f64();
        Duration::try_from_secs_f64((1.0 - done).max(0.0) / rate).ok()
    }
}

/// Hours, minutes and seconds, such as `1:02:03` or `2:03`; a second that has begun counts.
#[must_use]
pub fn clock(time: Duration) -> String {
    let seconds = time.as_secs() + u64::from(time.subsec_nanos() > 0);
    match (seconds / 3600, seconds / 60 % 60) {
        (0, minutes) => format!("{minutes}:{:02}", seconds % 60),
        (hours, minutes) => format!("{hours}:{minutes:02}:{:02}", seconds % 60),
    }
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "the estimate takes times of the machine")]
mod tests {
    use super::*;

    #[test]
    fn estimate_follows_the_last_third() {
        let (start, second) = (Instant::now(), Duration::from_secs(1));
        let mut left = TimeLeft::default();
        assert_eq!(left.estimate(start, 0.0), None);
        // A tenth per second for six seconds, and then a hundredth per second.
        let done = |at: u32| f64::from(at.min(6)) / 10.0 + f64::from(at.saturating_sub(6)) / 100.0;
        for at in 1..=18_u32 {
            let estimate = left.estimate(start + second * at, done(at)).unwrap().as_secs_f64();
            if at <= 6 {
                assert!((estimate - (1.0 - done(at)) / 0.1).abs() < 1e-3, "{at}: {estimate}");
            }
        }
        let estimate = left.estimate(start + second * 18, done(18)).unwrap().as_secs_f64();
        assert!((estimate - 28.0).abs() < 1e-3, "{estimate}");
    }

    #[test]
    fn samples_are_bounded_and_without_progress_there_is_no_estimate() {
        let start = Instant::now();
        let mut left = TimeLeft::default();
        for at in 0..10_000_u32 {
            assert!(at == 0 || left.estimate(start + Duration::from_secs(at.into()), 0.5).is_none());
            assert!(left.samples.len() <= SAMPLES_MAX);
        }
    }

    #[test]
    fn clock_has_hours_only_if_needed() {
        assert_eq!([59, 61, 3723].map(|seconds| clock(Duration::from_secs(seconds))), ["0:59", "1:01", "1:02:03"]);
    }
}
