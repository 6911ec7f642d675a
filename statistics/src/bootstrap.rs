//! Bootstrap confidence intervals: a statistic of many resamples of the runs, with replacement.
//!
//! The interval is bias-corrected and accelerated (BCa; Efron, 1987; Efron and Tibshirani, 1993,
//! section 14.3), with the acceleration from the jackknife. Where the corrections are undefined it
//! is the percentile interval. A resample is stored as the multiplicity of each run, so that the
//! order of drawing cannot change a sum.

use std::f64::consts::SQRT_2;
use std::ops::RangeInclusive;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use statrs::function::erf::erfc_inv;

use super::{Interval, StatisticsError, check_pairs, check_range, check_sample, count, quantile_of_sorted};

/// The allowed number of resamples. With fewer, the ends of a 95 % interval rest on one or two of
/// them; more take memory and change no significant digit. 10 000 give two to three digits of the
/// width.
pub const RESAMPLES: RangeInclusive<usize> = 100..=1_000_000;

/// The design of a comparison of two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pairing {
    /// `a[i]` and `b[i]` are runs on the same map: they are resampled together.
    Paired,
    /// The samples are resampled separately.
    Independent,
}

/// A confidence interval of the mean at `level` (0.95). The coverage is approximate: with ten runs,
/// one in nine such intervals misses the mean rather than one in twenty. Equal values give an
/// interval without width.
///
/// The resamples depend on the seed, not on the values: with one seed for all points of a curve,
/// all points use the same resamples of runs.
///
/// # Errors
/// If there are fewer than two values, one is not finite or so large that sums are not, or `level`
/// or `resamples` is out of its range.
pub fn bootstrap_mean(xs: &[f64], level: f64, resamples: usize, seed: u64) -> Result<Interval, StatisticsError> {
    check_sample(xs, 2)?;
    let sample = Sample::new(xs);
    let mean = |drawn: &[Vec<f64>]| finite(sample.mean(&drawn[0]), StatisticsError::TooLarge);
    interval(&[xs.len()], mean, level, resamples, seed)
}

/// A confidence interval of the ratio mean(`a`) / mean(`b`), such as a speedup (Kalibera and Jones,
/// 2013).
///
/// # Errors
/// If a sample has fewer than two values, one is not finite or negative in `b`, paired samples
/// differ in length, `level` or `resamples` is out of its range, or the mean of `b` is zero in a
/// resample.
pub fn bootstrap_ratio(
    a: &[f64],
    b: &[f64],
    pairing: Pairing,
    level: f64,
    resamples: usize,
    seed: u64,
) -> Result<Interval, StatisticsError> {
    check_sample(a, 2)?;
    check_sample(b, 2)?;
    for &value in b {
        check_range("a value of the denominator", value, 0.0..=f64::MAX, "0 or more")?;
    }
    let (above, below) = (Sample::new(a), Sample::new(b));
    let ratio = |a_drawn: &[f64], b_drawn: &[f64]| {
        finite(above.mean(a_drawn) / below.mean(b_drawn), StatisticsError::ZeroDenominator)
    };
    match pairing {
        Pairing::Paired => {
            check_pairs(a, b)?;
            interval(&[a.len()], |drawn| ratio(&drawn[0], &drawn[0]), level, resamples, seed)
        }
        Pairing::Independent => {
            interval(&[a.len(), b.len()], |drawn| ratio(&drawn[0], &drawn[1]), level, resamples, seed)
        }
    }
}

/// A sample as offsets from its minimum, so that the mean of equal values is exactly that value.
struct Sample {
    least: f64,
    above: Vec<f64>,
}

impl Sample {
    /// `xs` is not empty.
    fn new(xs: &[f64]) -> Sample {
        let least = xs.iter().copied().fold(f64::INFINITY, f64::min);
        Sample { least, above: xs.iter().map(|x| x - least).collect() }
    }

    /// The mean of a resample, given the multiplicity of each value.
    fn mean(&self, times: &[f64]) -> f64 {
        let sum: f64 = self.above.iter().zip(times).map(|(above, times)| above * times).sum();
        self.least + sum / times.iter().sum::<f64>()
    }
}

fn finite(value: f64, or: StatisticsError) -> Result<f64, StatisticsError> {
    if value.is_finite() { Ok(value) } else { Err(or) }
}

