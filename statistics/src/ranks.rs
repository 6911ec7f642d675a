//! Comparisons by rank, which assume no distribution of the values.

use super::bootstrap::normal_cdf;
use super::{StatisticsError, check_pairs, check_range, check_sample, count};

/// Maximum number of pairs with an exact p-value if there are no ties and no zeros, as in SciPy.
const EXACT_PAIRS_MAX: usize = 50;

/// Maximum number of pairs with an exact p-value in any case, as in SciPy.
const EXACT_TIED_PAIRS_MAX: usize = 13;

/// The result of [`wilcoxon_signed_rank`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wilcoxon {
    /// The smaller of the rank sums of positive and of negative differences.
    pub statistic: f64,
    /// Two-sided.
    pub p_value: f64,
    /// Number of pairs that differ.
    pub pairs: usize,
}

/// The two-sided signed-rank test of whether the differences `a[i] - b[i]` are symmetric about zero
/// (Wilcoxon, 1945), with the defaults of `scipy.stats.wilcoxon`.
///
/// Pairs without a difference are dropped, and ties get the mean of their ranks. The p-value is
/// exact for up to 50 pairs without ties and zeros, and for up to 13 pairs in any case; otherwise
/// it is the normal approximation with tie correction and without continuity correction. If no pair
/// differs, the statistic is 0 and the p-value 1.
///
/// # Errors
/// If there are no pairs, a value is not finite, or the samples differ in length.
pub fn wilcoxon_signed_rank(a: &[f64], b: &[f64]) -> Result<Wilcoxon, StatisticsError> {
    check_sample(a, 1)?;
    check_sample(b, 1)?;
    check_pairs(a, b)?;
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).filter(|difference| *difference != 0.0).collect();
    let ranked = Ranked::new(&differences);
    let untied = differences.len() == a.len() && ranked.ties == 0.0;
    let exact = a.len() <= if untied { EXACT_PAIRS_MAX } else { EXACT_TIED_PAIRS_MAX };
    let twice_lesser = ranked.twice_positive.min(ranked.twice_negative);
    let p_value = match differences.len() {
        0 => 1.0,
        _ if exact => exact_p_value(&ranked.twice_ranks, twice_lesser),
        pairs => normal_p_value(pairs, ranked.ties, count(twice_lesser) / 2.0),
    };
    Ok(Wilcoxon { statistic: count(twice_lesser) / 2.0, p_value, pairs: differences.len() })
}

/// Ranks of absolute differences, doubled, so that the mean of two ranks is a whole number.
struct Ranked {
    /// Ascending.
    twice_ranks: Vec<usize>,
    /// Rank sum of the positive differences.
    twice_positive: usize,
    /// Rank sum of the negative differences.
    twice_negative: usize,
    /// The sum of n^3 - n over groups of n ties.
    ties: f64,
}

impl Ranked {
    fn new(differences: &[f64]) -> Ranked {
        let mut by_size = differences.to_vec();
        by_size.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let mut ranked = Ranked { twice_ranks: Vec::new(), twice_positive: 0, twice_negative: 0, ties: 0.0 };
        for equal in by_size.chunk_by(|a, b| a.abs() == b.abs()) {
            let before = ranked.twice_ranks.len();
            let twice_rank = 2 * before + equal.len() + 1;
            let positive = equal.iter().filter(|difference| **difference > 0.0).count();
            ranked.twice_ranks.extend(equal.iter().map(|_| twice_rank));
            ranked.twice_positive += positive * twice_rank;
            ranked.twice_negative += (equal.len() - positive) * twice_rank;
            ranked.ties += count(equal.len()).powi(3) - count(equal.len());
        }
        ranked
    }
}

/// Twice the share of all sign assignments whose sum of positive ranks is at most `twice_sum`.
fn exact_p_value(twice_ranks: &[usize], twice_sum: usize) -> f64 {
    // Number of sign assignments for each sum: at most 2^50, which f64 holds exactly.
    let mut ways = vec![0.0; twice_ranks.iter().sum::<usize>() + 1];
    ways[0] = 1.0;
    let mut highest = 0;
    for rank in twice_ranks {
        for sum in (0..=highest).rev() {
            ways[sum + rank] += ways[sum];
        }
        highest += rank;
    }
    let as_small: f64 = ways[..=twice_sum].iter().sum();
    let all: f64 = ways.iter().sum();
    (2.0 * as_small / all).min(1.0)
}

/// The p-value of a rank sum by the normal approximation.
fn normal_p_value(pairs: usize, ties: f64, sum: f64) -> f64 {
    let n = count(pairs);
    let centre = n * (n + 1.0) / 4.0;
    let variance = (n * (n + 1.0) * (2.0 * n + 1.0) - ties / 2.0) / 24.0;
    (2.0 * normal_cdf((sum - centre) / variance.sqrt())).min(1.0)
}

/// The effect size A12: the probability that a value of `a` is greater than one of `b`, a tie
/// counting half (Vargha and Delaney, 2000). 0.5 is no difference; 0.56, 0.64 and 0.71 (or 0.44,
/// 0.36 and 0.29) are by convention a small, a medium and a large one.
///
/// # Errors
/// If a sample is empty, or a value is not finite.
pub fn a12(a: &[f64], b: &[f64]) -> Result<f64, StatisticsError> {
    check_sample(a, 1)?;
    check_sample(b, 1)?;
    let mut sorted = b.to_vec();
    sorted.sort_by(f64::total_cmp);
    let twice_won = |x: &f64| sorted.partition_point(|y| y < x) + sorted.partition_point(|y| y <= x);
    Ok(count(a.iter().map(twice_won).sum()) / (2.0 * count(a.len()) * count(b.len())))
}

/// P-values adjusted for multiple comparisons (Holm, 1979), which controls the family-wise error
/// rate. In the order of the input.
///
/// # Errors
/// If one is not within 0 to 1.
pub fn holm(p_values: &[f64]) -> Result<Vec<f64>, StatisticsError> {
    for &p in p_values {
        check_range("a p-value", p, 0.0..=1.0, "within 0 to 1")?;
    }
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut adjusted = vec![0.0; p_values.len()];
    let mut least = 0.0_f64;
    for (rank, place) in order.into_iter().enumerate() {
        least = least.max(count(p_values.len() - rank) * p_values[place]).min(1.0);
        adjusted[place] = least;
    }
    Ok(adjusted)
}
