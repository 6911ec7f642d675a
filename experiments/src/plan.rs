//! Plans: a TOML file with a base scenario, the axes that vary it, and seeds; and its expansion.
//!
//! Every combination of axis values is run with the same seeds, so that runs can be compared map by
//! map. Runs are ordered by seed, and within a seed the most expensive comes first: a plan that is
//! executed in part is comparable, and cores stay busy to the end.
//!
//! Invariant: the scenarios of a [`Plan`] are valid and its controllers known; only map generation
//! can still fail. This module runs nothing.

mod files;
mod read;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use agent_node::controllers;
use sim_server::input_file::{self, TEXT_BYTES_MAX};
use simulation::scenario::{Override, Scenario, ScenarioError, one_line};
use simulation::wire;
use thiserror::Error;

use files::{Files, RunFiles, Unreadable};

pub use files::Inputs;
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
    /// First 16 hexadecimal digits of the blake3 hash of the scenario, the build, and the contents
    /// of the files that it names.
    pub id: String,
    /// Key and value, as text, of every axis.
    pub axes: BTreeMap<String, String>,
    pub scenario: Scenario,
    /// What its relative paths start from; empty: the present folder, or it has none.
    pub folder: PathBuf,
    /// Estimated cost, without unit: used for ordering, for parts and for remaining time, never for
    /// a result.
    pub cost: u64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The plan as a self-contained file: it includes the base scenario, and reads copies of
    /// `inputs`.
    pub text: String,
    /// The files that it reads.
    pub inputs: Inputs,
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

    /// Parses a plan. Its paths are relative to `folder`; `file` is the name for error messages.
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
        let mut files = Files::from(draft.folder.as_ref().map_or(folder.to_owned(), |copies| folder.join(copies)));
        let mut runs = Vec::new();
        let mut ids = BTreeSet::new();
        for &seed in &draft.seeds {
            let mut of_seed = Vec::new();
            for choice in combinations(&draft.axes) {
                let run = planned_run(file, &draft, &mut files, &choice, seed)?;
                if !ids.insert(run.id.clone()) {
                    let line = choice.first().map_or(1, |(_, value)| value.line);
                    let reason = format!("axes: two combinations are the same run, one of them {:?}", run.axes);
                    return Err(PlanError::Line { file: file.to_owned(), line, reason });
                }
                of_seed.push(run);
            }
            of_seed.sort_by_key(|run| std::cmp::Reverse(run.cost));
            runs.extend(of_seed);
        }
        let read::Draft { text, axes, seeds, folder: copies, .. } = draft;
        let is_copy = copies.is_some();
        let inputs = files.into_inputs(copies);
        let text = if is_copy { text } else { inputs.line() + &text };
        Ok(Self { text, inputs, axes, seeds, runs })
    }
}

/// See [`PlannedRun::cost`].
fn cost(scenario: &Scenario, files: &RunFiles) -> u64 {
    let generated = scenario.map.size.map(|size| size.cells().into_iter().map(u64::from).product::<u64>());
    u64::from(scenario.agents.count).saturating_mul(generated.or(files.map_cells).unwrap_or(1))
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

fn planned_run(
    file: &str,
    draft: &read::Draft,
    files: &mut Files,
    choice: &Choice<'_>,
    seed: u64,
) -> Result<PlannedRun, PlanError> {
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
    let mut scenario =
        Scenario::parse(&draft.scenario_name, &draft.scenario_text, &overrides).map_err(|error| match error {
            ScenarioError::Value { key, value, allowed, .. } => line_error(&key, format!("{key} = {value}: {allowed}")),
            other => other.into(),
        })?;
    let settings = wire::settings(&scenario.agents);
    // Those of a program of the user are checked before it is run.
    if scenario.agents.has_built_in() {
        controllers::check(&scenario.agents.controller, &settings)
            .map_err(|error| line_error("agents.controller", format!("agents.controller: {error}")))?;
    }
    let of_run = files
        .of(&scenario)
        .map_err(|Unreadable { key, path, source }| line_error(key, format!("{key} = {path:?}: {source}")))?;
    let (id, cost) = (id(&scenario, &of_run), cost(&scenario, &of_run));
    let mut folder = PathBuf::new();
    if scenario.map.file.is_some() || !scenario.agents.command.is_empty() {
        files.folder().clone_into(&mut folder);
        scenario.map.folder.clone_from(&folder);
    }
    let axes = choice.iter().map(|(key, value)| ((*key).to_owned(), value.text())).collect();
    Ok(PlannedRun { id, axes, scenario, folder, cost })
}

/// See [`PlannedRun::id`].
fn id(scenario: &Scenario, files: &RunFiles) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(scenario.identity().as_bytes()).update(&[0]).update(BUILD.as_bytes());
    for hash in &files.hashes {
        hasher.update(&[0]).update(hash.as_bytes());
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

#[cfg(test)]
mod tests;
