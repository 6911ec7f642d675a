//! Pairwise comparison of controllers: runs are paired by seed, and so by map.
//!
//! The comparisons under one condition are a family: their p-values are adjusted together (Holm).
//! Conditions are separate questions; an adjustment over all of them would need far more seeds.

use super::estimates::{Estimate, LEVEL, RESAMPLES, SEED, Times};
use super::metrics::{AREA, DISTANCE, EXPLORED, MILESTONES, TimeUnit};
use super::outcomes::{column, condition_columns, condition_entries};
use super::study::Study;
use super::table::{Entry, Table, digits_for};
use crate::rows::RunRecord;
use crate::statistics::{Pairing, StatisticsError, a12, bootstrap_ratio, holm, mean, wilcoxon_signed_rank};

/// One table per metric; none for a study of one controller.
pub(super) fn tables(study: &Study) -> Result<Vec<Table>, StatisticsError> {
    if study.controllers.len() < 2 {
        return Ok(Vec::new());
    }
    let unit = TimeUnit::of(&study.runs);
    let times = |runs: &[&RunRecord]| -> Vec<f64> {
        Times::of(runs, MILESTONES[1]).restricted().iter().map(|time| time / unit.seconds).collect()
    };
    let compared: [Compared; 4] = [
        ("pairs-time-99", format!("restricted time to 99 % ({}), less is better", unit.symbol), &times),
        ("pairs-area", format!("{}, more is better", AREA.label()), &|runs| AREA.values(runs)),
        ("pairs-explored", format!("{}, more is better", EXPLORED.label()), &|runs| EXPLORED.values(runs)),
        ("pairs-distance", format!("{}, less is better", DISTANCE.label()), &|runs| DISTANCE.values(runs)),
    ];
    compared.into_iter().map(|compared| table(study, compared)).collect()
}

/// Name of the table, title of the metric, and its values.
type Compared<'a> = (&'static str, String, &'a dyn Fn(&[&RunRecord]) -> Vec<f64>);

fn table(study: &Study, (name, what, values): Compared) -> Result<Table, StatisticsError> {
    let mut columns = condition_columns(study);
    let titles = [
        ("A", "a"),
        ("B", "b"),
        ("pairs", "pairs"),
        ("mean of A", "mean_a"),
        ("mean of B", "mean_b"),
        ("A / B [95 % CI]", "ratio"),
        ("A12", "a12"),
        ("p (Wilcoxon)", "p"),
        ("p (Holm)", "p_holm"),
    ];
    columns.extend(titles.map(|(title, key)| column(title, key)));
    let mut rows = Vec::new();
    for condition in &study.conditions {
        let mut family = Vec::new();
        let mut p_values = Vec::new();
        for a in 0..study.controllers.len() {
            for b in a + 1..study.controllers.len() {
                let (runs_a, runs_b) = paired(&study.cell(condition, a), &study.cell(condition, b));
                if runs_a.is_empty() {
                    continue;
                }
                let (values_a, values_b) = (values(&runs_a), values(&runs_b));
                let (mean_a, mean_b) = (mean(&values_a)?, mean(&values_b)?);
                let test = wilcoxon_signed_rank(&values_a, &values_b)?;
                let mut row = condition_entries(condition);
                row.extend([a, b].map(|controller| Entry::Text(study.controllers[controller].clone())));
                row.push(Entry::Count(runs_a.len()));
                row.extend([mean_a, mean_b].map(|mean| Entry::Number(Some(mean), digits_for(mean))));
                row.push(ratio(&values_a, &values_b)?);
                row.push(Entry::Number(Some(a12(&values_a, &values_b)?), 2));
                row.push(Entry::Probability(test.p_value));
                p_values.push(test.p_value);
                family.push(row);
            }
        }
        for (row, p) in family.iter_mut().zip(holm(&p_values)?) {
            row.push(Entry::Probability(p));
        }
        rows.append(&mut family);
    }
    let caption = format!(
        "Controllers A and B compared run by run with the same seed: {what}. A12: probability that A has the greater \
         value, a tie counting half; 0.5 is no difference. p: Wilcoxon signed-rank test, two-sided; Holm: adjusted \
         for all comparisons on the same kind of map with the same number of agents."
    );
    Ok(Table { name, caption, columns, rows })
}

/// The ratio of the means: without an interval for a single pair, empty if the denominator is 0.
fn ratio(a: &[f64], b: &[f64]) -> Result<Entry, StatisticsError> {
    let (mean_a, mean_b) = (mean(a)?, mean(b)?);
    if mean_b == 0.0 {
        return Ok(Entry::Mean(None, 2));
    }
    let interval = match bootstrap_ratio(a, b, Pairing::Paired, LEVEL, RESAMPLES, SEED) {
        Ok(interval) => Some(interval),
        Err(StatisticsError::TooFew { .. } | StatisticsError::ZeroDenominator) => None,
        Err(error) => return Err(error),
    };
    Ok(Entry::Mean(Some(Estimate { mean: mean_a / mean_b, interval }), 2))
}

/// The runs of two cells that share a seed, in the same order. Both cells are sorted by seed.
fn paired<'a>(a: &[&'a RunRecord], b: &[&'a RunRecord]) -> (Vec<&'a RunRecord>, Vec<&'a RunRecord>) {
    let other = |run: &&'a RunRecord| {
        let index = b.binary_search_by_key(&run.row.seed, |other| other.row.seed).ok()?;
        Some((*run, b[index]))
    };
    a.iter().filter_map(other).unzip()
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn runs_are_paired_by_seed() {
        let runs: Vec<_> = [1, 2, 5].map(|seed| fixture::run("dsvp", seed, 2)).into();
        let others: Vec<_> = [2, 3, 5].map(|seed| fixture::run("lvd", seed, 2)).into();
        let (a, b) = paired(&runs.iter().collect::<Vec<_>>(), &others.iter().collect::<Vec<_>>());
        let seeds = |runs: Vec<&RunRecord>| runs.iter().map(|run| run.row.seed).collect::<Vec<_>>();
        assert_eq!((seeds(a), seeds(b)), (vec![2, 5], vec![2, 5]));
    }

    #[test]
    fn comparison_without_common_seeds_has_no_rows() {
        let study = Study::new(vec![fixture::run("dsvp", 1, 2), fixture::run("lvd", 2, 2)], None);
        assert!(tables(&study).unwrap().iter().all(|table| table.rows.is_empty()));
    }
}
