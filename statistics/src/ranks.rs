//! The effect size A12, and the correction of p-values for multiple comparisons.

use super::{StatisticsError, check_range, check_sample, count};

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
