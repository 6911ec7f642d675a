//! Permutation test of paired means: the labels of each pair are exchanged.
//!
//! `a[i]` and `b[i]` are two runs on the same map. If the variants do not differ, both orders of
//! each pair are equally likely (Fisher, 1935). The p-value is the share of all exchanges whose sum
//! of differences is as far from 0 as the given one, and the interval holds the effects that this
//! same test does not reject: effect, interval and p-value are of one quantity.
//!
//! The interval needs no search. A shift, or a ratio, is rejected by an exchange of the pairs F
//! exactly if it does not lie between the effect in F and that in the other pairs (the typical
//! values of Hartigan, 1969), so the ends are order statistics of these.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use super::{Interval, StatisticsError, check_pairs, check_range, check_sample, count, mean};

/// Maximum number of pairs with an exact p-value: the sums of each half of the pairs, 2^20 at most,
/// are kept sorted.
const EXACT_PAIRS_MAX: usize = 40;

/// Maximum number of pairs for which all subsets are enumerated, for an interval.
const ENUMERATED_PAIRS_MAX: usize = 13;

/// Least number of random exchanges, with the given one.
const DRAWS_MIN: usize = 10_000;

/// Maximum number of random exchanges: no p-value of more than 40 pairs is below
/// one millionth.
const DRAWS_MAX: usize = 1_000_000;

/// How many times the least p-value has to lie below the level that is needed.
const DRAWS_BELOW_LEVEL: f64 = 20.0;

/// Rounding error of a sum, relative to the sum of the absolute differences. Sums of whole numbers,
/// such as ticks, are exact.
const TOLERANCE: f64 = 1e-12;

/// How the two means are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// mean(a) - mean(b).
    Difference,
    /// mean(a) / mean(b), of values that are not negative.
    Ratio,
}

impl Effect {
    /// The effect of equal means.
    fn of_none(self) -> f64 {
        match self {
            Self::Difference => 0.0,
            Self::Ratio => 1.0,
        }
    }

    /// The effect in pairs with these sums; NaN if it is not defined.
    fn of(self, pairs: f64, sum_a: f64, sum_b: f64) -> f64 {
        match self {
            Self::Difference => (sum_a - sum_b) / pairs,
            Self::Ratio => sum_a / sum_b,
        }
    }
}

/// The result of [`exchange_test`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exchange {
    /// `None`: a ratio to a mean of 0.
    pub effect: Option<f64>,
    /// `None` if so few pairs bound it on no side, or there is no effect.
    pub interval: Option<Interval>,
    /// Two-sided.
    pub p_value: f64,
    /// The least p-value that so many pairs can give: see [`least_p_value`].
    pub least_p_value: f64,
}

/// Compares the means of paired samples, see the module. The interval is at `level`; `needed` is
/// the level that the p-value has to reach after a correction, such as 5 % over the number of
/// comparisons: for more than 40 pairs it determines how many exchanges are drawn, of which the
/// given one is one (Phipson and Smyth, 2010).
///
/// # Errors
/// If a sample is empty, a value is not finite, or negative where a ratio is asked for, the samples
/// differ in length, or `level` or `needed` is not between 0 and 1.
pub fn exchange_test(
    a: &[f64],
    b: &[f64],
    effect: Effect,
    level: f64,
    needed: f64,
    seed: u64,
) -> Result<Exchange, StatisticsError> {
    check_sample(a, 1)?;
    check_sample(b, 1)?;
    check_pairs(a, b)?;
    for (what, value) in [("the level of an interval", level), ("the level of a test", needed)] {
        check_range(what, value, f64::EPSILON..=1.0 - f64::EPSILON, "between 0 and 1")?;
    }
    if effect == Effect::Ratio {
        for &value in a.iter().chain(b) {
            check_range("a value of a ratio", value, 0.0..=f64::MAX, "0 or more")?;
        }
    }
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let p_value = p_value(&differences, needed, seed);
    let estimate = match effect {
        Effect::Difference => Some(mean(&differences)?),
        Effect::Ratio => Some(mean(a)? / mean(b)?).filter(|ratio| ratio.is_finite()),
    };
    let interval = estimate.and_then(|estimate| {
        let interval = interval(a, b, effect, level, seed)?;
        // The p-value may be exact where the ends are drawn: it decides on which side of none they
        // are.
        let none = effect.of_none();
        let Interval { mut low, mut high } = interval;
        let is_outside = p_value <= 1.0 - level;
        if estimate > none {
            low = if is_outside { low.max(none) } else { low.min(none) };
        } else if estimate < none {
            high = if is_outside { high.min(none) } else { high.max(none) };
        }
        Some(Interval { low: low.min(estimate), high: high.max(estimate) })
    });
    Ok(Exchange { effect: estimate, interval, p_value, least_p_value: least_p_value(a.len(), needed) })
}

/// The least p-value of [`exchange_test`] with so many pairs: 2 / 2^n up to 40, and one over the
/// number of exchanges that are drawn for more.
#[must_use]
pub fn least_p_value(pairs: usize, needed: f64) -> f64 {
    if pairs <= EXACT_PAIRS_MAX { (2.0 / count(1 << pairs)).min(1.0) } else { 1.0 / count(draws(needed)) }
}

