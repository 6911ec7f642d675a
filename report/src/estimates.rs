//! Estimates over the runs of a cell, with confidence intervals.
//!
//! Times to a milestone are right-censored at the duration: a run that has not reached the
//! milestone when it ends does not reach it, even if it ends early because all agents have stopped.

use super::metrics::{Milestone, TimeUnit};
use experiments::rows::{RunRecord, RunRow};
use statistics::{
    Censored, Interval, StatisticsError, bootstrap_mean, mean, median_time, quantile, restricted_mean, success_fraction,
};

/// Level of all intervals.
pub(super) const LEVEL: f64 = 0.95;
/// Bootstrap resamples for a number in a table.
pub(super) const RESAMPLES: usize = 10_000;
/// Seed of all resamples: the same runs make the same report.
pub(super) const SEED: u64 = 1;

/// A mean with its confidence interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Estimate {
    pub(super) mean: f64,
    /// `None` for a single run.
    pub(super) interval: Option<Interval>,
}

impl Estimate {
    /// Fails if the sample is empty or has a value that is not finite.
    pub(super) fn of(xs: &[f64], resamples: usize) -> Result<Self, StatisticsError> {
        let interval = if xs.len() < 2 { None } else { Some(bootstrap_mean(xs, LEVEL, resamples, SEED)?) };
        Ok(Self { mean: mean(xs)?, interval })
    }

    /// The upper end of its interval, or the mean if there is none.
    pub(super) fn high(self) -> f64 {
        self.interval.map_or(self.mean, |interval| interval.high)
    }

    /// Converts seconds into this unit.
    pub(super) fn in_unit(self, unit: TimeUnit) -> Self {
        let TimeUnit { seconds, .. } = unit;
        let Self { mean, interval } = self;
        let interval = interval.map(|Interval { low, high }| Interval { low: low / seconds, high: high / seconds });
        Self { mean: mean / seconds, interval }
    }

    /// The reciprocal of a ratio; `None` of 0. An interval that reaches 0 has none.
    pub(super) fn inverse(self) -> Option<Self> {
        let interval = self.interval.filter(|interval| interval.low > 0.0);
        let interval = interval.map(|Interval { low, high }| Interval { low: 1.0 / high, high: 1.0 / low });
        (self.mean > 0.0).then(|| Self { mean: 1.0 / self.mean, interval })
    }
}

/// Median and quartiles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Quartiles {
    pub(super) low: f64,
    pub(super) median: f64,
    pub(super) high: f64,
}

impl Quartiles {
    /// Fails if the sample is empty or has a value that is not finite.
    pub(super) fn of(xs: &[f64]) -> Result<Self, StatisticsError> {
        let mut sorted = xs.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |share| quantile(&sorted, share);
        Ok(Self { low: at(0.25)?, median: at(0.5)?, high: at(0.75)? })
    }
}

/// Times of the runs of a cell to a milestone.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Times {
    pub(super) runs: Vec<Censored>,
    /// Maximum duration of the runs, s.
    pub(super) horizon_s: f64,
}

impl Times {
    pub(super) fn of(runs: &[&RunRecord], milestone: Milestone) -> Self {
        let censored = |row: &RunRow| match (milestone.time_s)(row) {
            Some(time) => Censored { time, happened: true },
            None => Censored { time: row.duration_s, happened: false },
        };
        let horizon_s = runs.iter().map(|run| run.row.duration_s).fold(0.0, f64::max);
        Self { runs: runs.iter().map(|run| censored(&run.row)).collect(), horizon_s }
    }

    /// The times, with the duration in condition of those not reached, s.
    pub(super) fn restricted(&self) -> Vec<f64> {
        self.runs.iter().map(|run| run.time).collect()
    }

    /// Restricted mean, s.
    pub(super) fn estimate(&self) -> Result<Estimate, StatisticsError> {
        let interval = Estimate::of(&self.restricted(), RESAMPLES)?.interval;
        Ok(Estimate { mean: restricted_mean(&self.runs, self.horizon_s)?, interval })
    }

    /// Median time, s; `None` if fewer than half of the runs have reached the milestone.
    pub(super) fn median_s(&self) -> Result<Option<f64>, StatisticsError> {
        median_time(&self.runs)
    }

    /// Number of runs that have reached the milestone.
    pub(super) fn reached(&self) -> usize {
        self.runs.iter().filter(|run| run.happened).count()
    }

    /// Share of the runs that have reached the milestone.
    pub(super) fn success(&self) -> Result<f64, StatisticsError> {
        success_fraction(&self.runs)
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::super::metrics::MILESTONES;
    use super::*;

    #[test]
    fn single_run_has_no_interval() {
        let estimate = Estimate::of(&[3.0], RESAMPLES).unwrap();
        assert_eq!(estimate, Estimate { mean: 3.0, interval: None });
    }

    #[test]
    fn censored_times_count_as_the_duration() {
        let mut runs = [fixture::run("dsvp", 1, 2), fixture::run("dsvp", 2, 2), fixture::run("dsvp", 3, 2)];
        for (run, time) in runs.iter_mut().zip([Some(10.0), Some(20.0), None]) {
            (run.row.t99_s, run.row.duration_s, run.row.end_s) = (time, 60.0, 25.0);
        }
        let times = Times::of(&runs.iter().collect::<Vec<_>>(), MILESTONES[1]);
        // (10 + 20 + 60) / 3.
        assert!((times.estimate().unwrap().mean - 30.0).abs() < 1e-9);
        assert_eq!((times.reached(), times.median_s().unwrap()), (2, Some(20.0)));
    }
}
