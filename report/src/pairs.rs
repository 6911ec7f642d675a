//! Pairwise comparison of variants: runs are paired by block, and so by map.
//!
//! A comparison is an effect with its interval first; a test says how likely such an effect is by
//! chance alone. The comparisons under one condition are a family: their p-values are adjusted
//! together (Holm). Conditions are separate questions; an adjustment over all of them would need
//! far more maps.

use super::estimates::{Estimate, LEVEL, RESAMPLES, SEED, Times};
use super::evidence::PAIRS_MIN;
use super::metrics::{AREA, DISTANCE, EXPLORED, MILESTONES, Metric, TimeUnit};
use super::outcomes::{column, condition_columns, condition_entries};
use super::study::{Condition, Pairs, Study};
use super::table::{Entry, Table, digits_for};
use experiments::rows::RunRecord;
use statistics::{
    Pairing, StatisticsError, a12, bootstrap_ratio, detectable_difference, holm, mean, paired_log_rank,
    wilcoxon_signed_rank,
};

/// Probability of a false difference in a family of comparisons.
pub(super) const ALPHA: f64 = 0.05;
/// Probability with which a detectable difference is shown.
const POWER: f64 = 0.8;

/// What is compared.
#[derive(Debug, Clone, Copy)]
pub(super) enum Compared {
    /// Restricted time to 99 %, s; less is better.
    Time,
    /// A metric; whether more is better.
    Metric(Metric, bool),
}

impl Compared {
    /// All that have a table, by its name.
    const ALL: [(&str, Self); 4] = [
        ("pairs-time-99", Self::Time),
        ("pairs-area", Self::AREA),
        ("pairs-explored", Self::Metric(EXPLORED, true)),
        ("pairs-distance", Self::Metric(DISTANCE, false)),
    ];
    pub(super) const AREA: Self = Self::Metric(AREA, true);

    /// The value of each run; times in the unit of the report.
    fn values(self, runs: &[&RunRecord], unit: TimeUnit) -> Vec<f64> {
        match self {
            Self::Time => Times::of(runs, MILESTONES[1]).restricted().iter().map(|time| time / unit.seconds).collect(),
            Self::Metric(metric, _) => metric.values(runs),
        }
    }

    /// The pairs of runs that count: for a metric without a value of failed runs, those that have
    /// not failed.
    fn pairs<'a>(self, study: &'a Study, condition: &Condition, a: usize, b: usize) -> Pairs<'a> {
        match self {
            Self::Metric(metric, _) if metric.of_failed.is_none() => study.measured_pairs(condition, a, b),
            _ => study.pairs(condition, a, b),
        }
    }

    fn title(self, unit: TimeUnit) -> String {
        match self {
            Self::Time => format!("restricted time to 99 % ({}), less is better", unit.symbol),
            Self::Metric(metric, more) => {
                format!("{}, {} is better", metric.label(), if more { "more" } else { "less" })
            }
        }
    }
}

/// The test that a p-value is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Test {
    Wilcoxon,
    /// For times of which some are censored.
    LogRank,
}

/// Two variants compared pair by pair.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Comparison {
    pub(super) a: usize,
    pub(super) b: usize,
    /// Number of independent pairs.
    pub(super) pairs: usize,
    /// Number of pairs with those that repeat another one.
    pub(super) all_pairs: usize,
    /// Number of different maps.
    pub(super) maps: usize,
    /// Runs of A and of B that have failed, among the pairs in the same blocks.
    pub(super) failed: [usize; 2],
    pub(super) mean_a: f64,
    pub(super) mean_b: f64,
    /// Mean of A over mean of B; `None` if that of B is 0.
    pub(super) ratio: Option<Estimate>,
    pub(super) a12: f64,
    /// The test and its p-value; `None` below [`PAIRS_MIN`] pairs.
    pub(super) test: Option<(Test, f64)>,
    /// The p-value after Holm's correction for the family.
    pub(super) adjusted: Option<f64>,
    /// Difference that so many pairs show with a probability of [`POWER`], over the mean of the
    /// worse variant, as the effect in verdicts; `None` if it is not known.
    pub(super) detectable: Option<f64>,
}