/// The interval of a statistic of samples with these sizes, none of them 0. The statistic gets the
/// multiplicity of each value of each sample.
fn interval(
    sizes: &[usize],
    figure: impl Fn(&[Vec<f64>]) -> Result<f64, StatisticsError>,
    level: f64,
    resamples: usize,
    seed: u64,
) -> Result<Interval, StatisticsError> {
    check_range("the level of an interval", level, f64::EPSILON..=1.0 - f64::EPSILON, "between 0 and 1")?;
    if !RESAMPLES.contains(&resamples) {
        return Err(StatisticsError::Resamples { got: resamples });
    }
    let mut drawn: Vec<Vec<f64>> = sizes.iter().map(|&size| vec![1.0; size]).collect();
    let estimate = figure(&drawn)?;
    let acceleration = acceleration(&mut drawn, &figure)?;
    let mut rng = voxels::random_streams::stream(seed, 0, "statistics.bootstrap");
    let mut figures = Vec::with_capacity(resamples);
    for _ in 0..resamples {
        drawn.iter_mut().for_each(|times| draw(times, &mut rng));
        figures.push(figure(&drawn)?);
    }
    figures.sort_unstable_by(f64::total_cmp);
    let tail = (1.0 - level) / 2.0;
    let (low, high) = corrected_shares(&figures, estimate, acceleration, tail).unwrap_or((tail, 1.0 - tail));
    Ok(Interval { low: quantile_of_sorted(&figures, low), high: quantile_of_sorted(&figures, high) })
}

/// Draws a resample: the multiplicity of each value.
fn draw(times: &mut [f64], rng: &mut ChaCha8Rng) {
    times.fill(0.0);
    let size = times.len() as u64;
    for _ in 0..times.len() {
        // The upper half of the product is uniform except for one part in 2^32 / size.
        let place = (u64::from(rng.next_u32()) * size) >> 32;
        times[place as usize] += 1.0;
    }
}

/// An endless stream of fair coins.
pub(super) fn coins(seed: u64, purpose: &str) -> impl FnMut() -> bool {
    let mut rng = voxels::random_streams::stream(seed, 0, purpose);
    let (mut bits, mut left) = (0_u32, 0);
    move || {
        if left == 0 {
            (bits, left) = (rng.next_u32(), u32::BITS);
        }
        let bit = bits & 1 == 1;
        bits >>= 1;
        left -= 1;
        bit
    }
}

/// The acceleration: the skewness of the jackknife values, divided by 6; NaN if these are all
/// equal. `drawn` has every value once, before and after.
fn acceleration(
    drawn: &mut [Vec<f64>],
    figure: impl Fn(&[Vec<f64>]) -> Result<f64, StatisticsError>,
) -> Result<f64, StatisticsError> {
    let (mut cubes, mut squares) = (0.0, 0.0);
    for sample in 0..drawn.len() {
        let size = drawn[sample].len();
        let mut without = Vec::with_capacity(size);
        for place in 0..size {
            drawn[sample][place] = 0.0;
            without.push(figure(drawn)?);
            drawn[sample][place] = 1.0;
        }
        let centre = without.iter().sum::<f64>() / count(size);
        for value in without {
            let influence = (count(size) - 1.0) * (centre - value) / count(size);
            squares += influence * influence;
            cubes += influence * influence * influence;
        }
    }
    Ok(cubes / (6.0 * squares * squares.sqrt()))
}

/// The shares of the resamples below the ends of the BCa interval; `None` if they are undefined.
fn corrected_shares(sorted: &[f64], estimate: f64, acceleration: f64, tail: f64) -> Option<(f64, f64)> {
    let below = sorted.partition_point(|&figure| figure < estimate);
    let not_above = sorted.partition_point(|&figure| figure <= estimate);
    let bias = normal_quantile(count(below + not_above) / (2.0 * count(sorted.len())));
    let share = |z: f64| {
        let shifted = bias + z;
        let stretch = 1.0 - acceleration * shifted;
        // The correction is not monotonic beyond this point.
        (stretch > 0.0).then(|| normal_cdf(bias + shifted / stretch))
    };
    let z = normal_quantile(tail);
    let (low, high) = (share(z)?, share(-z)?);
    (low.is_finite() && high.is_finite() && low <= high).then_some((low, high))
}

/// The cumulative distribution function of the standard normal distribution.
pub(super) fn normal_cdf(z: f64) -> f64 {
    libm::erfc(-z / SQRT_2) / 2.0
}

/// The quantile function of the standard normal distribution; infinite for 0 and 1.
pub(super) fn normal_quantile(probability: f64) -> f64 {
    -SQRT_2 * erfc_inv(2.0 * probability)
}
