//! What a number of pairs can show in the test that is used, [`super::exchange_test`].

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use super::bootstrap::{normal_cdf, normal_quantile};
use super::{StatisticsError, check_range, check_sample, count, mean};

/// Number of simulated experiments: the power of what is found has a standard error of 1 %.
const EXPERIMENTS: usize = 2_000;

/// Maximum number of pairs for which the test is exact in the simulation; for more, the share of
/// exchanges comes from an Edgeworth series, which differs from it by less than a tenth of a per
/// cent.
const EXACT_PAIRS_MAX: usize = 10;

/// Maximum number of steps by which a shift is found.
const STEPS: usize = 40;

/// The difference of means that so many pairs, if they scatter like these differences, show with a
/// probability of `power` in a permutation test at the level `needed`, which is 5 % over the number
/// of comparisons if these are corrected. `None` if so many pairs show no difference, however
/// large.
///
/// It is found by simulation: experiments are drawn from the differences without their mean, each
/// with a little noise so that few of them do not repeat each other (the smoothed bootstrap of
/// Silverman and Young, 1987), and the shift is the one with which `power` of the experiments have
/// a p-value below `needed`.
///
/// # Errors
/// If there are fewer than two differences, one is not finite, or a probability is not between 0
/// and 1.
pub fn detectable_difference(
    differences: &[f64],
    pairs: usize,
    needed: f64,
    power: f64,
    seed: u64,
) -> Result<Option<f64>, StatisticsError> {
    check_sample(differences, 2)?;
    for (what, value) in [("the level of a test", needed), ("the power of a test", power)] {
        check_range(what, value, f64::EPSILON..=1.0 - f64::EPSILON, "between 0 and 1")?;
    }
    let known = differences.len();
    if super::least_p_value(pairs, needed) >= needed {
        return Ok(None);
    }
    let centre = mean(differences)?;
    let squares: f64 = differences.iter().map(|difference| (difference - centre).powi(2)).sum();
    let deviation = (squares / (count(known) - 1.0)).sqrt();
    let bandwidth = 1.0 / count(known).sqrt();
    let scale = (count(known) / (count(known) - 1.0)).sqrt();
    let shrink = (1.0 + bandwidth * bandwidth).sqrt();
    let mut rng = voxels::random_streams::stream(seed, 0, "statistics.power");
    let mut drawn = || {
        let place = (u64::from(rng.next_u32()) * known as u64) >> 32;
        let noise = bandwidth * deviation * normal(&mut rng);
        (scale * (differences[place as usize] - centre) + noise) / shrink
    };
    let mut shifts: Vec<f64> = (0..EXPERIMENTS)
        .map(|_| {
            let experiment: Vec<f64> = (0..pairs).map(|_| drawn()).collect();
            if pairs <= EXACT_PAIRS_MAX { exact_shift(&experiment, needed) } else { series_shift(&experiment, needed) }
        })
        .collect();
    let place = (power * count(EXPERIMENTS)).ceil() as usize - 1;
    Ok(Some(*shifts.select_nth_unstable_by(place, f64::total_cmp).1).filter(|shift| shift.is_finite()))
}

/// A draw from the standard normal distribution.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    normal_quantile((f64::from(rng.next_u32()) + 0.5) / (f64::from(u32::MAX) + 1.0))
}

/// The shift from which on the exact p-value of these differences is below `needed`, upwards: the
/// test rejects a mean of 0 as soon as all but that share of the exchanges say so
/// ([`super::permutation_test`]).
fn exact_shift(differences: &[f64], needed: f64) -> f64 {
    let pairs = differences.len();
    let all: f64 = differences.iter().sum();
    // The sum of each part of the pairs without the last one, by the bits of its number.
    let mut sums = vec![0.0; 1 << (pairs - 1)];
    let mut lows = Vec::with_capacity(sums.len());
    for part in 1_usize..sums.len() {
        sums[part] = sums[part & (part - 1)] + differences[part.trailing_zeros() as usize];
        let within = f64::from(part.count_ones());
        lows.push((sums[part] / within).min((all - sums[part]) / (count(pairs) - within)));
    }
    // The given order is one of the exchanges, and as far from 0 as itself with every shift.
    let allowed = (needed * count(sums.len())).ceil() as usize - 1;
    match allowed.checked_sub(1) {
        Some(place) => -*lows.select_nth_unstable_by(place, f64::total_cmp).1,
        None => f64::INFINITY,
    }
}

/// [`exact_shift`] by the Edgeworth series of the sum with random signs, whose skewness is 0.
fn series_shift(differences: &[f64], needed: f64) -> f64 {
    let n = count(differences.len());
    let mut power_sums = [0.0; 4];
    for difference in differences {
        let mut power = 1.0;
        for sum in &mut power_sums {
            power *= difference;
            *sum += power;
        }
    }
    let [one, two, three, four] = power_sums;
    let is_shown = |shift: f64| {
        let squares = two + 2.0 * shift * one + n * shift.powi(2);
        let fourths =
            four + 4.0 * shift * three + 6.0 * shift.powi(2) * two + 4.0 * shift.powi(3) * one + n * shift.powi(4);
        let z = (one + n * shift) / squares.sqrt();
        let kurtosis = -2.0 * fourths / squares.powi(2);
        let density = libm::exp(-z * z / 2.0) / (2.0 * std::f64::consts::PI).sqrt();
        let tail = normal_cdf(-z) + density * kurtosis / 24.0 * (z.powi(3) - 3.0 * z);
        z > 0.0 && 2.0 * tail < needed
    };
    let largest = differences.iter().fold(0.0_f64, |largest, difference| largest.max(difference.abs()));
    let (mut low, mut high) = (-largest, 8.0 * largest);
    if !is_shown(high) {
        return f64::INFINITY;
    }
    for _ in 0..STEPS {
        let middle = (low + high) / 2.0;
        (low, high) = if is_shown(middle) { (low, middle) } else { (middle, high) };
    }
    high
}
