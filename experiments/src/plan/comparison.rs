//! What a plan compares: the variants, the measure that decides, and how many pairs that takes.

use std::collections::{BTreeMap, BTreeSet};

use super::{MAP_FILE, Plan, VARIANT};

/// The key of the controller.
pub const CONTROLLER: &str = "agents.controller";

/// Probability of a false difference among the comparisons of a panel.
pub const ALPHA: f64 = 0.05;

/// The measure that the verdicts of a plan are about. It is chosen before the data are there, so
/// that these cannot choose the one that shows most; the others are secondary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Measure {
    /// Area under the explored share, restricted to the duration.
    #[default]
    Area,
    /// Time to 90 % of the free cells, restricted to the duration.
    Time90,
    /// Time to 99 %, likewise.
    Time99,
    /// Time to 100 %, likewise.
    Time100,
    /// Explored share at the end.
    Explored,
    /// Path length of the team.
    Distance,
}

impl Measure {
    /// All, with their names in a plan.
    pub const ALL: [(&str, Self); 6] = [
        ("area", Self::Area),
        ("time-90", Self::Time90),
        ("time-99", Self::Time99),
        ("time-100", Self::Time100),
        ("explored", Self::Explored),
        ("distance", Self::Distance),
    ];

    /// The measure with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(known, _)| *known == name).map(|(_, measure)| *measure)
    }

    /// The allowed names, for error messages.
    pub(super) fn expected() -> String {
        let names: Vec<String> = Self::ALL.iter().map(|(name, _)| format!("{name:?}")).collect();
        format!("expected one of {}", names.join(", "))
    }
}

/// The keys whose values are compared, given the axes and the controller of each run: controllers,
/// if a plan that does not say varies them; else the only axis that it varies beside maps and team
/// sizes.
#[must_use]
pub fn compared_by_default(runs: &[(&BTreeMap<String, String>, &str)]) -> Vec<String> {
    let keys: BTreeSet<&String> = runs.iter().flat_map(|(axes, _)| axes.keys()).collect();
    if keys.contains(&VARIANT.to_owned()) {
        return vec![VARIANT.to_owned()];
    }
    let varies = |key: &str| runs.iter().map(|run| value(*run, key)).collect::<BTreeSet<_>>().len() > 1;
    let is_table = |key: &str| runs.iter().filter_map(|(axes, _)| axes.get(key)).any(|value| value.starts_with('{'));
    let is_background = |key: &str| key == "agents.count" || key == MAP_FILE || key == "map" || key.starts_with("map.");
    let candidates: Vec<&String> = keys.into_iter().filter(|key| varies(key) && !is_background(key)).collect();
    match candidates.as_slice() {
        [key] if !varies(CONTROLLER) || is_table(key) => vec![(*key).clone()],
        _ => vec![CONTROLLER.to_owned()],
    }
}

/// The value of a key in a run with these axes and this controller; `None` if it has none.
#[must_use]
pub fn value<'a>((axes, controller): (&'a BTreeMap<String, String>, &'a str), key: &str) -> Option<&'a str> {
    match axes.get(key) {
        Some(value) => Some(value),
        None if key == CONTROLLER => Some(controller),
        None => None,
    }
}

impl Plan {
    /// That the plan has too few blocks to show any difference between its variants, and how many
    /// it needs; `None` if it has enough, or compares nothing.
    #[must_use]
    pub fn too_few_blocks(&self) -> Option<String> {
        let controllers: Vec<String> = self.runs.iter().map(|run| run.scenario.controllers_label()).collect();
        let runs: Vec<_> = self.runs.iter().zip(&controllers).map(|(run, label)| (&run.axes, label.as_str())).collect();
        let keys = if self.compare.is_empty() { compared_by_default(&runs) } else { self.compare.clone() };
        let of_run = |run: &(_, _)| keys.iter().map(|key| value(*run, key)).collect::<Vec<_>>();
        let variants = runs.iter().map(of_run).collect::<BTreeSet<_>>().len();
        let blocks: BTreeSet<_> = self.runs.iter().map(|run| (run.scenario.seed, run.axes.get(MAP_FILE))).collect();
        let comparisons = variants * variants.saturating_sub(1) / 2;
        let needed = statistics::pairs_needed(comparisons, ALPHA);
        if comparisons == 0 || blocks.len() >= needed {
            return None;
        }
        let has_files = self.runs.iter().any(|run| run.axes.contains_key(MAP_FILE));
        let what = if has_files { "combinations of seed and map file" } else { "seeds" };
        let plural = if comparisons == 1 { "comparison" } else { "comparisons" };
        Some(format!(
            "{variants} variants need at least {needed} {what}, and the plan has {}: with fewer, no difference can be \
             shown at {} % after the correction for {comparisons} {plural}",
            blocks.len(),
            100.0 * ALPHA
        ))
    }
}
