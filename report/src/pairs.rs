//! Pairwise comparison of variants: runs are paired by block, and so by map.
//!
//! Effect, interval and p-value of a comparison are of one quantity: the ratio, or the difference,
//! of the means of the pairs. The comparisons under one condition are a family: their p-values are
//! adjusted together (Holm). Conditions are separate questions; an adjustment over all of them
//! would need far more maps.

use super::estimates::{Estimate, LEVEL, SEED, Times};
use super::evidence::PAIRS_MIN;
use super::measure::Compared;
use super::metrics::{MILESTONES, TimeUnit};
use super::outcomes::{column, condition_columns, condition_entries};
use super::study::{Condition, Pairs, Study};
use super::table::{Entry, Table, digits_for};
use experiments::plan::ALPHA;
use experiments::rows::RunRecord;
use statistics::{
    Effect, Exchange, StatisticsError, a12, detectable_difference, exchange_test, holm, mean, pairs_needed,
};

/// Probability with which a detectable difference is shown.
const POWER: f64 = 0.8;

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
    /// Number of independent pairs with those of which a run has failed.
    pub(super) blocks: usize,
    /// The time to which all measures are restricted, s.
    pub(super) horizon_s: f64,
    /// Runs of A and of B that have failed, among the pairs in the same blocks.
    pub(super) failed: [usize; 2],
    /// Runs of A and of B that have reached the share whose time is compared, among the pairs; all
    /// of them where the measure is no such time.
    pub(super) reached: [usize; 2],
    /// Whether pairs are left out because a run of theirs has failed and so has no value. The rest
    /// may be the easier maps: no interval, no p-value.
    pub(super) is_of_survivors: bool,
    /// Means in the unit of [`Compared::values`].
    pub(super) mean_a: f64,
    pub(super) mean_b: f64,
    /// A over B, or A less B; `None` if that is not defined.
    pub(super) effect: Option<Estimate>,
    pub(super) a12: f64,
    /// The p-value; `None` below [`PAIRS_MIN`] pairs, and of survivors.
    pub(super) p_value: Option<f64>,
    /// The p-value after Holm's correction for the family.
    pub(super) adjusted: Option<f64>,
    /// Number of comparisons that are corrected together.
    pub(super) comparisons: usize,
    /// Whether so many pairs can give an adjusted p-value below [`ALPHA`], whatever the outcome.
    pub(super) can_be_shown: bool,
    /// Effect that so many pairs show with a probability of [`POWER`] in the hardest step of Holm's
    /// correction, as in verdicts: of a ratio as a share of the mean of the worse variant. `None`
    /// if they show none, however large.
    pub(super) detectable: Option<f64>,
}

impl Comparison {
    /// Whether A is better than B on average, or as good.
    pub(super) fn is_a_better(&self, compared: Compared) -> bool {
        if compared.is_more_better() { self.mean_a >= self.mean_b } else { self.mean_a <= self.mean_b }
    }

    /// Whether the mean has times that are no time of a run, but only where the run ended.
    pub(super) fn is_censored(&self) -> bool {
        self.reached != [self.pairs; 2]
    }

    /// The least number of pairs with which some comparison of the family can be shown.
    pub(super) fn needed(&self) -> usize {
        pairs_needed(self.comparisons, ALPHA)
    }
}

/// All comparisons under a condition; one without common blocks is left out.
pub(super) fn comparisons(
    study: &Study,
    condition: &Condition,
    compared: Compared,
) -> Result<Vec<Comparison>, StatisticsError> {
    let horizon_s = study.horizon_s(condition);
    let mut samples = Vec::new();
    for a in 0..study.variants.len() {
        for b in a + 1..study.variants.len() {
            let pairs = compared.pairs(study, condition, a, b);
            if !pairs.a.is_empty() {
                samples.push(Sample { a, b, pairs, blocks: study.pairs(condition, a, b) });
            }
        }
    }
    let tested = samples.iter().filter(|sample| sample.has_test()).count();
    let comparisons = if tested > 0 { tested } else { samples.len() };
    let mut family = Vec::new();
    let mut least = Vec::new();
    for sample in &samples {
        let (comparison, least_p_value) = sample.comparison((compared, horizon_s), comparisons)?;
        least.extend(comparison.p_value.map(|_| least_p_value));
        family.push(comparison);
    }
    let p_values: Vec<f64> = family.iter().filter_map(|comparison| comparison.p_value).collect();
    // The least that the correction can give: that of the least p-values.
    let mut corrected = holm(&p_values)?.into_iter().zip(holm(&least)?);
    for comparison in family.iter_mut().filter(|comparison| comparison.p_value.is_some()) {
        if let Some((adjusted, least)) = corrected.next() {
            (comparison.adjusted, comparison.can_be_shown) = (Some(adjusted), least < ALPHA);
        }
    }
    Ok(family)
}