/// The least number of pairs with which some of so many comparisons can have a p-value below
/// `alpha` after Holm's correction: the first of them has to be below `alpha` over their number.
#[must_use]
pub fn pairs_needed(comparisons: usize, alpha: f64) -> usize {
    let correction = count(comparisons.max(1));
    let is_enough = |pairs: &usize| correction * 2.0 / count(1 << pairs) < alpha;
    (1..=EXACT_PAIRS_MAX).find(is_enough).unwrap_or(EXACT_PAIRS_MAX + 1)
}

/// Number of exchanges, with the given one, for a p-value that can reach `needed`.
fn draws(needed: f64) -> usize {
    ((DRAWS_BELOW_LEVEL / needed).ceil() as usize).clamp(DRAWS_MIN, DRAWS_MAX)
}

/// The share of the exchanges of signs for which the sum is as far from 0.
fn p_value(differences: &[f64], needed: f64, seed: u64) -> f64 {
    let given = differences.iter().sum::<f64>().abs();
    let scale: f64 = differences.iter().map(|difference| difference.abs()).sum();
    let bound = given - TOLERANCE * scale;
    if bound <= 0.0 {
        return 1.0;
    }
    if differences.len() <= EXACT_PAIRS_MAX {
        return exact_p_value(differences, bound);
    }
    let mut rng = voxels::random_streams::stream(seed, 0, "statistics.exchange");
    let all = draws(needed);
    let as_large = (1..all).filter(|_| signed_sum(differences, &mut rng).abs() >= bound).count();
    count(1 + as_large) / count(all)
}

/// The p-value over all exchanges: the sums of two halves of the pairs, sorted, are added in order.
fn exact_p_value(differences: &[f64], bound: f64) -> f64 {
    let (one, other) = differences.split_at(differences.len() / 2);
    let (one, other) = (sorted_sums(one), sorted_sums(other));
    let mut as_large = 0_u64;
    let mut from = other.len();
    for sum in &one {
        while from > 0 && sum + other[from - 1] >= bound {
            from -= 1;
        }
        as_large += (other.len() - from) as u64;
    }
    // As many are as far below 0.
    2.0 * as_large as f64 / (count(one.len()) * count(other.len()))
}

/// All sums of these values with either sign, ascending.
fn sorted_sums(values: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    for value in values.iter().map(|value| value.abs()) {
        let mut merged = Vec::with_capacity(2 * sums.len());
        let (mut below, mut above) =
            (sums.iter().map(|sum| sum - value).peekable(), sums.iter().map(|sum| sum + value).peekable());
        while let Some(next) = match (below.peek(), above.peek()) {
            (Some(low), Some(high)) if low <= high => below.next(),
            (Some(_), None) => below.next(),
            _ => above.next(),
        } {
            merged.push(next);
        }
        sums = merged;
    }
    sums
}

fn signed_sum(values: &[f64], rng: &mut ChaCha8Rng) -> f64 {
    let mut sum = 0.0;
    for chunk in values.chunks(u32::BITS as usize) {
        let bits = rng.next_u32();
        for (place, value) in chunk.iter().enumerate() {
            sum += if bits >> place & 1 == 1 { *value } else { -value };
        }
    }
    sum
}

/// The effects that the test does not reject at 1 - `level`; `None` if these are unbounded.
fn interval(a: &[f64], b: &[f64], effect: Effect, level: f64, seed: u64) -> Option<Interval> {
    let (mut lows, mut highs) = (Vec::new(), Vec::new());
    let sums = |values: &[f64]| values.iter().sum::<f64>();
    let (all_a, all_b, pairs) = (sums(a), sums(b), count(a.len()));
    let mut between = |within: f64, sum_a: f64, sum_b: f64| {
        let one = effect.of(within, sum_a, sum_b);
        let other = effect.of(pairs - within, all_a - sum_a, all_b - sum_b);
        // No effect is rejected by an exchange of no pair.
        let unknown = one.is_nan() || other.is_nan();
        lows.push(if unknown { f64::NEG_INFINITY } else { one.min(other) });
        highs.push(if unknown { f64::INFINITY } else { one.max(other) });
    };
    if a.len() <= ENUMERATED_PAIRS_MAX {
        // The last pair is in the other part: a part and its complement are the same exchange.
        for part in 0..1_usize << (a.len() - 1) {
            let within = |place: &usize| part >> place & 1 == 1;
            let places = || (0..a.len()).filter(within);
            between(
                count(places().count()),
                places().map(|place| a[place]).sum(),
                places().map(|place| b[place]).sum(),
            );
        }
    } else {
        let mut rng = voxels::random_streams::stream(seed, 0, "statistics.exchange.interval");
        between(0.0, 0.0, 0.0);
        for _ in 1..DRAWS_MIN {
            let (mut within, mut sum_a, mut sum_b) = (0.0, 0.0, 0.0);
            for (a, b) in a.chunks(u32::BITS as usize).zip(b.chunks(u32::BITS as usize)) {
                let bits = rng.next_u32();
                for (place, (a, b)) in a.iter().zip(b).enumerate() {
                    if bits >> place & 1 == 1 {
                        (within, sum_a, sum_b) = (within + 1.0, sum_a + a, sum_b + b);
                    }
                }
            }
            between(within, sum_a, sum_b);
        }
    }
    // An effect below the given one is rejected by so many of the exchanges: those whose low end is
    // above it.
    let place = ((1.0 - level) * count(lows.len())) as usize;
    let low = *lows.select_nth_unstable_by(place, f64::total_cmp).1;
    let high = *highs.select_nth_unstable_by(place, |one, other| other.total_cmp(one)).1;
    (low.is_finite() && high.is_finite()).then_some(Interval { low, high })
}