impl Comparison {
    /// Whether A is better than B on average, or as good.
    pub(super) fn is_a_better(&self, compared: Compared) -> bool {
        match compared {
            Compared::Time => self.mean_a <= self.mean_b,
            Compared::Metric(_, more) => (self.mean_a >= self.mean_b) == more,
        }
    }
}

/// All comparisons under a condition; one without common blocks is left out.
pub(super) fn comparisons(
    study: &Study,
    condition: &Condition,
    compared: Compared,
) -> Result<Vec<Comparison>, StatisticsError> {
    let mut family = Vec::new();
    for a in 0..study.variants.len() {
        for b in a + 1..study.variants.len() {
            family.extend(comparison(study, condition, (a, b), compared)?);
        }
    }
    let p_values: Vec<f64> = family.iter().filter_map(|comparison| Some(comparison.test?.1)).collect();
    let mut adjusted = holm(&p_values)?.into_iter();
    let tests = p_values.len().max(1) as f64;
    for comparison in &mut family {
        comparison.adjusted = comparison.test.and_then(|_| adjusted.next());
    }
    for comparison in &mut family {
        let pairs = compared.pairs(study, condition, comparison.a, comparison.b);
        let unit = TimeUnit::of(&study.runs);
        let (a, b) = (compared.values(&pairs.a, unit), compared.values(&pairs.b, unit));
        let differences: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let varies = differences.windows(2).any(|pair| pair[0] != pair[1]);
        let worse = if comparison.is_a_better(compared) { comparison.mean_b } else { comparison.mean_a };
        if comparison.test.is_some() && worse > 0.0 && varies {
            // The hardest step of Holm's correction.
            let difference = detectable_difference(&differences, ALPHA / tests, POWER)?;
            comparison.detectable = Some(difference / worse);
        }
    }
    Ok(family)
}

fn comparison(
    study: &Study,
    condition: &Condition,
    (a, b): (usize, usize),
    compared: Compared,
) -> Result<Option<Comparison>, StatisticsError> {
    let failed = {
        let pairs = study.pairs(condition, a, b);
        [&pairs.a, &pairs.b].map(|runs| runs.iter().filter(|run| run.row.failure().is_some()).count())
    };
    let pairs = compared.pairs(study, condition, a, b);
    if pairs.a.is_empty() {
        return Ok(None);
    }
    let unit = TimeUnit::of(&study.runs);
    let (values_a, values_b) = (compared.values(&pairs.a, unit), compared.values(&pairs.b, unit));
    let test = if pairs.a.len() < PAIRS_MIN {
        None
    } else {
        Some(match compared {
            Compared::Time => {
                let [times_a, times_b] = [&pairs.a, &pairs.b].map(|runs| Times::of(runs, MILESTONES[1]).runs);
                if times_a.iter().chain(&times_b).all(|time| time.happened) {
                    (Test::Wilcoxon, wilcoxon_signed_rank(&values_a, &values_b)?.p_value)
                } else {
                    (Test::LogRank, paired_log_rank(&times_a, &times_b, SEED)?)
                }
            }
            Compared::Metric(..) => (Test::Wilcoxon, wilcoxon_signed_rank(&values_a, &values_b)?.p_value),
        })
    };
    Ok(Some(Comparison {
        a,
        b,
        pairs: pairs.a.len(),
        all_pairs: pairs.all,
        maps: pairs.maps,
        failed,
        mean_a: mean(&values_a)?,
        mean_b: mean(&values_b)?,
        ratio: ratio(&values_a, &values_b)?,
        a12: a12(&values_a, &values_b)?,
        test,
        adjusted: None,
        detectable: None,
    }))
}

