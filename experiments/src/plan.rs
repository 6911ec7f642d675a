//! Plans: a TOML file with a base scenario, the axes that vary it, and seeds; and its expansion.
//!
//! Every combination of axis values is run with the same seeds, so that runs can be compared map by
//! map. Runs are ordered by seed, and within a seed the most expensive comes first: a plan that is
//! executed in part is comparable, and cores stay busy to the end.
//!
//! Invariant: the scenarios of a [`Plan`] are valid and its controllers known; only map generation
//! can still fail. This module runs nothing.

mod read;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use agent_node::controllers;
use sim_server::input_file::{self, TEXT_BYTES_MAX};
use sim_server::map_file;
use simulation::scenario::{MapKind, Override, Scenario, ScenarioError, one_line};
use simulation::wire;
use thiserror::Error;

pub use read::SEEDS_EXPECTED;

/// Maximum number of runs of a plan.
pub const RUNS_MAX: usize = 1_000_000;

/// Keys of the scenario that cannot be an axis, with the reason.
const FIXED: [(&str, &str); 2] = [
    ("seed", "is given by `seeds`"),
    ("execution", "cannot change a result; it is given in the base scenario or by the command line"),
];

/// The build id: the version, and a hash of the sources that determine the result of a run.
pub const BUILD: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("MAES_BUILD"));

#[derive(Debug, Error)]
pub enum PlanError {
    #[error("{file}: {source}")]
    Read { file: String, source: std::io::Error },
    #[error("{file}:{line}: {reason}")]
    Line {
        file: String,
        /// Counted from 1.
        line: usize,
        /// Names the key, the mistake and the allowed values.
        reason: String,
    },
    /// The base scenario, or a combination, is invalid.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
}

/// A key of the scenario, and the values that it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Dotted path of the key.
    pub key: String,
    pub values: Vec<AxisValue>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct AxisValue {
    pub value: toml::Value,
    /// Line of the plan, counted from 1.
    pub line: usize,
}

impl AxisValue {
    /// The value as text; a string is not quoted.
    #[must_use]
    pub fn text(&self) -> String {
        self.value.as_str().map_or_else(|| self.value.to_string(), str::to_owned)
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct PlannedRun {
    /// First 16 hexadecimal digits of the blake3 hash of the scenario, its map file if it has one,
    /// and the build.
    pub id: String,
    /// Key and value, as text, of every axis.
    pub axes: BTreeMap<String, String>,
    pub scenario: Scenario,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The plan as a self-contained file: it includes the base scenario.
    pub text: String,
    /// In the order of the file.
    pub axes: Vec<Axis>,
    /// In the order of the file.
    pub seeds: Vec<u64>,
    /// In the order of execution.
    pub runs: Vec<PlannedRun>,
}

impl Plan {
    /// Reads a plan and the scenario it is based on.
    ///
    /// # Errors
    /// If a file cannot be read, or the plan or one of its runs is invalid.
    pub fn load(file: &Path) -> Result<Self, PlanError> {
        let name = file.display().to_string();
        let text = input_file::read_text(file, TEXT_BYTES_MAX)
            .map_err(|source| PlanError::Read { file: name.clone(), source })?;
        Self::parse(&name, &text, file.parent().unwrap_or(Path::new("")))
    }

    /// Parses a plan. The path of its base scenario is relative to `folder`; `file` is the name for
    /// error messages.
    ///
    /// # Errors
    /// See [`Plan::load`].
    pub fn parse(file: &str, text: &str, folder: &Path) -> Result<Self, PlanError> {
        Self::expand(file, text, folder).map_err(|error| match error {
            PlanError::Line { file, line, reason } => PlanError::Line { file, line, reason: one_line(&reason) },
            other => other,
        })
    }

    fn expand(file: &str, text: &str, folder: &Path) -> Result<Self, PlanError> {
        let draft = read::read(file, text, folder)?;
        for axis in &draft.axes {
            let line = axis.values[0].line;
            let fixed = FIXED.iter().find(|(table, _)| axis.key.split('.').next() == Some(table));
            if let Some((table, why)) = fixed {
                let reason = format!("axes.\"{}\": `{table}` {why}; any other key of a scenario is allowed", axis.key);
                return Err(PlanError::Line { file: file.to_owned(), line, reason });
            }
        }
        let mut runs = Vec::new();
        let mut ids = BTreeSet::new();
        for &seed in &draft.seeds {
            let mut of_seed = Vec::new();
            for choice in combinations(&draft.axes) {
                let run = planned_run(file, &draft, &choice, seed)?;
                if !ids.insert(run.id.clone()) {
                    let line = choice.first().map_or(1, |(_, value)| value.line);
                    let reason = format!("axes: two combinations are the same run, one of them {:?}", run.axes);
                    return Err(PlanError::Line { file: file.to_owned(), line, reason });
                }
                of_seed.push(run);
            }
            of_seed.sort_by_key(|run| std::cmp::Reverse(cost(&run.scenario)));
            runs.extend(of_seed);
        }
        let read::Draft { text, axes, seeds, .. } = draft;
        Ok(Self { text, axes, seeds, runs })
    }
}

/// Estimated cost of a run, without unit: used for ordering and for remaining time, never for a
/// result.
#[must_use]
pub fn cost(scenario: &Scenario) -> u64 {
    let cells = scenario.map.size.map_or(1, |size| size.cells().into_iter().map(u64::from).product::<u64>());
    u64::from(scenario.agents.count).saturating_mul(cells)
}

type Choice<'a> = Vec<(&'a str, &'a AxisValue)>;

/// The product of all axes; the last axis varies fastest.
fn combinations(axes: &[Axis]) -> Vec<Choice<'_>> {
    let mut choices = vec![Vec::new()];
    for axis in axes {
        let values = |choice| axis.values.iter().map(move |value| with(&choice, &axis.key, value));
        choices = choices.into_iter().flat_map(values).collect();
    }
    choices
}

fn with<'a>(choice: &Choice<'a>, key: &'a str, value: &'a AxisValue) -> Choice<'a> {
    choice.iter().copied().chain([(key, value)]).collect()
}

