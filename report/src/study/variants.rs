//! What a study compares, and the names of the variants.

use std::collections::{BTreeMap, BTreeSet};

use super::super::design::{Design, in_brackets, short_table};
use super::Value;
use experiments::plan::{CONTROLLER, VARIANT, compared_by_default, value};
use experiments::rows::{RunRecord, RunRow};

/// The variants of a study.
pub(super) struct Variants {
    /// See [`super::Study::compare`].
    pub(super) compare: Vec<String>,
    /// See [`super::Study::variant_title`].
    pub(super) title: String,
    /// See [`super::Study::variants`].
    pub(super) names: Vec<String>,
    /// The variant of each run, as an index of `names`.
    pub(super) of_run: Vec<usize>,
}

impl Variants {
    pub(super) fn of(runs: &[RunRecord], design: &Design) -> Self {
        let compare = compared(runs, design);
        let is_said = !design.compare().is_empty();
        let mut variants: BTreeSet<(Vec<(usize, Value)>, String)> = BTreeSet::new();
        let mut of_run = Vec::new();
        for run in runs {
            // Values in the order of the plan, if it says what it compares; else by value.
            let place = |key: &String, value: &str| if is_said { design.place(key, value) } else { usize::MAX };
            let values = compare.iter().map(|key| {
                let value = value(known(&run.row), key).unwrap_or_default();
                (place(key, value), Value(value.to_owned()))
            });
            let variant = (values.collect::<Vec<_>>(), name(&run.row, &compare, runs));
            variants.insert(variant.clone());
            of_run.push(variant);
        }
        let variants: Vec<_> = variants.into_iter().collect();
        let place = |variant| variants.iter().position(|listed| *listed == variant).unwrap_or_default();
        let of_run = of_run.into_iter().map(place).collect();
        let title = match compare.as_slice() {
            [key] if key == CONTROLLER => "controller".to_owned(),
            [key] if !is_table(runs, key) && key != VARIANT => short_key(key).to_owned(),
            _ => VARIANT.to_owned(),
        };
        Self { compare, title, names: variants.into_iter().map(|(_, name)| name).collect(), of_run }
    }
}

/// What a plan compares: what it says, or by default.
fn compared(runs: &[RunRecord], design: &Design) -> Vec<String> {
    let said = design.compare();
    if said.is_empty() {
        compared_by_default(&runs.iter().map(|run| known(&run.row)).collect::<Vec<_>>())
    } else {
        said
    }
}

/// What the value of a key is looked up in.
fn known(row: &RunRow) -> (&BTreeMap<String, String>, &str) {
    (&row.axes, &row.controller)
}

/// The name of the variant of a run.
fn name(row: &RunRow, compare: &[String], runs: &[RunRecord]) -> String {
    let part = |key: &String| {
        let value = value(known(row), key)?;
        if key == CONTROLLER || key == VARIANT {
            return Some(value.to_owned());
        }
        let all: BTreeSet<&str> = runs.iter().filter_map(|run| run.row.axes.get(key)).map(String::as_str).collect();
        let table = short_table(value, &all.into_iter().collect::<Vec<_>>());
        Some(table.unwrap_or_else(|| format!("{} = {value}", short_key(key))))
    };
    let parts: Vec<String> = compare.iter().filter_map(part).collect();
    in_brackets(&parts)
}

fn is_table(runs: &[RunRecord], key: &str) -> bool {
    runs.iter().filter_map(|run| run.row.axes.get(key)).any(|value| value.starts_with('{'))
}

/// The last part of a dotted key.
fn short_key(key: &str) -> &str {
    key.rsplit('.').next().unwrap_or(key)
}
