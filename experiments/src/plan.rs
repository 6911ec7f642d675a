//! Plans: a TOML file with a base scenario, the variants and axes that vary it, and seeds; and its
//! expansion.
//!
//! Every combination of variants and axis values is run with the same blocks, which are seeds and
//! map files, so that runs can be compared map by map. Runs are ordered by block, and within a
//! block the most expensive comes first: a plan that is executed in part is comparable, and cores
//! stay busy to the end.
//!
//! Invariant: the scenarios of a [`Plan`] are valid and its controllers known; only map generation
//! can still fail. This module runs nothing.

mod comparison;
mod dimensions;
mod files;
mod maps;
mod read;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use agent_node::controllers::Registry;
use sim_server::setup;
use simulation::scenario::{Override, Scenario, ScenarioError, one_line};
use simulation::wire;
use system::input_file::{self, TEXT_BYTES_MAX};
use thiserror::Error;

use dimensions::{Change, Choice, combinations};
use files::{Files, RunFiles, Unreadable};
use maps::MapFile;
use read::Fork;

pub use comparison::{ALPHA, CONTROLLER, Measure, compared_by_default, value};
pub use files::Inputs;
pub(crate) use files::{FOLDER, copy};
pub use read::SEEDS_EXPECTED;

/// Maximum number of runs of a plan.
pub const RUNS_MAX: usize = 1_000_000;

/// The key of [`PlannedRun::axes`] with the name of the variant.
pub const VARIANT: &str = dimensions::VARIANT;

/// The key of [`PlannedRun::axes`] with the name of the map file, if `maps` names several.
pub const MAP_FILE: &str = "map.file";

/// The key of [`PlannedRun::axes`] with the time of a fork, in seconds, if the plan has `[fork]`.
pub const FORK: &str = "fork.at_s";

/// Keys of the scenario that cannot be varied, with the reason.
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

/// A named set of keys of the scenario, which is compared with the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    pub name: String,
    /// Line of the plan, counted from 1.
    pub line: usize,
    changes: Vec<Change>,
}

/// The controllers that runs may name.
#[derive(Debug, Clone, Copy)]
pub struct KnownControllers<'a> {
    pub registry: Registry,
    /// The versions of those that the build does not determine, by name; `None` if one has none.
    pub versions: &'a BTreeMap<String, Option<String>>,
}

impl<'a> KnownControllers<'a> {
    /// The controllers of the build.
    pub const BUILT_IN: KnownControllers<'static> =
        KnownControllers { registry: Registry::BUILT_IN, versions: &BTreeMap::new() };

