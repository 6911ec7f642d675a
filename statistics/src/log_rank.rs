//! The log-rank test of times of which some are censored.

use super::survival::{self, Censored};
use super::{StatisticsError, check_pairs, count};

/// Maximum number of pairs for which all exchanges within pairs are enumerated.
const ENUMERATED_PAIRS_MAX: usize = 13;

/// Number of random exchanges for more pairs. The p-value is a multiple of 1 over one more.
const EXCHANGES: usize = 9_999;

/// Maximum rounding error of an observed minus expected number.
const TOLERANCE: f64 = 1e-9;

/// The result of [`log_rank`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogRank {
    /// Number of runs of `a` that reach the milestone, less the number expected if both reach it
    /// alike. Above 0: `a` is faster.
    pub observed_less_expected: f64,
    /// Variance of that number if both reach it alike.
    pub variance: f64,
}

impl LogRank {
    /// The statistic of independent samples, chi-squared with one degree of freedom; 0 if no time
    /// distinguishes the samples.
    #[must_use]
    pub fn chi_squared(&self) -> f64 {
        if self.variance > 0.0 { self.observed_less_expected.powi(2) / self.variance } else { 0.0 }
    }
}

/// The log-rank statistic of two samples (Mantel, 1966).
///
/// # Errors
/// If a sample is empty, or a time is not finite or below 0.
pub fn log_rank(a: &[Censored], b: &[Censored]) -> Result<LogRank, StatisticsError> {
    survival::check(a)?;
    survival::check(b)?;
    let mut runs: Vec<(Censored, bool)> =
        a.iter().map(|&run| (run, true)).chain(b.iter().map(|&run| (run, false))).collect();
    runs.sort_by(|one, other| one.0.time.total_cmp(&other.0.time));
    let (mut at_risk_a, mut at_risk) = (count(a.len()), count(runs.len()));
    let mut result = LogRank { observed_less_expected: 0.0, variance: 0.0 };
    for together in runs.chunk_by(|one, other| one.0.time == other.0.time) {
        let of = |wanted: &dyn Fn(&(Censored, bool)) -> bool| count(together.iter().filter(|run| wanted(run)).count());
        let (reached, reached_a) = (of(&|run| run.0.happened), of(&|run| run.0.happened && run.1));
        let share = at_risk_a / at_risk;
        result.observed_less_expected += reached_a - reached * share;
        if at_risk > 1.0 {
            result.variance += reached * share * (1.0 - share) * (at_risk - reached) / (at_risk - 1.0);
        }
        at_risk_a -= of(&|run| run.1);
        at_risk -= count(together.len());
    }
    Ok(result)
}

/// The two-sided p-value of the log-rank statistic of pairs: `a[i]` and `b[i]` are runs on the same
/// map. It is the share of exchanges within pairs for which the observed number differs from the
/// expected one by as much: if the two do not differ, each exchange is equally likely. For up to 13
/// pairs all exchanges are enumerated; otherwise 9 999 are drawn, and the given one counts as one
/// more (Phipson and Smyth, 2010).
///
/// # Errors
/// As [`log_rank`], or if the samples differ in length.
pub fn paired_log_rank(a: &[Censored], b: &[Censored], seed: u64) -> Result<f64, StatisticsError> {
    check_pairs(a, b)?;
    let given = log_rank(a, b)?.observed_less_expected.abs() - TOLERANCE;
    let (mut left, mut right) = (a.to_vec(), b.to_vec());
    let mut is_as_large = |exchanged: &mut dyn FnMut() -> bool| -> Result<bool, StatisticsError> {
        for place in 0..a.len() {
            (left[place], right[place]) = if exchanged() { (b[place], a[place]) } else { (a[place], b[place]) };
        }
        Ok(log_rank(&left, &right)?.observed_less_expected.abs() >= given)
    };
    if a.len() <= ENUMERATED_PAIRS_MAX {
        let all = 1_usize << a.len();
        let mut as_large = 0;
        for choice in 0..all {
            let mut left_bits = choice;
            let mut next = || {
                let bit = left_bits & 1 == 1;
                left_bits >>= 1;
                bit
            };
            as_large += usize::from(is_as_large(&mut next)?);
        }
        return Ok(count(as_large) / count(all));
    }
    let mut bits = super::bootstrap::coins(seed, "statistics.exchange");
    let mut as_large = 1;
    for _ in 0..EXCHANGES {
        as_large += usize::from(is_as_large(&mut bits)?);
    }
    Ok(count(as_large) / count(EXCHANGES + 1))
}
