//! The log-rank test of times of which some are censored, stratified by pair.

use super::survival::{self, Censored};
use super::{StatisticsError, check_pairs, count};

/// The statistic of [`log_rank`].
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

/// The log-rank test of pairs, each a stratum of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StratifiedLogRank {
    /// Number of pairs in which the run of `a` reaches the milestone first, or alone.
    pub first_a: usize,
    /// Number of those in which the run of `b` does. In the others both reach it at the same time,
    /// or none does.
    pub first_b: usize,
    /// Two-sided, exact over all exchanges within pairs.
    pub p_value: f64,
}

impl StratifiedLogRank {
    /// The statistic, chi-squared with one degree of freedom; 0 if no pair tells the two apart.
    #[must_use]
    pub fn chi_squared(&self) -> f64 {
        let (first_a, first_b) = (count(self.first_a), count(self.first_b));
        if self.first_a + self.first_b > 0 { (first_a - first_b).powi(2) / (first_a + first_b) } else { 0.0 }
    }
}

/// The log-rank test stratified by pair (Mantel, 1966): `a[i]` and `b[i]` are runs on the same map,
/// at risk together and with no others. In a stratum of two the observed number differs from the
/// expected one by one half, to the side of the run that is first, so the exact test is the sign
/// test of who is first. It weighs all pairs alike, however far apart the times are.
///
/// # Errors
/// As [`log_rank`], or if the samples differ in length.
pub fn stratified_log_rank(a: &[Censored], b: &[Censored]) -> Result<StratifiedLogRank, StatisticsError> {
    check_pairs(a, b)?;
    survival::check(a)?;
    survival::check(b)?;
    let (mut first_a, mut first_b) = (0, 0);
    for (a, b) in a.iter().zip(b) {
        let of_pair = log_rank(&[*a], &[*b])?;
        first_a += usize::from(of_pair.observed_less_expected > 0.0);
        first_b += usize::from(of_pair.observed_less_expected < 0.0);
    }
    Ok(StratifiedLogRank { first_a, first_b, p_value: sign_p_value(first_a, first_b) })
}

/// Twice the probability that at most so many of that many fair coins show the rarer side.
fn sign_p_value(one: usize, other: usize) -> f64 {
    let coins = count(one + other);
    let at = |heads: usize| {
        let heads = count(heads);
        let ways = libm::lgamma(coins + 1.0) - libm::lgamma(heads + 1.0) - libm::lgamma(coins - heads + 1.0);
        libm::exp(ways - coins * std::f64::consts::LN_2)
    };
    (2.0 * (0..=one.min(other)).map(at).sum::<f64>()).min(1.0)
}