    /// The versions of the controllers of a run: those of all agents, at any time.
    fn versions_in(&self, scenario: &Scenario) -> BTreeMap<&'a str, Option<&'a str>> {
        let phases = scenario.phases();
        let choices = phases.iter().flat_map(|phase| phase.agents.controllers_of(|_| true));
        let found = choices.filter_map(|choice| self.versions.get_key_value(choice.controller));
        found.map(|(name, version)| (name.as_str(), version.as_deref())).collect()
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct PlannedRun {
    /// First 16 hexadecimal digits of the blake3 hash of the scenario, the build, the contents of
    /// the files that it names, and the versions of controllers that are not of the build.
    pub id: String,
    /// Whether every controller is of the build, or has a version. A record of another run is
    /// replaced by the next execution, since nothing says that it is of the same code.
    pub is_versioned: bool,
    /// Key and value, as text, of every axis; also [`VARIANT`] and [`MAP_FILE`], if the plan has
    /// them.
    pub axes: BTreeMap<String, String>,
    /// Identifies the map: first 16 hexadecimal digits of the blake3 hash of all that it is made
    /// of. Runs of equal `map` are on the same map.
    pub map: String,
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
    /// The keys whose values are compared: axes, or [`VARIANT`]. Empty if the plan does not say.
    pub compare: Vec<String>,
    /// What verdicts are about.
    pub primary: Measure,
    /// In the order of the file.
    pub variants: Vec<Variant>,
    /// In the order of the file.
    pub axes: Vec<Axis>,
    /// In the order of the file.
    pub seeds: Vec<u64>,
    /// Whether the records say how fast a team with the map in hand could be ([`crate::oracle`]).
    pub oracle: bool,
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

    /// A plan of one run, with the paths of the scenario relative to the present folder.
    ///
    /// # Errors
    /// If a file cannot be read that the scenario names.
    pub fn run_of(scenario: Scenario, known: KnownControllers<'_>) -> Result<PlannedRun, PlanError> {
        let mut files = Files::from(scenario.map.folder.clone());
        let of_run = files
            .of(&scenario)
            .map_err(|Unreadable { path, source, .. }| PlanError::Read { file: path.display().to_string(), source })?;
        let versions = known.versions_in(&scenario);
        Ok(PlannedRun {
            id: id(&scenario, &of_run, &versions),
            is_versioned: versions.values().all(Option::is_some),
            axes: BTreeMap::new(),
            map: map_id(&scenario, &of_run),
            folder: PathBuf::new(),
            cost: cost(&scenario, &of_run),
            scenario,
        })
    }

    /// Parses a plan. Its paths are relative to `folder`; `file` is the name for error messages.
    ///
    /// # Errors
    /// See [`Plan::load`].
    pub fn parse(file: &str, text: &str, folder: &Path) -> Result<Self, PlanError> {
        Self::parse_with(file, text, folder, KnownControllers::BUILT_IN)
    }

    /// [`Plan::parse`] with further controllers.
    ///
    /// # Errors
    /// See [`Plan::load`].
    pub fn parse_with(file: &str, text: &str, folder: &Path, known: KnownControllers<'_>) -> Result<Self, PlanError> {
        Self::expand(file, text, folder, known).map_err(|error| match error {
            PlanError::Line { file, line, reason } => PlanError::Line { file, line, reason: one_line(&reason) },
            other => other,
        })
    }

    fn expand(file: &str, text: &str, folder: &Path, known: KnownControllers<'_>) -> Result<Self, PlanError> {
        let draft = read::read(file, text, folder)?;
        let of_axes = draft.axes.iter().map(|axis| (format!("axes.\"{}\"", axis.key), &axis.key, axis.values[0].line));
        let of_variants = draft.variants.iter().flat_map(|variant| {
            let name = move |change: &Change| format!("variant {:?}: {}", variant.name, change.key);
            variant.changes.iter().map(move |change| (name(change), &change.key, change.line))
        });
        for (name, key, line) in of_axes.chain(of_variants) {
            if let Some((table, why)) = FIXED.iter().find(|(table, _)| key.split('.').next() == Some(table)) {
                let reason = format!("{name}: `{table}` {why}; any other key of a scenario is allowed");
                return Err(PlanError::Line { file: file.to_owned(), line, reason });
            }
        }
        let mut files = Files::from(draft.folder.as_ref().map_or(folder.to_owned(), |copies| folder.join(copies)));
        let choices = combinations(file, &draft.variants, &draft.axes, &draft.base);
        let blocks: Vec<Option<&MapFile>> =
            if draft.maps.is_empty() { vec![None] } else { draft.maps.iter().map(Some).collect() };
        let mut runs = Vec::new();
        let mut ids = BTreeSet::new();
        for &seed in &draft.seeds {
            for map in &blocks {
                let mut of_block = Vec::new();
                for choice in &choices {
                    let choice = match map {
                        Some(map) => choice.with(MAP_FILE, map.name.clone(), [draft.map_change(file, map)]),
                        None => choice.clone(),
                    };
                    let forks: Vec<Option<&Fork>> =
                        if draft.forks.is_empty() { vec![None] } else { draft.forks.iter().map(Some).collect() };
                    for fork in forks {
                        let run = planned_run((file, known), &draft, &mut files, &choice, fork, seed)?;
                        if !ids.insert(run.id.clone()) {
                            // Without a change there is nothing to fork: one run for all times.
                            if fork.is_some() && !run.axes.contains_key(FORK) {
                                continue;
                            }
                            let line = choice.changes.first().map_or(1, |change| change.line);
                            let reason = format!("axes: two combinations are the same run, one of them {:?}", run.axes);
                            return Err(PlanError::Line { file: file.to_owned(), line, reason });
                        }
                        of_block.push(run);
                    }
                }
                of_block.sort_by_key(|run| std::cmp::Reverse(run.cost));
                runs.extend(of_block);
            }
        }
        let read::Draft { text, compare, primary, variants, axes, seeds, oracle, folder: copies, .. } = draft;
        let is_copy = copies.is_some();
        let inputs = files.into_inputs(copies);
        let text = if is_copy { text } else { inputs.line() + &text };
        Ok(Self { text, inputs, compare, primary, variants, axes, seeds, oracle, runs })
    }
}

/// See [`PlannedRun::cost`].
fn cost(scenario: &Scenario, files: &RunFiles) -> u64 {
    let generated = scenario.map.size.map(|size| size.cells().into_iter().map(u64::from).product::<u64>());
    u64::from(scenario.agents.count).saturating_mul(generated.or(files.map_cells).unwrap_or(1))
}

/// The run of a combination, in which the map file is set if the plan names some, with a seed. With
/// a fork, what is compared holds from then on.
fn planned_run(
    (file, known): (&str, KnownControllers<'_>),
    draft: &read::Draft,
    files: &mut Files,
    choice: &Choice,
    fork: Option<&Fork>,
    seed: u64,
) -> Result<PlannedRun, PlanError> {
    // Another controller in a fork has its default settings: none of the base has to be removed.
    let (forked, at_start): (Vec<&Change>, Vec<&Change>) = choice
        .changes
        .iter()
        .filter(|change| fork.is_none() || change.value.is_some())
        .partition(|change| fork.is_some() && draft.is_compared(change));
    let mut overrides: Vec<Override> = at_start.into_iter().map(Change::to_override).collect();
    let seed = i64::try_from(seed).expect("seeds of a plan are within the integers of TOML");
    overrides.push(Override { origin: format!("{file}: seeds"), key: "seed".to_owned(), value: Some(seed.into()) });
    // An error about a value names the line that has set it, or something in its table.
    let line_of = |key: &str| {
        let is_in = |one: &str, table: &str| one == table || one.starts_with(&format!("{table}."));
        let has_set = |set: &str| is_in(key, set) || is_in(set, key);
        let change = choice.changes.iter().rev().find(|change| has_set(&change.key));
        change.map_or(draft.scenario_line, |change| change.line)
    };
    let line_error = |key: &str, reason| PlanError::Line { file: file.to_owned(), line: line_of(key), reason };
    let mut scenario =
        Scenario::parse(&draft.scenario_name, &draft.scenario_text, &overrides).map_err(|error| match error {
            ScenarioError::Value { key, value, allowed, .. } => line_error(&key, format!("{key} = {value}: {allowed}")),
            other => other.into(),
        })?;
    let mut axes = choice.labels.clone();
    if let Some(fork) = fork {
        let changes: Vec<Override> = forked.into_iter().map(Change::to_override).collect();
        let forked = scenario.fork(fork.tick, "", &changes).map_err(|error| match error {
            ScenarioError::Override { origin, reason } => {
                PlanError::Line { file: file.to_owned(), line: fork.line, reason: format!("fork: {origin}: {reason}") }
            }
            other => line_error("event", format!("fork: {other}")),
        })?;
        if forked != scenario {
            axes.insert(FORK.to_owned(), fork.at_s.to_string());
        }
        scenario = forked;
    }
    // Those of a program of the user are checked before it is run.
    for agents in scenario.phases().iter().map(|phase| &phase.agents) {
        for choice in agents.controllers_of(|agent| agents.is_built_in(agent)) {
            let is_of_mix = agents.mix.iter().any(|entry| std::ptr::eq(&entry.set, choice.set));
            let key = if is_of_mix { "agents.mix" } else { "agents.controller" };
            known
                .registry
                .check(choice.controller, &wire::settings(choice.set))
                .map_err(|error| line_error(key, format!("{key}: {error}")))?;
        }
    }
    let of_run = files
        .of(&scenario)
        .map_err(|Unreadable { key, path, source }| line_error(key, format!("{key} = {path:?}: {source}")))?;
    // What can never become a map is a fault of the plan, and no failure of a controller.
    if scenario.map.file.is_none() {
        setup::check_map(&scenario).map_err(|error| line_error("map", error.to_string()))?;
    }
    let map = map_id(&scenario, &of_run);
    let versions = known.versions_in(&scenario);
    let is_versioned = versions.values().all(Option::is_some);
    let (id, cost) = (id(&scenario, &of_run, &versions), cost(&scenario, &of_run));
    let mut folder = PathBuf::new();
    if scenario.map.file.is_some() || !scenario.agents.command.is_empty() {
        files.folder().clone_into(&mut folder);
        scenario.map.folder.clone_from(&folder);
    }
    Ok(PlannedRun { id, is_versioned, axes, map, scenario, folder, cost })
}

/// See [`PlannedRun::id`].
fn id(scenario: &Scenario, files: &RunFiles, versions: &BTreeMap<&str, Option<&str>>) -> String {
    let mut hasher = blake3::Hasher::new();
    // The map file is among the hashes, whatever its name.
    let mut scenario = scenario.clone().without_map_file();
    if files.maps > 0 {
        scenario.map.cell_m = None;
    }
    hasher.update(scenario.identity().as_bytes()).update(&[0]).update(BUILD.as_bytes());
    for hash in &files.hashes {
        hasher.update(&[0]).update(hash.as_bytes());
    }
    for (name, version) in versions {
        if let Some(version) = version {
            hasher.update(&[1]).update(name.as_bytes()).update(&[0]).update(version.as_bytes());
        }
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

/// See [`PlannedRun::map`].
fn map_id(scenario: &Scenario, files: &RunFiles) -> String {
    let mut map = scenario.clone().without_map_file().map;
    let hashes = &files.hashes[..files.maps];
    // A file makes the same map with every seed and under every name; a generator depends on the
    // seed, whether the map has one of its own or not.
    map.seed = hashes.is_empty().then_some(scenario.map_seed());
    if !hashes.is_empty() {
        map.cell_m = None;
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update(toml::to_string(&map).expect("a section has plain values").as_bytes());
    for hash in hashes {
        hasher.update(&[0]).update(hash.as_bytes());
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

#[cfg(test)]
mod tests;
