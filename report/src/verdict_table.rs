//! The verdicts as a table for programs: a row for each pair of variants and each panel, with the
//! numbers of its sentence.

use std::path::Path;

use super::ReportError;
use super::estimates::Estimate;
use super::measure::Compared;
use super::metrics::TimeUnit;
use super::pairs::Comparison;
use super::study::Study;
use super::verdicts::{Verdict, verdicts};
use experiments::tables::{Table, column};
use statistics::{Effect, Interval};

/// A verdict with the name of its panel.
type Row = (String, Verdict);

/// The verdicts on the runs of a folder.
///
/// Columns: `panel`; the variants `a` and `b`; `measure`, named as in plans, and its `effect`:
/// `ratio` (A over B) or `difference` (A less B, points); `estimate` with the ends `low` and
/// `high` of its 95 % interval; `p`, and `p_holm` after the correction for the panel; `pairs`,
/// the number of independent pairs, on so many `maps`; `blocks`, the pairs with those of failed
/// runs; `failed_a` and `failed_b`, which have failed in these; `reached_a` and `reached_b`, the
/// runs that have reached the share whose time is compared; `mean_a` and `mean_b`, seconds, per
/// cent or metres; `a12`; `verdict` and `second`, the words of the report. What is missing has no
/// value.
///
/// # Errors
/// As [`super::write()`], without those of its files.
pub fn verdict_table(dir: &Path) -> Result<Table, ReportError> {
    Ok(table(&Study::read(dir)?)?)
}