/// How many runs of A and of B have failed.
pub(super) fn failed(pairs: &Pairs<'_>) -> [usize; 2] {
    [&pairs.a, &pairs.b].map(|runs| runs.iter().filter(|run| run.row.failure().is_some()).count())
}

/// The runs of a comparison.
struct Sample<'a> {
    a: usize,
    b: usize,
    /// Those that have a value.
    pairs: Pairs<'a>,
    /// All.
    blocks: Pairs<'a>,
}

impl Sample<'_> {
    fn is_of_survivors(&self) -> bool {
        self.pairs.a.len() < self.blocks.a.len()
    }

    fn has_test(&self) -> bool {
        self.pairs.a.len() >= PAIRS_MIN && !self.is_of_survivors()
    }

    /// The comparison without the correction, and the least p-value that so many pairs can give.
    fn comparison(
        &self,
        (compared, horizon_s): (Compared, f64),
        comparisons: usize,
    ) -> Result<(Comparison, f64), StatisticsError> {
        let &Self { a, b, ref pairs, ref blocks } = self;
        let values = |runs: &[&RunRecord]| compared.values(runs, horizon_s);
        let (values_a, values_b) = (values(&pairs.a), values(&pairs.b));
        let (mean_a, mean_b) = (mean(&values_a)?, mean(&values_b)?);
        let needed = ALPHA / comparisons as f64;
        let Exchange { effect, interval, p_value, least_p_value } =
            exchange_test(&values_a, &values_b, compared.effect(), LEVEL, needed, SEED)?;
        // Of the one with the greater mean, so that it does not matter which is first.
        let sign = if mean_a >= mean_b { 1.0 } else { -1.0 };
        let differences: Vec<f64> = values_a.iter().zip(&values_b).map(|(a, b)| sign * (a - b)).collect();
        let varies = differences.windows(2).any(|pair| pair[0] != pair[1]);
        let has_test = self.has_test();
        let detectable = if has_test && varies {
            let difference = detectable_difference(&differences, differences.len(), needed, POWER, SEED)?;
            let worse = mean_a.max(mean_b);
            let base = if compared.effect() == Effect::Ratio { worse } else { 1.0 };
            difference.filter(|difference| *difference <= compared.largest(worse)).map(|difference| difference / base)
        } else {
            None
        };
        let comparison = Comparison {
            a,
            b,
            pairs: pairs.a.len(),
            all_pairs: pairs.all,
            maps: pairs.maps,
            blocks: blocks.a.len(),
            horizon_s,
            failed: failed(blocks),
            reached: [&pairs.a, &pairs.b].map(|runs| compared.reached(runs, horizon_s)),
            is_of_survivors: self.is_of_survivors(),
            mean_a,
            mean_b,
            effect: effect.map(|mean| Estimate { mean, interval: interval.filter(|_| !self.is_of_survivors()) }),
            a12: a12(&values_a, &values_b)?,
            p_value: has_test.then_some(p_value),
            adjusted: None,
            comparisons,
            can_be_shown: false,
            detectable,
        };
        Ok((comparison, least_p_value))
    }
}

/// The table for a paper: of each variant the time to 99 %, and its ratio to that of the fastest
/// one, with the p-value of their comparison; none for a study of one variant.
pub(super) fn summary(study: &Study) -> Result<Option<Table>, StatisticsError> {
    const PLACE: usize = 1;
    if study.variants.len() < 2 {
        return Ok(None);
    }
    let (milestone, unit) = (MILESTONES[PLACE], TimeUnit::of(&study.runs));
    let mut columns = condition_columns(study);
    columns.extend([
        column(&study.variant_title, &study.variant_title),
        column("runs", "reached_99"),
        column(&format!("time ({}) [95 % CI]", unit.symbol), &format!("time_99_{}", unit.symbol)),
        column("times the fastest [95 % CI]", "ratio"),
        column("p", "p_holm"),
    ]);
    let mut rows = Vec::new();
    for condition in &study.conditions {
        let compared = comparisons(study, condition, Compared::Time(PLACE))?;
        let mut cells = Vec::new();
        for variant in 0..study.variants.len() {
            let runs = study.cell(condition, variant);
            if !runs.is_empty() {
                let times = Times::of(&runs, milestone);
                cells.push((variant, times.reached(), runs.len(), times.estimate()?));
            }
        }
        let fastest = cells.iter().min_by(|one, other| one.3.mean.total_cmp(&other.3.mean)).map(|cell| cell.0);
        for (variant, reached, runs, time) in cells {
            let of_pair = |comparison: &&Comparison| {
                let pair = [Some(comparison.a), Some(comparison.b)];
                pair == [Some(variant), fastest] || pair == [fastest, Some(variant)]
            };
            let comparison = compared.iter().find(of_pair);
            let ratio = comparison.and_then(|comparison| {
                let effect = comparison.effect?;
                if comparison.a == variant { Some(effect) } else { effect.inverse() }
            });
            let mut row = condition_entries(study, condition);
            row.extend([
                Entry::Text(study.variants[variant].clone()),
                Entry::Share(reached, runs),
                Entry::Mean(Some(time.in_unit(unit)), 1),
                Entry::Mean(ratio, 2),
                Entry::Probability(comparison.and_then(|comparison| comparison.adjusted)),
            ]);
            rows.push(row);
        }
    }
    let caption = "Restricted mean time until the team has seen 99 % of the free cells. A run that does not reach it \
                   counts with the duration; the column of runs has how many do. The ratio and its p-value (permutation test, \
                   Holm) are of the runs on the same maps, beside the fastest variant, which has none.";
    Ok(Some(Table { name: "summary", caption: caption.to_owned(), columns, rows }))
}

