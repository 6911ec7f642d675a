//! Bootstrap confidence intervals: the mean of many resamples of the runs, with replacement.
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

use super::{Interval, StatisticsError, check_range, check_sample, count, quantile_of_sorted};

/// The allowed number of resamples. With fewer, the ends of a 95 % interval rest on one or two of
/// them; more take memory and change no significant digit. 10 000 give two to three digits of the
/// width.
pub const RESAMPLES: RangeInclusive<usize> = 100..=1_000_000;

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
    check_range("the level of an interval", level, f64::EPSILON..=1.0 - f64::EPSILON, "between 0 and 1")?;
    if !RESAMPLES.contains(&resamples) {
        return Err(StatisticsError::Resamples { got: resamples });
    }
    let sample = Sample::new(xs);
    let mut drawn = vec![1.0; xs.len()];
    let estimate = sample.mean(&drawn)?;
    let acceleration = sample.acceleration(&mut drawn)?;
    let mut rng = voxels::random_streams::stream(seed, 0, "statistics.bootstrap");
    let mut figures = Vec::with_capacity(resamples);
    for _ in 0..resamples {
        draw(&mut drawn, &mut rng);
        figures.push(sample.mean(&drawn)?);
    }
    figures.sort_unstable_by(f64::total_cmp);
    let tail = (1.0 - level) / 2.0;
    let (low, high) = corrected_shares(&figures, estimate, acceleration, tail).unwrap_or((tail, 1.0 - tail));
    Ok(Interval { low: quantile_of_sorted(&figures, low), high: quantile_of_sorted(&figures, high) })
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
    fn mean(&self, times: &[f64]) -> Result<f64, StatisticsError> {
        let sum: f64 = self.above.iter().zip(times).map(|(above, times)| above * times).sum();
        let mean = self.least + sum / times.iter().sum::<f64>();
        if mean.is_finite() { Ok(mean) } else { Err(StatisticsError::TooLarge) }
    }

    /// The acceleration: the skewness of the jackknife means, divided by 6; NaN if these are all
    /// equal. `drawn` has every value once, before and after.
    fn acceleration(&self, drawn: &mut [f64]) -> Result<f64, StatisticsError> {
        let size = drawn.len();
        let mut without = Vec::with_capacity(size);
        for place in 0..size {
            drawn[place] = 0.0;
            without.push(self.mean(drawn)?);
            drawn[place] = 1.0;
        }
        let centre = without.iter().sum::<f64>() / count(size);
        let (mut cubes, mut squares) = (0.0, 0.0);
        for value in without {
            let influence = (count(size) - 1.0) * (centre - value) / count(size);
            squares += influence * influence;
            cubes += influence * influence * influence;
        }
        Ok(cubes / (6.0 * squares * squares.sqrt()))
    }
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