fn table(study: &Study) -> Result<Table, statistics::StatisticsError> {
    let compared = Compared::of(study.design.primary());
    let of_panel = |panel: super::verdicts::Verdicts| {
        panel.verdicts.into_iter().map(move |verdict| (panel.panel.clone(), verdict))
    };
    let rows: Vec<Row> = verdicts(study)?.into_iter().flat_map(of_panel).collect();
    let number = |name: &str, of: &dyn Fn(&Comparison) -> Option<f64>| {
        column(name, &rows, |(_, verdict): &Row| verdict.comparison.as_ref().and_then(of))
    };
    let count = |name: &str, of: &dyn Fn(&Comparison) -> usize| {
        column(name, &rows, |(_, verdict): &Row| verdict.comparison.as_ref().map_or(0, of) as u64)
    };
    let variant = |name: &str, place: usize| {
        column(name, &rows, |(_, verdict): &Row| study.variants[verdict.variants[place]].clone())
    };
    let failed = |name: &str, place: usize| column(name, &rows, |(_, verdict): &Row| verdict.failed[place] as u64);
    let interval = |of: &Comparison| of.effect.and_then(|Estimate { interval, .. }| interval);
    let mean = |mean: f64| Some(compared.in_unit(mean, TimeUnit::SECONDS));
    let effect = if compared.effect() == Effect::Ratio { "ratio" } else { "difference" };
    let columns = [
        column("panel", &rows, |(panel, _): &Row| panel.clone()),
        variant("a", 0),
        variant("b", 1),
        column("measure", &rows, |_: &Row| compared.name().to_owned()),
        column("effect", &rows, |_: &Row| effect.to_owned()),
        number("estimate", &|of| of.effect.map(|Estimate { mean, .. }| mean)),
        number("low", &|of| interval(of).map(|Interval { low, .. }| low)),
        number("high", &|of| interval(of).map(|Interval { high, .. }| high)),
        number("p", &|of| of.p_value),
        number("p_holm", &|of| of.adjusted),
        count("pairs", &|of| of.pairs),
        count("maps", &|of| of.maps),
        column("blocks", &rows, |(_, verdict): &Row| verdict.blocks as u64),
        failed("failed_a", 0),
        failed("failed_b", 1),
        count("reached_a", &|of| of.reached[0]),
        count("reached_b", &|of| of.reached[1]),
        number("mean_a", &|of| mean(of.mean_a)),
        number("mean_b", &|of| mean(of.mean_b)),
        number("a12", &|of| Some(of.a12)),
        column("verdict", &rows, |(_, verdict): &Row| verdict.sentence.clone()),
        column("second", &rows, |(_, verdict): &Row| verdict.second.clone()),
    ];
    Ok(Table { columns: columns.into_iter().flatten().collect() })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::super::fixture;
    use super::*;
    use experiments::columns::Values;
    use experiments::rows::{RunMetadata, StoredRun};
    use simulation::end_reason::EndReason;

    /// Of each block the area under the explored share of `a`; `None`: it has failed.
    fn table_of(areas: &[Option<f64>]) -> BTreeMap<String, Values> {
        let mut runs = Vec::new();
        for (block, &area) in areas.iter().enumerate() {
            for (name, area) in [("a", area), ("b", Some(0.5 + block as f64 / 100.0))] {
                let mut run = fixture::run(name, block as u64, 2);
                run.row.axes = BTreeMap::from([("agents.controller".to_owned(), name.to_owned())]);
                run.row.area_under_explored = area.unwrap_or(0.0);
                if area.is_none() {
                    run.row.reason = EndReason::Failed("it was lost".to_owned());
                }
                runs.push(StoredRun::new(run, RunMetadata { date: None, map: Some(block.to_string()) }));
            }
        }
        let table = table(&Study::new(runs, None)).expect("finite metrics");
        table.columns.into_iter().map(|column| (column.name, column.values)).collect()
    }

    #[test]
    fn numbers_are_those_of_the_sentence() {
        let areas: Vec<Option<f64>> = (0..8).map(|block| Some(0.75 + 0.005 * f64::from(block % 3))).collect();
        let table = table_of(&areas);
        let number = |name: &str| match &table[name] {
            Values::Number(values) => values[0],
            other => panic!("{name}: {other:?}"),
        };
        let Values::Text(words) = &table["verdict"] else { panic!("words are text") };
        let words = words[0].as_deref().expect("a sentence");
        let [estimate, low, high] = ["estimate", "low", "high"].map(|name| number(name).expect("an interval"));
        let gains = [low, high].map(|end| format!("{:.0}", 100.0 * (1.0 - end)));
        let said = format!("{:.0} % sooner on average [{}, {}]", 100.0 * (1.0 - estimate), gains[1], gains[0]);
        assert!(words.starts_with("a is ahead of b") && words.contains(&said), "{said}\n{words}");
        let p = number("p_holm").expect("a test");
        assert!(words.contains(&format!("p = {p:.3}")) && number("p") == number("p_holm"), "{words}");
        let mean_a = number("mean_a").expect("a mean");
        assert!((60.0 * 0.24..60.0 * 0.25).contains(&mean_a), "seconds until a cell is seen: {mean_a}");
        for (name, expected) in [("pairs", 8), ("maps", 8), ("blocks", 8), ("failed_a", 0), ("failed_b", 0)] {
            assert_eq!(table[name], Values::Whole(vec![Some(expected)]), "{name}");
        }
        for (name, expected) in [("a", "a"), ("b", "b"), ("measure", "area"), ("effect", "ratio")] {
            assert_eq!(table[name], Values::Text(vec![Some(expected.to_owned())]), "{name}");
        }
    }

    #[test]
    fn failures_are_counted_and_one_variant_has_no_rows() {
        let table = table_of(&[Some(0.9), None, Some(0.9), None]);
        assert_eq!(table["failed_a"], Values::Whole(vec![Some(2)]));
        assert_eq!((&table["pairs"], &table["p"]), (&Values::Whole(vec![Some(4)]), &Values::Number(vec![None])));
        let alone = Study::new(vec![StoredRun::new(fixture::run("a", 1, 2), RunMetadata::default())], None);
        assert_eq!(super::table(&alone).expect("finite metrics").columns[0].values, Values::Text(Vec::new()));
    }
}