/// One table per measure, the primary one first; none for a study of one variant.
pub(super) fn tables(study: &Study) -> Result<Vec<Table>, StatisticsError> {
    if study.variants.len() < 2 {
        return Ok(Vec::new());
    }
    let primary = Compared::of(study.design.primary());
    let others = Compared::SECONDARY.into_iter().filter(|compared| *compared != primary);
    std::iter::once(primary).chain(others).map(|compared| table(study, compared, compared == primary)).collect()
}

fn table(study: &Study, compared: Compared, is_primary: bool) -> Result<Table, StatisticsError> {
    let mut columns = condition_columns(study);
    let effect = match compared.effect() {
        Effect::Ratio => ("A / B [95 % CI]", "ratio"),
        Effect::Difference => ("A - B (points) [95 % CI]", "difference"),
    };
    let detectable = match compared.effect() {
        Effect::Ratio => ("detectable (%)", "detectable"),
        Effect::Difference => ("detectable (points)", "detectable"),
    };
    let titles = [
        ("A", "a"),
        ("B", "b"),
        effect,
        ("independent pairs", "pairs"),
        ("maps", "maps"),
        ("p (Holm)", "p_holm"),
        ("p", "p"),
        detectable,
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
    let unit = TimeUnit::of(&study.runs);
    let mut rows = Vec::new();
    for condition in &study.conditions {
        for comparison in comparisons(study, condition, compared)? {
            let Comparison { a, b, pairs, all_pairs, maps, failed, mean_a, mean_b, effect, a12, .. } = comparison;
            let Comparison { p_value, adjusted, detectable, .. } = comparison;
            let [mean_a, mean_b] = [mean_a, mean_b].map(|mean| compared.in_unit(mean, unit));
            let percent = if compared.effect() == Effect::Ratio { 100.0 } else { 1.0 };
            let mut row = condition_entries(study, condition);
            row.extend([a, b].map(|variant| Entry::Text(study.variants[variant].clone())));
            row.extend([
                Entry::Mean(effect, 2),
                Entry::Count(pairs),
                Entry::Count(maps),
                Entry::Probability(adjusted),
                Entry::Probability(p_value),
                Entry::Number(detectable.map(|share| percent * share), 1),
                Entry::Number(Some(a12), 2),
                Entry::Number(Some(mean_a), digits_for(mean_a)),
                Entry::Number(Some(mean_b), digits_for(mean_b)),
                Entry::Count(all_pairs),
            ]);
            row.extend(failed.map(Entry::Count).into_iter().filter(|_| has_failures));
            rows.push(row);
        }
    }
    let rank = if is_primary { "Primary measure of the plan" } else { "Secondary measure, which no verdict is about" };
    let base = if compared.effect() == Effect::Ratio { ", in per cent of the mean of the worse variant" } else { "" };
    let caption = format!(
        "{rank}: {}. A and B compared pair by pair, on the same map with the same seed. Interval and p: permutation \
         test of the means, which exchanges the runs of each pair; no p below {PAIRS_MIN} independent pairs, and none of \
         survivors, where failed runs have no value. Holm: \
         adjusted for all comparisons of the same panel. Detectable: the difference that so many pairs, if they \
         scatter like these, show with a probability of 80 % after that correction{base}; missing if they show none. \
         A12: probability that A has the greater value, a tie counting half.",
        compared.title(unit)
    );
    Ok(Table { name: compared.table(), caption, columns, rows })
}

#[cfg(test)]
mod tests;
