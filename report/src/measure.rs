//! The measures by which variants are compared, and their values.
//!
//! All times are in ticks, so that equal times are ties: on the grid of ticks differences of
//! seconds differ by rounding. All are restricted to one horizon, the shortest duration of the runs
//! that are compared.
//!
//! The area under the explored share is compared as what is above it: the duration times the share
//! that is not yet explored is the mean time until a free cell is seen, restricted to the duration.
//! Its ratios do not depend on how long the runs were allowed to go on after all was explored.

use super::metrics::{DISTANCE, EXPLORED, MILESTONES, Metric, Milestone, TimeUnit};
use super::study::{Condition, Pairs, Study};
use experiments::plan::Measure;
use experiments::rows::{RunRecord, ticks};
use statistics::{Censored, Effect, area_under};

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compared {
    /// Restricted time to a milestone, one of [`MILESTONES`], in ticks.
    Time(usize),
    /// Restricted mean time until a free cell is seen, in ticks.
    Unseen,
    /// Explored share at the end, per cent.
    Explored,
    /// Distance of the team, m.
    Distance,
}

impl Compared {
    /// Those that have a table if they are not the primary measure.
    pub(super) const SECONDARY: [Self; 4] = [Self::Unseen, Self::TIME_99, Self::Explored, Self::Distance];
    pub(super) const TIME_99: Self = Self::Time(1);

    pub(super) fn of(measure: Measure) -> Self {
        match measure {
            Measure::Area => Self::Unseen,
            Measure::Time90 => Self::Time(0),
            Measure::Time99 => Self::TIME_99,
            Measure::Time100 => Self::Time(2),
            Measure::Explored => Self::Explored,
            Measure::Distance => Self::Distance,
        }
    }

    /// Its name in a plan.
    pub(super) fn name(self) -> &'static str {
        let named = Measure::ALL.into_iter().find(|&(_, measure)| Self::of(measure) == self);
        named.map_or("", |(name, _)| name)
    }

    /// Name of the table.
    pub(super) fn table(self) -> &'static str {
        match self {
            Self::Time(0) => "pairs-time-90",
            Self::Time(1) => "pairs-time-99",
            Self::Time(_) => "pairs-time-100",
            Self::Unseen => "pairs-area",
            Self::Explored => "pairs-explored",
            Self::Distance => "pairs-distance",
        }
    }

    /// How two means are compared: shares of the same cells by their difference, all else by its
    /// ratio.
    pub(super) fn effect(self) -> Effect {
        if self == Self::Explored { Effect::Difference } else { Effect::Ratio }
    }

    pub(super) fn is_more_better(self) -> bool {
        self == Self::Explored
    }

    /// The largest difference that is possible with this mean of the worse variant.
    pub(super) fn largest(self, worse: f64) -> f64 {
        if self == Self::Explored { 100.0 } else { worse }
    }

    /// What is compared, and which is better.
    pub(super) fn title(self, unit: TimeUnit) -> String {
        let symbol = unit.symbol;
        match self {
            Self::Time(place) => {
                format!("restricted time to {} % ({symbol}), less is better", MILESTONES[place].percent)
            }
            Self::Unseen => format!(
                "area under the explored share, as the time until a cell is seen, mean over the free cells and restricted \
                 to the duration ({symbol}), less is better"
            ),
            Self::Explored => format!("{}, more is better", EXPLORED.label()),
            Self::Distance => format!("{}, less is better", DISTANCE.label()),
        }
    }

    /// The pairs of runs that count: for a metric without a value of failed runs, those that have
    /// not failed.
    pub(super) fn pairs<'a>(self, study: &'a Study, condition: &Condition, a: usize, b: usize) -> Pairs<'a> {
        match self {
            Self::Distance => study.measured_pairs(condition, a, b),
            _ => study.pairs(condition, a, b),
        }
    }

    /// The value of each run.
    pub(super) fn values(self, runs: &[&RunRecord], horizon_s: f64) -> Vec<f64> {
        let of = |metric: Metric| metric.values(runs);
        match self {
            Self::Time(place) => {
                restricted(runs, MILESTONES[place], horizon_s).into_iter().map(|censored| censored.time).collect()
            }
            Self::Unseen => runs.iter().map(|run| ticks(horizon_s) * (1.0 - area(run, horizon_s))).collect(),
            Self::Explored => of(EXPLORED),
            Self::Distance => of(DISTANCE),
        }
    }

    /// The value of a run for readers, with what it is.
    pub(super) fn value_text(self, run: &RunRecord, horizon_s: f64, unit: TimeUnit) -> String {
        let value = self.values(&[run], horizon_s).first().copied().unwrap_or_default();
        match self {
            Self::Time(place) if self.reached(&[run], horizon_s) == 0 => {
                format!("{} % not reached", MILESTONES[place].percent)
            }
            Self::Time(place) => {
                format!("{} % after {:.1} {}", MILESTONES[place].percent, self.in_unit(value, unit), unit.symbol)
            }
            Self::Unseen => format!("area {:.1} %", 100.0 * area(run, horizon_s)),
            Self::Explored => format!("{value:.1} % explored"),
            Self::Distance => format!("{value:.0} m"),
        }
    }

    /// The number of runs that have reached the share whose time is compared.
    pub(super) fn reached(self, runs: &[&RunRecord], horizon_s: f64) -> usize {
        match self {
            Self::Time(place) => {
                restricted(runs, MILESTONES[place], horizon_s).iter().filter(|time| time.happened).count()
            }
            Self::Unseen | Self::Explored | Self::Distance => runs.len(),
        }
    }

    /// A mean of [`Self::values`] for readers.
    pub(super) fn in_unit(self, mean: f64, unit: TimeUnit) -> f64 {
        match self {
            Self::Time(_) | Self::Unseen => mean / ticks(unit.seconds),
            Self::Explored | Self::Distance => mean,
        }
    }
}

/// When each run reached a milestone, in ticks; censored at the horizon.
pub(super) fn restricted(runs: &[&RunRecord], milestone: Milestone, horizon_s: f64) -> Vec<Censored> {
    let horizon = ticks(horizon_s);
    let time = |run: &&RunRecord| match (milestone.time_s)(&run.row).map(ticks) {
        Some(time) if time <= horizon => Censored { time, happened: true },
        _ => Censored { time: horizon, happened: false },
    };
    runs.iter().map(time).collect()
}

/// The area under the explored share up to a horizon, over the horizon; 0 for a run that has
/// failed.
fn area(run: &RunRecord, horizon_s: f64) -> f64 {
    if ticks(run.row.duration_s) == ticks(horizon_s) {
        return run.row.area_under_explored;
    }
    let points: Vec<(f64, f64)> = run.series.iter().map(|sample| (sample.t_s, sample.explored)).collect();
    area_under(&points, horizon_s).unwrap_or(run.row.area_under_explored)
}
