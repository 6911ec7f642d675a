//! Statistics of runs: what the reports say about samples of values, of times that may not have been reached, and of pairs of runs.
//!
//! A sample is a slice with one value per run. What is paired is paired by place: `a[i]` and `b[i]` are two runs on the same map.
//! Everything here is a function of its arguments: chance is a ChaCha stream from a seed that is one of them, so that an interval is
//! the same however often and wherever it is computed. A value that is not finite is refused, and so is a sample that is too small
//! for what is asked; nothing is left out in silence. `docs/statistics.md` has the formulas and their sources.
//!
//! The module reads no files and knows nothing of runs, metrics or plans; which test suits which metric is the report's decision.

mod bootstrap;
mod ranks;
mod survival;

use std::ops::RangeInclusive;

use thiserror::Error;

pub use bootstrap::{Pairing, RESAMPLES, bootstrap_mean, bootstrap_ratio};
pub use ranks::{Wilcoxon, a12, holm, wilcoxon_signed_rank};
pub use survival::{Censored, kaplan_meier, median_time, restricted_mean, success_fraction};

/// Why there is no such figure. Places count from 0.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StatisticsError {
    /// Fewer values than the figure needs.
    #[error("{needed} values or more are needed, there are {got}")]
    TooFew {
        /// The least number of values.
        needed: usize,
        /// The number of values.
        got: usize,
    },
    /// A value that cannot be reckoned with.
    #[error("value {place} is {value}, it must be finite")]
    NotFinite {
        /// Which one.
        place: usize,
        /// It.
        value: f64,
    },
    /// A value, time or level that makes no sense where it stands.
    #[error("{what} is {value}, it must be {allowed}")]
    OutOfRange {
        /// What it is.
        what: &'static str,
        /// It.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// Values that must not fall do so.
    #[error("value {place} is less than the one before, values must ascend")]
    NotAscending {
        /// Where the first lesser one is.
        place: usize,
    },
    /// Pairs with a missing half.
    #[error("{left} values cannot be paired with {right}, the two must be as many")]
    Unpaired {
        /// On the one side.
        left: usize,
        /// On the other.
        right: usize,
    },
    /// Fewer or more bootstrap resamples than [`RESAMPLES`].
    #[error("{got} resamples, there must be {} to {}", RESAMPLES.start(), RESAMPLES.end())]
    Resamples {
        /// The number asked for.
        got: usize,
    },
    /// Values so large that their mean is not finite.
    #[error("the values are too large: their mean is not finite")]
    TooLarge,
    /// A ratio that is not finite in all resamples.
    #[error("the denominator of the ratio is zero, be it in one resample, or the ratio is too large")]
    ZeroDenominator,
}

/// From where to where a figure plausibly lies; `low` is at most `high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
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

/// The value below which a share `q` of an ascending sample lies, between two values in proportion (type 7 of Hyndman and Fan, 1996;
/// what R and NumPy do unless told otherwise). 0.5 gives the median, 0.25 and 0.75 the quartiles.
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

/// [`quantile`] of what is known to be a non-empty ascending sample, and of a share within 0 to 1.
fn quantile_of_sorted(sorted: &[f64], q: f64) -> f64 {
    let last = sorted.len() - 1;
    let place = q * count(last);
    let below = (place as usize).min(last);
    let (low, high) = (sorted[below], sorted[(below + 1).min(last)]);
    let part = place - count(below);
    // Rounding must not lead past the two values.
    (low * (1.0 - part) + high * part).clamp(low, high)
}

/// The mean height of a curve from time 0 to `horizon`: the area under it over the horizon, so that a curve of shares has 0 to 1.
///
/// `points` are (time, height) in the order of time, straight lines between them; two at the same time are a jump. Before the first
/// point the curve has its height, and after the last one the height of that: what a run had reached at its end stays reached.
///
/// # Errors
/// If there is no point, a number is not finite, times do not ascend or begin before 0, or the horizon is not above 0.
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

/// What lies under the line between two points, up to the horizon. A line to a point at infinity is level.
fn area_of_piece((from_s, from_height): (f64, f64), (to_s, to_height): (f64, f64), horizon: f64) -> f64 {
    let end_s = to_s.min(horizon);
    if end_s <= from_s {
        return 0.0;
    }
    let end_height = from_height + (to_height - from_height) * ((end_s - from_s) / (to_s - from_s));
    (end_s - from_s) * (from_height + end_height) / 2.0
}

/// A number of things as a number to reckon with.
fn count(things: usize) -> f64 {
    things as f64
}

/// Refuses a sample that is smaller than `needed`, or that holds a value that is not finite.
fn check_sample(xs: &[f64], needed: usize) -> Result<(), StatisticsError> {
    if xs.len() < needed {
        return Err(StatisticsError::TooFew { needed, got: xs.len() });
    }
    match xs.iter().position(|x| !x.is_finite()) {
        Some(place) => Err(StatisticsError::NotFinite { place, value: xs[place] }),
        None => Ok(()),
    }
}

/// Refuses two samples that are not pairs.
fn check_pairs(a: &[f64], b: &[f64]) -> Result<(), StatisticsError> {
    if a.len() == b.len() { Ok(()) } else { Err(StatisticsError::Unpaired { left: a.len(), right: b.len() }) }
}

/// Refuses a number outside of a range; NaN is outside of all.
fn check_range(
    what: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    allowed: &'static str,
) -> Result<(), StatisticsError> {
    if range.contains(&value) { Ok(()) } else { Err(StatisticsError::OutOfRange { what, value, allowed }) }
}

/// Refuses a horizon that is not a positive time.
fn check_horizon(horizon: f64) -> Result<(), StatisticsError> {
    check_range("the horizon", horizon, f64::MIN_POSITIVE..=f64::MAX, "above 0 and finite")
}

#[cfg(test)]
mod tests;
