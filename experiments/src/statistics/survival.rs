//! Times that may not have been reached: a run that ends before it has seen 99 % says only that this would have taken longer.
//!
//! Leaving such runs out, or counting their end as the time, makes slow algorithms look fast. Here they are right-censored: they count
//! among those who had not reached the mark for as long as they were watched (Kaplan and Meier, 1958).

use super::{StatisticsError, check_horizon, check_range, check_sample, count};

/// Rounding leaves a share that is one half this far off at most.
const HALF_TOLERANCE: f64 = 1e-9;

/// When a run reached a mark, or until when it was watched without reaching it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Censored {
    /// Seconds since the start (or any other unit, the same for all).
    pub time: f64,
    /// Whether the mark was reached at `time`; if not, the run was only watched until then.
    pub happened: bool,
}

/// The share of runs that have not reached the mark, over time: (time, share after it), a step at every time at which runs reach it.
/// Begins with (0, 1); between two steps and after the last one the share stays as it is. The share that *has* reached it is 1 minus
/// this one.
///
/// Runs that end at the very time at which others reach the mark count as watched at it.
///
/// # Errors
/// If there are no runs, or a time is not finite or below 0.
pub fn kaplan_meier(runs: &[Censored]) -> Result<Vec<(f64, f64)>, StatisticsError> {
    check(runs)?;
    let mut runs = runs.to_vec();
    runs.sort_by(|a, b| a.time.total_cmp(&b.time));
    let mut share = 1.0;
    let mut steps = vec![(0.0, share)];
    let mut watched = runs.len();
    for together in runs.chunk_by(|a, b| a.time == b.time) {
        let reached = together.iter().filter(|run| run.happened).count();
        if reached > 0 {
            share *= count(watched - reached) / count(watched);
            steps.push((together[0].time, share));
        }
        watched -= together.len();
    }
    Ok(steps)
}

/// The first time at which half of the runs or fewer have not reached the mark, by [`kaplan_meier`]; `None` if that never happens.
///
/// # Errors
/// As [`kaplan_meier`].
pub fn median_time(runs: &[Censored]) -> Result<Option<f64>, StatisticsError> {
    let steps = kaplan_meier(runs)?;
    Ok(steps.iter().find(|(_, share)| *share <= 0.5 + HALF_TOLERANCE).map(|(time, _)| *time))
}

/// The mean time to the mark if nobody waits beyond `horizon`: the area under [`kaplan_meier`] up to there. Where every run is watched
/// up to the horizon this is the mean of the times with the horizon in place of those not reached. If nobody is watched for so long,
/// the last share holds until the horizon, which makes it the greatest mean that the runs allow.
///
/// # Errors
/// As [`kaplan_meier`], or if the horizon is not above 0.
pub fn restricted_mean(runs: &[Censored], horizon: f64) -> Result<f64, StatisticsError> {
    let steps = kaplan_meier(runs)?;
    check_horizon(horizon)?;
    let ends = steps.iter().skip(1).map(|(time, _)| *time).chain([horizon]);
    Ok(steps.iter().zip(ends).map(|((from, share), to)| (to.min(horizon) - from).max(0.0) * share).sum())
}

/// The share of the runs that have reached the mark.
///
/// # Errors
/// As [`kaplan_meier`].
pub fn success_fraction(runs: &[Censored]) -> Result<f64, StatisticsError> {
    check(runs)?;
    Ok(count(runs.iter().filter(|run| run.happened).count()) / count(runs.len()))
}

fn check(runs: &[Censored]) -> Result<(), StatisticsError> {
    let times: Vec<f64> = runs.iter().map(|run| run.time).collect();
    check_sample(&times, 1)?;
    times.iter().try_for_each(|&time| check_range("a time", time, 0.0..=f64::MAX, "0 or more"))
}
