//! Statistics of samples of values, of right-censored times, and of paired samples.
//!
//! A sample is a slice with one value per run. Pairs are formed by index: `a[i]` and `b[i]` are two
//! runs on the same map. Everything here is a function of its arguments: random numbers come from a
//! ChaCha stream whose seed is an argument, so an interval is the same on every machine. A value
//! that is not finite is an error, and so is a sample that is too small; no value is ignored.
//! `docs/statistics.md` has the formulas and their sources.
//!
//! The crate reads no files and does not depend on runs, metrics or plans; the report decides
//! which test suits which metric.

mod bootstrap;
mod log_rank;
mod permutation_test;
mod power;
mod ranks;
mod survival;

use std::ops::RangeInclusive;

use thiserror::Error;

pub use bootstrap::{RESAMPLES, bootstrap_mean};
pub use log_rank::{LogRank, StratifiedLogRank, log_rank, stratified_log_rank};
pub use permutation_test::{Effect, Exchange, exchange_test, least_p_value, pairs_needed};
pub use power::detectable_difference;
pub use ranks::{a12, holm};
pub use survival::{Censored, kaplan_meier, median_time, restricted_mean, success_fraction};

/// Why a statistic is undefined. `place` is an index.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StatisticsError {
    #[error("{needed} values or more are needed, there are {got}")]
    TooFew { needed: usize, got: usize },
    #[error("value {place} is {value}, it must be finite")]
    NotFinite { place: usize, value: f64 },
    /// An argument out of its range.
    #[error("{what} is {value}, it must be {allowed}")]
    OutOfRange { what: &'static str, value: f64, allowed: &'static str },
    #[error("value {place} is less than the one before, values must ascend")]
    NotAscending {
        /// Of the first value that is less than its predecessor.
        place: usize,
    },
    #[error("{left} values cannot be paired with {right}, the two must be as many")]
    Unpaired { left: usize, right: usize },
    /// A number of bootstrap resamples out of [`RESAMPLES`].
    #[error("{got} resamples, there must be {} to {}", RESAMPLES.start(), RESAMPLES.end())]
    Resamples { got: usize },
    #[error("the values are too large: their mean is not finite")]
    TooLarge,
}

/// A confidence interval; `low` is at most `high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    pub low: f64,
    pub high: f64,
}

/// The arithmetic mean.
///
/// # Errors
/// If there is no value, or one is not finite.
pub fn mean(xs: &[f64]) -> Result<f64, StatisticsError> {
    check_sample(xs, 1)?;
    Ok(xs.iter().sum::<f64>() / count(xs.len()))
}

/// The quantile of an ascending sample at a share `q`, by linear interpolation (type 7 of Hyndman
/// and Fan, 1996; the default of R and NumPy). 0.5 gives the median, 0.25 and 0.75 the quartiles.
///
/// # Errors
/// If there is no value, one is not finite, they do not ascend, or `q` is not within 0 to 1.
pub fn quantile(sorted: &[f64], q: f64) -> Result<f64, StatisticsError> {
    check_sample(sorted, 1)?;
    if let Some(before) = sorted.windows(2).position(|pair| pair[1] < pair[0]) {
        return Err(StatisticsError::NotAscending { place: before + 1 });
    }
    check_range("the share of a quantile", q, 0.0..=1.0, "within 0 to 1")?;
    Ok(quantile_of_sorted(sorted, q))
}

/// [`quantile`] without checks.
fn quantile_of_sorted(sorted: &[f64], q: f64) -> f64 {
    let last = sorted.len() - 1;
    let place = q * count(last);
    let below = (place as usize).min(last);
    let (low, high) = (sorted[below], sorted[(below + 1).min(last)]);
    let part = place - count(below);
    // Rounding must not leave the interval between the two values.
    (low * (1.0 - part) + high * part).clamp(low, high)
}

/// The mean height of a curve from time 0 to `horizon`: the area under it divided by the horizon.
///
/// `points` are (time, height) in the order of time, connected by straight lines; two at the same
/// time are a jump. The curve is constant before the first point and after the last one.
///
/// # Errors
/// If there is no point, a number is not finite, times do not ascend or begin before 0, or the
/// horizon is not above 0.
pub fn area_under(points: &[(f64, f64)], horizon: f64) -> Result<f64, StatisticsError> {
    let (times, heights): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
    check_sample(&times, 1)?;
    check_sample(&heights, 1)?;
    if let Some(before) = times.windows(2).position(|pair| pair[1] < pair[0]) {
        return Err(StatisticsError::NotAscending { place: before + 1 });
    }
    check_range("the first time", times[0], 0.0..=f64::MAX, "0 or more")?;
    check_horizon(horizon)?;
    let first = (0.0, heights[0]);
    let last = (f64::INFINITY, heights[heights.len() - 1]);
    let from = std::iter::once(&first).chain(points);
    let to = points.iter().chain(std::iter::once(&last));
    let area: f64 = from.zip(to).map(|(&from, &to)| area_of_piece(from, to, horizon)).sum();
    Ok(area / horizon)
}

/// The area under the line between two points, up to the horizon. A line to infinity is horizontal.
fn area_of_piece((from_s, from_height): (f64, f64), (to_s, to_height): (f64, f64), horizon: f64) -> f64 {
    let end_s = to_s.min(horizon);
    if end_s <= from_s {
        return 0.0;
    }
    let end_height = from_height + (to_height - from_height) * ((end_s - from_s) / (to_s - from_s));
    (end_s - from_s) * (from_height + end_height) / 2.0
}

fn count(things: usize) -> f64 {
    things as f64
}

/// Fails if a sample is smaller than `needed`, or has a value that is not finite.
fn check_sample(xs: &[f64], needed: usize) -> Result<(), StatisticsError> {
    if xs.len() < needed {
        return Err(StatisticsError::TooFew { needed, got: xs.len() });
    }
    match xs.iter().position(|x| !x.is_finite()) {
        Some(place) => Err(StatisticsError::NotFinite { place, value: xs[place] }),
        None => Ok(()),
    }
}

/// Fails if two samples differ in length.
fn check_pairs<T>(a: &[T], b: &[T]) -> Result<(), StatisticsError> {
    if a.len() == b.len() { Ok(()) } else { Err(StatisticsError::Unpaired { left: a.len(), right: b.len() }) }
}

/// Fails if a value is out of its range; NaN always is.
fn check_range(
    what: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    allowed: &'static str,
) -> Result<(), StatisticsError> {
    if range.contains(&value) { Ok(()) } else { Err(StatisticsError::OutOfRange { what, value, allowed }) }
}

/// Fails if a horizon is not positive and finite.
fn check_horizon(horizon: f64) -> Result<(), StatisticsError> {
    check_range("the horizon", horizon, f64::MIN_POSITIVE..=f64::MAX, "above 0 and finite")
}

#[cfg(test)]
mod tests;