fn planned_run(file: &str, draft: &read::Draft, choice: &Choice<'_>, seed: u64) -> Result<PlannedRun, PlanError> {
    let mut overrides: Vec<Override> = choice
        .iter()
        .map(|(key, value)| Override {
            origin: format!("{file}:{}: axes.\"{key}\" = {}", value.line, value.value),
            key: (*key).to_owned(),
            value: Some(value.value.clone()),
        })
        .collect();
    let seed = i64::try_from(seed).expect("seeds of a plan are within the integers of TOML");
    overrides.push(Override { origin: format!("{file}: seeds"), key: "seed".to_owned(), value: Some(seed.into()) });
    // An error about a value names the line of its axis.
    let line_of = |key: &str| {
        let of_axis = |axis: &str| key == axis || key.starts_with(&format!("{axis}."));
        choice.iter().find(|(axis, _)| of_axis(axis)).map_or(draft.scenario_line, |(_, value)| value.line)
    };
    let line_error = |key: &str, reason| PlanError::Line { file: file.to_owned(), line: line_of(key), reason };
    let scenario =
        Scenario::parse(&draft.scenario_name, &draft.scenario_text, &overrides).map_err(|error| match error {
            ScenarioError::Value { key, value, allowed, .. } => line_error(&key, format!("{key} = {value}: {allowed}")),
            other => other.into(),
        })?;
    let settings = wire::settings(&scenario.agents);
    controllers::check(&scenario.agents.controller, &settings)
        .map_err(|error| line_error("agents.controller", format!("agents.controller: {error}")))?;
    let id = id(&scenario).map_err(|source| {
        line_error(
            "map.file",
            format!("map.file = {:?}: {source}", scenario.map.file.as_deref().unwrap_or(Path::new(""))),
        )
    })?;
    let axes = choice.iter().map(|(key, value)| ((*key).to_owned(), value.text())).collect();
    Ok(PlannedRun { id, axes, scenario })
}

/// See [`PlannedRun::id`].
fn id(scenario: &Scenario) -> std::io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update(scenario.identity().as_bytes()).update(&[0]).update(BUILD.as_bytes());
    if let (MapKind::File, Some(map)) = (scenario.map.kind, &scenario.map.file) {
        let map = map_file::load(map)?;
        hasher.update(&[0]).update(&map.bytes);
        if let Some(image) = &map.companion {
            hasher.update(&[0]).update(image);
        }
    }
    Ok(hasher.finalize().to_hex()[..16].to_owned())
}

#[cfg(test)]
mod tests;
