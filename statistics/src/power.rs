//! What a number of pairs can show.

use super::bootstrap::normal_quantile;
use super::{StatisticsError, check_range, check_sample, count, mean};

/// Asymptotic relative efficiency of the signed-rank test to the t-test for normal differences,
/// 3 / pi: so many per cent of the pairs would do for a t-test.
const EFFICIENCY: f64 = 3.0 / std::f64::consts::PI;

/// The difference of means that so many pairs, with differences that scatter like these, would show
/// with a probability of `power` in a two-sided signed-rank test at the level `alpha`, by the
/// normal approximation.
///
/// # Errors
/// If there are fewer than two pairs, one is not finite, or a probability is not between 0 and 1.
pub fn detectable_difference(differences: &[f64], alpha: f64, power: f64) -> Result<f64, StatisticsError> {
    check_sample(differences, 2)?;
    for (what, value) in [("the level of a test", alpha), ("the power of a test", power)] {
        check_range(what, value, f64::EPSILON..=1.0 - f64::EPSILON, "between 0 and 1")?;
    }
    let centre = mean(differences)?;
    let squares: f64 = differences.iter().map(|difference| (difference - centre) * (difference - centre)).sum();
    let deviation = (squares / (count(differences.len()) - 1.0)).sqrt();
    let reach = normal_quantile(1.0 - alpha / 2.0) + normal_quantile(power);
    Ok(reach * deviation / (EFFICIENCY * count(differences.len())).sqrt())
}