/// The ratio of the means: without an interval for a single pair, `None` if the denominator is 0.
fn ratio(a: &[f64], b: &[f64]) -> Result<Option<Estimate>, StatisticsError> {
    let (mean_a, mean_b) = (mean(a)?, mean(b)?);
    if mean_b == 0.0 {
        return Ok(None);
    }
    let interval = match bootstrap_ratio(a, b, Pairing::Paired, LEVEL, RESAMPLES, SEED) {
        Ok(interval) => Some(interval),
        Err(StatisticsError::TooFew { .. } | StatisticsError::ZeroDenominator) => None,
        Err(error) => return Err(error),
    };
    Ok(Some(Estimate { mean: mean_a / mean_b, interval }))
}

/// One table per metric; none for a study of one variant.
pub(super) fn tables(study: &Study) -> Result<Vec<Table>, StatisticsError> {
    if study.variants.len() < 2 {
        return Ok(Vec::new());
    }
    Compared::ALL.into_iter().map(|(name, compared)| table(study, name, compared)).collect()
}

fn table(study: &Study, name: &'static str, compared: Compared) -> Result<Table, StatisticsError> {
    let mut columns = condition_columns(study);
    let titles = [
        ("A", "a"),
        ("B", "b"),
        ("A / B [95 % CI]", "ratio"),
        ("independent pairs", "pairs"),
        ("maps", "maps"),
        ("p (Holm)", "p_holm"),
        ("p", "p"),
        ("test", "test"),
        ("detectable (%)", "detectable"),
        ("A12", "a12"),
        ("mean of A", "mean_a"),
        ("mean of B", "mean_b"),
        ("all pairs", "all_pairs"),
    ];
    columns.extend(titles.map(|(title, key)| column(title, key)));
    let has_failures = study.failed() > 0;
    if has_failures {
        columns.extend(
            [("runs of A that failed", "failed_a"), ("of B", "failed_b")].map(|(title, key)| column(title, key)),
        );
    }
    let mut rows = Vec::new();
    for condition in &study.conditions {
        for comparison in comparisons(study, condition, compared)? {
            let Comparison { a, b, pairs, all_pairs, maps, failed, mean_a, mean_b, ratio, a12, test, .. } = comparison;
            let Comparison { adjusted, detectable, .. } = comparison;
            let mut row = condition_entries(study, condition);
            row.extend([a, b].map(|variant| Entry::Text(study.variants[variant].clone())));
            let test_name = match test {
                Some((Test::Wilcoxon, _)) => "signed-rank",
                Some((Test::LogRank, _)) => "log-rank",
                None => "too few",
            };
            row.extend([
                Entry::Mean(ratio, 2),
                Entry::Count(pairs),
                Entry::Count(maps),
                Entry::Probability(adjusted),
                Entry::Probability(test.map(|(_, p)| p)),
                Entry::Text(test_name.to_owned()),
                Entry::Number(detectable.map(|share| 100.0 * share), 1),
                Entry::Number(Some(a12), 2),
                Entry::Number(Some(mean_a), digits_for(mean_a)),
                Entry::Number(Some(mean_b), digits_for(mean_b)),
                Entry::Count(all_pairs),
            ]);
            row.extend(failed.map(Entry::Count).into_iter().filter(|_| has_failures));
            rows.push(row);
        }
    }
    let what = compared.title(TimeUnit::of(&study.runs));
    let caption = format!(
        "A and B compared pair by pair, on the same map with the same seed: {what}. p: two-sided, signed-rank test \
         (Wilcoxon), or log-rank test with exchanges within pairs if some times are censored; none below {PAIRS_MIN} \
         independent pairs. Holm: adjusted for all comparisons of the same panel. Detectable: the difference that \
         this number of pairs would show with a probability of 80 %, in per cent of the mean of the worse variant. \
         A12: probability that A has the greater value, a tie counting half."
    );
    Ok(Table { name, caption, columns, rows })
}

#[cfg(test)]
mod tests;
