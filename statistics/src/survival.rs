//! Survival analysis of times to a milestone that a run may not reach.
//!
//! Excluding such runs, or using their end as the time, is biased in favour of slow algorithms.
//! Here they are right-censored: they are at risk for as long as they were observed (Kaplan and
//! Meier, 1958).

use super::{StatisticsError, check_horizon, check_range, check_sample, count};

/// Maximum rounding error of a share of one half.
const HALF_TOLERANCE: f64 = 1e-9;

/// The time at which a run reached a milestone, or until which it was observed without reaching it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Censored {
    /// Since the start, in any unit.
    pub time: f64,
    /// Whether the milestone was reached at `time`; otherwise the run is censored at `time`.
    pub happened: bool,
}

/// The Kaplan-Meier estimate of the share of runs that have not reached the milestone, as steps of
/// (time, share from then on), beginning with (0, 1). The share that has reached it is 1 minus this
/// one.
///
/// Runs that are censored at the time at which others reach the milestone are at risk at that time.
///
/// # Errors
/// If there are no runs, or a time is not finite or below 0.
pub fn kaplan_meier(runs: &[Censored]) -> Result<Vec<(f64, f64)>, StatisticsError> {
    check(runs)?;
    let mut runs = runs.to_vec();
    runs.sort_by(|a, b| a.time.total_cmp(&b.time));
    let mut share = 1.0;
    let mut steps = vec![(0.0, share)];
    let mut at_risk = runs.len();
    for together in runs.chunk_by(|a, b| a.time == b.time) {
        let reached = together.iter().filter(|run| run.happened).count();
        if reached > 0 {
            share *= count(at_risk - reached) / count(at_risk);
            steps.push((together[0].time, share));
        }
        at_risk -= together.len();
    }
    Ok(steps)
}

/// The median time by [`kaplan_meier`]; `None` if more than half of the runs do not reach the
/// milestone.
///
/// # Errors
/// As [`kaplan_meier`].
pub fn median_time(runs: &[Censored]) -> Result<Option<f64>, StatisticsError> {
    let steps = kaplan_meier(runs)?;
    Ok(steps.iter().find(|(_, share)| *share <= 0.5 + HALF_TOLERANCE).map(|(time, _)| *time))
}

/// The restricted mean time to the milestone: the area under [`kaplan_meier`] up to `horizon`. If
/// all runs are observed up to the horizon, this is the mean of the times with the horizon in place
/// of those not reached. If no run is observed for so long, the last share is extended to the
/// horizon, which gives the greatest mean that is consistent with the runs.
///
/// # Errors
/// As [`kaplan_meier`], or if the horizon is not above 0.
pub fn restricted_mean(runs: &[Censored], horizon: f64) -> Result<f64, StatisticsError> {
    let steps = kaplan_meier(runs)?;
    check_horizon(horizon)?;
    let ends = steps.iter().skip(1).map(|(time, _)| *time).chain([horizon]);
    Ok(steps.iter().zip(ends).map(|((from, share), to)| (to.min(horizon) - from).max(0.0) * share).sum())
}

/// The share of the runs that have reached the milestone.
///
/// # Errors
/// As [`kaplan_meier`].
pub fn success_fraction(runs: &[Censored]) -> Result<f64, StatisticsError> {
    check(runs)?;
    Ok(count(runs.iter().filter(|run| run.happened).count()) / count(runs.len()))
}

/// Fails if there are no runs, or a time is not finite or below 0.
pub(super) fn check(runs: &[Censored]) -> Result<(), StatisticsError> {
    let times: Vec<f64> = runs.iter().map(|run| run.time).collect();
    check_sample(&times, 1)?;
    times.iter().try_for_each(|&time| check_range("a time", time, 0.0..=f64::MAX, "0 or more"))
}
