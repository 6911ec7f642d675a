//! The figures of a cell: estimates over its runs, with intervals.
//!
//! Times to a mark are of runs watched for the whole duration: what a run has not reached when it ends, it does not reach, even if
//! all agents have given up long before.

use crate::rows::{RunRecord, RunRow};
use crate::statistics::{
    Censored, Interval, StatisticsError, bootstrap_mean, mean, median_time, quantile, restricted_mean, success_fraction,
};

/// Level of all intervals.
pub(super) const LEVEL: f64 = 0.95;
/// Bootstrap resamples for a number in a table.
pub(super) const RESAMPLES: usize = 10_000;
/// Seed of all resamples: the same runs give the same report.
pub(super) const SEED: u64 = 1;

/// A mean and where it plausibly lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Estimate {
    /// The mean.
    pub(super) mean: f64,
    /// Its interval; `None` for a single run.
    pub(super) interval: Option<Interval>,
}

impl Estimate {
    /// Of a sample.
    ///
    /// # Errors
    /// If it is empty or has a value that is not finite.
    pub(super) fn of(xs: &[f64], resamples: usize) -> Result<Self, StatisticsError> {
        let interval = if xs.len() < 2 { None } else { Some(bootstrap_mean(xs, LEVEL, resamples, SEED)?) };
        Ok(Self { mean: mean(xs)?, interval })
    }
}

/// Median and quartiles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Quartiles {
    /// A quarter lies below.
    pub(super) low: f64,
    /// Half lie below.
    pub(super) median: f64,
    /// Three quarters lie below.
    pub(super) high: f64,
}

impl Quartiles {
    /// Of a sample.
    ///
    /// # Errors
    /// If it is empty or has a value that is not finite.
    pub(super) fn of(xs: &[f64]) -> Result<Self, StatisticsError> {
        let mut sorted = xs.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |share| quantile(&sorted, share);
        Ok(Self { low: at(0.25)?, median: at(0.5)?, high: at(0.75)? })
    }
}

/// A share of the free cells and when a run reached it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    /// The share in per cent, as text.
    pub(super) percent: &'static str,
    /// When a run reached it, seconds.
    pub(super) time_s: fn(&RunRow) -> Option<f64>,
}

/// 90, 99 and 100 % of the free cells.
pub(super) const MARKS: [Mark; 3] = [
    Mark { percent: "90", time_s: |row| row.t90_s },
    Mark { percent: "99", time_s: |row| row.t99_s },
    Mark { percent: "100", time_s: |row| row.t100_s },
];

/// Times of runs to a mark.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Times {
    /// One for each run.
    pub(super) runs: Vec<Censored>,
    /// The longest that a run may last, seconds.
    pub(super) horizon_s: f64,
}

impl Times {
    /// Of the runs of a cell.
    pub(super) fn of(runs: &[&RunRecord], mark: Mark) -> Self {
        let censored = |row: &RunRow| match (mark.time_s)(row) {
            Some(time) => Censored { time, happened: true },
            None => Censored { time: row.duration_s, happened: false },
        };
        let horizon_s = runs.iter().map(|run| run.row.duration_s).fold(0.0, f64::max);
        Self { runs: runs.iter().map(|run| censored(&run.row)).collect(), horizon_s }
    }

    /// Times with the time that the run may last in place of those not reached, seconds.
    pub(super) fn restricted(&self) -> Vec<f64> {
        self.runs.iter().map(|run| run.time).collect()
    }

    /// Restricted mean, seconds.
    ///
    /// # Errors
    /// If there are no runs or a time is not finite.
    pub(super) fn estimate(&self) -> Result<Estimate, StatisticsError> {
        let interval = Estimate::of(&self.restricted(), RESAMPLES)?.interval;
        Ok(Estimate { mean: restricted_mean(&self.runs, self.horizon_s)?, interval })
    }

    /// When half of the runs had reached the mark, seconds; `None`: fewer have.
    ///
    /// # Errors
    /// As [`Self::estimate`].
    pub(super) fn median_s(&self) -> Result<Option<f64>, StatisticsError> {
        median_time(&self.runs)
    }

    /// How many runs have reached the mark.
    pub(super) fn reached(&self) -> usize {
        self.runs.iter().filter(|run| run.happened).count()
    }

    /// Share of the runs that have reached the mark.
    ///
    /// # Errors
    /// As [`Self::estimate`].
    pub(super) fn success(&self) -> Result<f64, StatisticsError> {
        success_fraction(&self.runs)
    }
}

/// A figure of a run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Metric {
    /// Stem of names in files.
    pub(super) key: &'static str,
    /// What to call it.
    pub(super) title: &'static str,
    /// Unit; empty for a plain number.
    pub(super) unit: &'static str,
    /// Its value.
    pub(super) value: fn(&RunRow) -> f64,
}

impl Metric {
    /// Title and unit.
    pub(super) fn label(&self) -> String {
        if self.unit.is_empty() { self.title.to_owned() } else { format!("{} ({})", self.title, self.unit) }
    }

    /// Its values in runs.
    pub(super) fn values(&self, runs: &[&RunRecord]) -> Vec<f64> {
        runs.iter().map(|run| (self.value)(&run.row)).collect()
    }
}

/// Share of the free cells that the team has seen at the end.
pub(super) const EXPLORED: Metric =
    Metric { key: "explored", title: "explored at the end", unit: "%", value: |row| 100.0 * row.explored };
/// Share of the free cells that the team has seen, mean over the whole duration.
pub(super) const AREA: Metric =
    Metric { key: "area", title: "area under the curve", unit: "%", value: |row| 100.0 * row.area_under_explored };
