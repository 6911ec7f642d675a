//! What a study compares, and the names of the variants.

use std::collections::BTreeSet;

use super::super::design::{Design, in_brackets, short_table};
use super::Value;
use experiments::plan::{MAP_FILE, VARIANT};
use experiments::rows::{RunRecord, RunRow};

/// The key of the controller.
pub(super) const CONTROLLER: &str = "agents.controller";

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
                let value = value(&run.row, key).unwrap_or_default();
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

/// What a plan compares: what it says; else controllers, if it varies them; else the only axis that
/// it varies beside maps and team sizes.
fn compared(runs: &[RunRecord], design: &Design) -> Vec<String> {
    let said = design.compare();
    if !said.is_empty() {
        return said;
    }
    let keys: BTreeSet<&String> = runs.iter().flat_map(|run| run.row.axes.keys()).collect();
    if keys.contains(&VARIANT.to_owned()) {
        return vec![VARIANT.to_owned()];
    }
    let varies = |key: &str| runs.iter().map(|run| value(&run.row, key)).collect::<BTreeSet<_>>().len() > 1;
    let is_background = |key: &str| key == "agents.count" || key == MAP_FILE || key == "map" || key.starts_with("map.");
    let candidates: Vec<&String> = keys.into_iter().filter(|key| varies(key) && !is_background(key)).collect();
    match candidates.as_slice() {
        [key] if !varies(CONTROLLER) || is_table(runs, key) => vec![(*key).clone()],
        _ => vec![CONTROLLER.to_owned()],
    }
}

/// The value of a key; `None` if the run does not have it.
fn value<'a>(row: &'a RunRow, key: &str) -> Option<&'a str> {
    match row.axes.get(key) {
        Some(value) => Some(value),
        None if key == CONTROLLER => Some(&row.controller),
        None => None,
    }
}

/// The name of the variant of a run.
fn name(row: &RunRow, compare: &[String], runs: &[RunRecord]) -> String {
    let part = |key: &String| {
        let value = value(row, key)?;
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