/// Share of the free cells on the map of an agent at the end, mean over the agents.
pub(super) const BELIEVED: Metric =
    Metric { key: "believed", title: "on an agent's map", unit: "%", value: |row| 100.0 * row.believed_mean };
/// Share of the free cells that bodies have passed through.
pub(super) const COVERED: Metric =
    Metric { key: "covered", title: "covered", unit: "%", value: |row| 100.0 * row.covered };
/// Way of all agents.
pub(super) const DISTANCE: Metric =
    Metric { key: "distance", title: "distance of the team", unit: "m", value: |row| row.distance_m };
/// Way of the agent that went farthest.
pub(super) const DISTANCE_MAX: Metric =
    Metric { key: "distance_max", title: "longest distance of an agent", unit: "m", value: |row| row.distance_max_m };
/// What was seen more than once.
pub(super) const REDUNDANCY: Metric =
    Metric { key: "redundancy", title: "redundancy", unit: "%", value: |row| 100.0 * row.redundancy };
/// How unequal the agents' shares are.
pub(super) const IMBALANCE: Metric =
    Metric { key: "imbalance", title: "imbalance", unit: "%", value: |row| 100.0 * row.imbalance };
/// Pairs in contact.
pub(super) const CONTACT: Metric =
    Metric { key: "contact", title: "pairs in contact", unit: "%", value: |row| 100.0 * row.contact_share };
/// How much of the team's map an agent lacks.
pub(super) const STALENESS: Metric =
    Metric { key: "staleness", title: "staleness", unit: "%", value: |row| 100.0 * row.staleness };
/// Bytes that arrived.
pub(super) const TRAFFIC: Metric =
    Metric { key: "traffic", title: "data delivered", unit: "kB", value: |row| row.parcel_bytes as f64 / 1e3 };
/// Collisions.
pub(super) const COLLISIONS: Metric =
    Metric { key: "collisions", title: "collisions", unit: "", value: |row| row.collisions as f64 };
/// Searches for a path that found none.
pub(super) const FAILURES: Metric =
    Metric { key: "search_failures", title: "failed path searches", unit: "", value: |row| row.search_failures as f64 };
/// Sim time over wall time.
pub(super) const REAL_TIME_FACTOR: Metric = Metric {
    key: "real_time_factor",
    title: "real-time factor",
    unit: "sim s / wall s",
    value: |row| row.wall.real_time_factor,
};
/// Wall time.
pub(super) const WALL: Metric = Metric { key: "wall", title: "wall time", unit: "s", value: |row| row.wall.wall_s };

/// Unit of sim time in a report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TimeUnit {
    /// Its symbol.
    pub(super) symbol: &'static str,
    /// How long it is, seconds.
    pub(super) seconds: f64,
}

impl TimeUnit {
    /// Minutes from ten minutes on.
    pub(super) fn of(runs: &[RunRecord]) -> Self {
        let longest_s = runs.iter().map(|run| run.row.duration_s).fold(0.0, f64::max);
        if longest_s >= 600.0 { Self { symbol: "min", seconds: 60.0 } } else { Self { symbol: "s", seconds: 1.0 } }
    }

    /// Of seconds.
    pub(super) fn estimate(self, Estimate { mean, interval }: Estimate) -> Estimate {
        let Self { seconds, .. } = self;
        let interval = interval.map(|Interval { low, high }| Interval { low: low / seconds, high: high / seconds });
        Estimate { mean: mean / seconds, interval }
    }
}

/// What a run had explored at a time, 0 to 1: in proportion between two samples, as in the last one after the end.
pub(super) fn explored_at(run: &RunRecord, time_s: f64) -> f64 {
    let series = &run.series;
    let next = series.partition_point(|sample| sample.t_s < time_s);
    match (next.checked_sub(1).map(|last| &series[last]), series.get(next)) {
        (Some(last), Some(next)) => {
            let part = (time_s - last.t_s) / (next.t_s - last.t_s);
            last.explored + part * (next.explored - last.explored)
        }
        (Some(only), None) | (None, Some(only)) => only.explored,
        (None, None) => run.row.explored,
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn a_curve_is_straight_between_samples_and_stays_after_the_end() {
        let run = fixture::run("dsvp", 1, 2);
        // Samples at 0, 10 and 20 s: 0, 0.5 and 0.9.
        let at = |time_s| explored_at(&run, time_s);
        assert_eq!([at(0.0), at(5.0), at(10.0), at(20.0), at(35.0)], [0.0, 0.25, 0.5, 0.9, 0.9]);
    }

    #[test]
    fn one_run_has_no_interval() {
        let estimate = Estimate::of(&[3.0], RESAMPLES).unwrap();
        assert_eq!(estimate, Estimate { mean: 3.0, interval: None });
    }

    #[test]
    fn times_not_reached_count_as_the_whole_duration() {
        let mut runs = [fixture::run("dsvp", 1, 2), fixture::run("dsvp", 2, 2), fixture::run("dsvp", 3, 2)];
        for (run, time) in runs.iter_mut().zip([Some(10.0), Some(20.0), None]) {
            (run.row.t99_s, run.row.duration_s, run.row.end_s) = (time, 60.0, 25.0);
        }
        let times = Times::of(&runs.iter().collect::<Vec<_>>(), MARKS[1]);
        // (10 + 20 + 60) / 3.
        assert!((times.estimate().unwrap().mean - 30.0).abs() < 1e-9);
        assert_eq!((times.reached(), times.median_s().unwrap()), (2, Some(20.0)));
    }
}
