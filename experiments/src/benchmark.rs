//! Benchmarks that can be cited: fixed worlds, teams, radios and seeds, one number for each track.
//!
//! A benchmark is one [`Plan`] for each world, in a folder of its own, so it is resumable and has
//! the tables and reports of any plan. The [`ResultFile`] has a line for each run with its digest:
//! who has the build can execute any of them again ([`verify`]), and [`schedule`] says how long the
//! whole takes on many cores. Tracks, metrics and rules: docs/exploration-1.md.
//!
//! Invariant: what is measured is fixed by the name of the benchmark ([`Benchmark`]). A change of
//! worlds, teams, radios, localisation, seeds or score is a benchmark with another name.

mod definition;
mod results;
pub mod schedule;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::execute::{self, ExecuteError, Options, PlanObserver, Selection, Stop, Summary};
use crate::plan::{Plan, PlanError};
use crate::rows::RunRow;
use crate::store::{Store, StoreError};

pub use definition::{Benchmark, EXPLORATION_1, EXPLORATION_2, SEEDS};
use definition::{BenchmarkWorld, Named, STATION};
pub use results::{ResultFile, Run, Track, read, table};
use results::{results, rounded};

/// An entry: a controller with its settings, built in or in a program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    pub controller: String,
    /// Settings of the controller that are not defaults.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub set: BTreeMap<String, toml::Value>,
    /// See `agents.command` of a scenario.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub command: Vec<String>,
    /// Where the files are that `command` names as `./NAME`, by name. They are copied beside the
    /// plans, so that the command is the same on every machine.
    #[serde(skip)]
    pub files: BTreeMap<String, PathBuf>,
}

/// Which runs of a benchmark are executed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scope {
    /// Names of the worlds.
    pub worlds: BTreeSet<String>,
    pub seeds: Vec<u64>,
    /// Hash of the phrase that the seeds are made from; `None` for public ones.
    pub phrase: Option<String>,
}

impl Scope {
    /// The public seeds, in all worlds.
    #[must_use]
    pub fn public(benchmark: &Benchmark) -> Self {
        let worlds = benchmark.worlds().map(str::to_owned).collect();
        Self { worlds, seeds: (1..=SEEDS as u64).collect(), phrase: None }
    }

    /// Seeds made from a phrase, in all worlds: whoever does not know it cannot tune for them.
    #[must_use]
    pub fn held_out(benchmark: &Benchmark, phrase: &str) -> Self {
        let mut bytes = blake3::Hasher::new_derive_key(&format!("maes {} seeds v1", benchmark.name));
        let mut stream = bytes.update(phrase.as_bytes()).finalize_xof();
        let mut seeds = BTreeSet::new();
        while seeds.len() < SEEDS {
            let mut number = [0; 8];
            stream.fill(&mut number);
            // Seeds of a plan are integers of TOML; those up to a million are left to the public.
            let seed = u64::from_le_bytes(number) >> 1;
            seeds.extend((seed > 1_000_000).then_some(seed));
        }
        let hash = blake3::derive_key(&format!("maes {} phrase v1", benchmark.name), phrase.as_bytes());
        let phrase = Some(blake3::Hash::from_bytes(hash).to_hex().to_string());
        Self { seeds: seeds.into_iter().collect(), phrase, ..Self::public(benchmark) }
    }

    /// Whether it has all worlds, and as many seeds as the benchmark.
    #[must_use]
    pub fn is_whole(&self, benchmark: &Benchmark) -> bool {
        self.worlds.len() == benchmark.worlds.len() && self.seeds.len() == SEEDS
    }
}

#[derive(Debug, Error)]
pub enum BenchmarkError {
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Execute(#[from] ExecuteError),
    #[error("{file}: {source}")]
    Read { file: String, source: std::io::Error },
    #[error("{file}: no result file of a benchmark: {source}")]
    NoResult { file: String, source: serde_json::Error },
    #[error("{file}: {reason}")]
    Unfit { file: String, reason: String },
}

/// How an execution went.
#[derive(Debug, Clone, PartialEq)]
pub struct Executed {
    pub summary: Summary,
    /// `None` if runs are missing.
    pub results: Option<ResultFile>,
}

/// Executes an entry in a folder, and writes the result file if no run is missing. Runs that are
/// there are skipped.
///
/// # Errors
/// If the entry is not legal, or the folder cannot be used.
pub fn execute(
    benchmark: &'static Benchmark,
    entry: &Entry,
    scope: &Scope,
    folder: &Path,
    options: &Options,
    observer: &mut dyn PlanObserver,
    stop: &Stop,
) -> Result<Executed, BenchmarkError> {
    let mut summary = Summary::default();
    let mut runs = Vec::new();
    // All plans are checked before the first one is executed.
    let plans: Vec<(&BenchmarkWorld, Plan)> = benchmark
        .worlds
        .iter()
        .filter(|world| scope.worlds.contains(world.name))
        .map(|world| Ok((world, plan(benchmark, entry, &scope.seeds, world, &folder.join(world.name))?)))
        .collect::<Result<_, BenchmarkError>>()?;
    for (world, plan) in plans {
        let folder = folder.join(world.name);
        let of_world = execute::execute(&plan, folder.clone(), options, &mut *observer, stop)?;
        for (sum, count) in [
            (&mut summary.skipped, of_world.skipped),
            (&mut summary.done, of_world.done),
            (&mut summary.failed, of_world.failed),
            (&mut summary.left, of_world.left),
        ] {
            *sum += count;
        }
        let store = Store::open(&folder)?;
        let records = store.records()?;
        for record in &records {
            runs.push(run(benchmark, world, &record.row)?);
        }
    }
    if summary.failed + summary.left > 0 {
        return Ok(Executed { summary, results: None });
    }
    let results = results(benchmark, entry, scope, runs);
    let result_file = benchmark.result_file();
    let text = serde_json::to_string_pretty(&results).map_err(|source| {
        let file = folder.join(&result_file).display().to_string();
        BenchmarkError::NoResult { file, source }
    })?;
    Store::write_in(folder, &result_file, (text + "\n").as_bytes())?;
    Ok(Executed { summary, results: Some(results) })
}

/// The plan of a world, whose map file, if it has one, is written into the folder.
fn plan(
    benchmark: &Benchmark,
    entry: &Entry,
    seeds: &[u64],
    world: &BenchmarkWorld,
    folder: &Path,
) -> Result<Plan, BenchmarkError> {
    if world.map.contains(STATION.0) {
        Store::create(folder)?;
        Store::write_in(&folder.join("files"), STATION.0, STATION.1.as_bytes())?;
    }
    for (name, file) in &entry.files {
        let failed = |source| BenchmarkError::Read { file: file.display().to_string(), source };
        let files = folder.join("files");
        std::fs::create_dir_all(&files).map_err(failed)?;
        // With its permissions: a program stays one.
        std::fs::copy(file, files.join(name)).map_err(failed)?;
    }
    let mut agents = toml::Table::new();
    agents.insert("count".to_owned(), 1.into());
    agents.insert("controller".to_owned(), entry.controller.clone().into());
    if !entry.set.is_empty() {
        agents.insert("set".to_owned(), toml::Value::Table(entry.set.clone().into_iter().collect()));
    }
    if !entry.command.is_empty() {
        agents.insert("command".to_owned(), entry.command.clone().into());
    }
    let axis = |choices: &[Named]| choices.iter().map(|choice| choice.keys).collect::<Vec<_>>().join(", ");
    let Benchmark { name: benchmark_name, teams, radios, localisations, common, .. } = benchmark;
    let BenchmarkWorld { name, duration_s, map, spawn, lidar } = world;
    let localisation =
        if localisations.is_empty() { String::new() } else { format!("localisation = [{}]\n", axis(localisations)) };
    let lidar = lidar.map_or_else(String::new, |lidar| format!("lidar = {lidar}\n"));
    // Texts of the entry, which may be a stranger's, are values of the plan and never part of its
    // syntax.
    let title = toml::Value::from(format!("{benchmark_name}, {name}: {}", entry.controller));
    let text = format!(
        "title = {title}\nfolder = \"files\"\nseeds = {seeds:?}\n\n[axes]\n\
         \"agents.count\" = {teams:?}\ncommunication = [{radios}]\n{localisation}\n[scenario]\n\
         duration_s = {duration_s}.0\nmap = {map}\nspawn = {spawn}\n{common}{lidar}agents = {agents}\n",
        radios = axis(radios),
        agents = toml::Value::Table(agents),
    );
    Ok(Plan::parse(&format!("{benchmark_name}, {name}"), &text, folder)?)
}

/// The name of the choice that a run has made on an axis of its plan.
///
/// # Errors
/// If it is none of them, as in a folder of another build.
fn chosen(choices: &[Named], axis: &str, row: &RunRow) -> Result<String, BenchmarkError> {
    let label = row.axes.get(axis).map_or("", String::as_str);
    let choice = choices.iter().find(|choice| choice.label() == label);
    choice.map(|choice| choice.name.to_owned()).ok_or_else(|| {
        let labels: Vec<String> = choices.iter().map(Named::label).collect();
        let reason = format!("{axis} = {label:?}: expected one of {}", labels.join(", "));
        BenchmarkError::Unfit { file: format!("the run {}", row.id), reason }
    })
}

impl Benchmark {
    /// The names of the radio and of the localisation of a run.
    ///
    /// # Errors
    /// If it has others than the benchmark.
    pub fn conditions_of(&self, row: &RunRow) -> Result<(String, Option<String>), BenchmarkError> {
        let localisation = match self.localisations {
            [] => None,
            localisations => Some(chosen(localisations, "localisation", row)?),
        };
        Ok((chosen(self.radios, "communication", row)?, localisation))
    }
}

fn run(benchmark: &Benchmark, world: &BenchmarkWorld, row: &RunRow) -> Result<Run, BenchmarkError> {
    let (radio, localisation) = benchmark.conditions_of(row)?;
    Ok(Run {
        world: world.name.to_owned(),
        agents: row.agents,
        radio,
        localisation,
        seed: row.seed,
        id: row.id.clone(),
        area: rounded(row.area_under_explored),
        t99_s: row.t99_s,
        digest: row.digest.clone(),
    })
}

/// What a verification found.
#[derive(Debug, Clone, PartialEq)]
pub struct Verified {
    /// Runs that were executed again.
    pub runs: usize,
    /// What differs, one line each; empty if the file holds.
    pub differences: Vec<String>,
}

/// Checks the figures of a result file against its runs, and executes a tenth of these again, drawn
/// by `draw`, in an empty folder.
///
/// # Errors
/// If a run cannot be executed.
pub fn verify(
    results: &ResultFile,
    draw: u64,
    folder: &Path,
    options: &Options,
    observer: &mut dyn PlanObserver,
    stop: &Stop,
) -> Result<Verified, BenchmarkError> {
    let mut differences = Vec::new();
    let benchmark = results.benchmark;
    let worlds: BTreeSet<String> = results.runs.iter().map(|run| run.world.clone()).collect();
    let scope = Scope { worlds, seeds: results.seeds.clone(), phrase: results.phrase.clone() };
    let recomputed = results::results(benchmark, &results.entry, &scope, results.runs.clone());
    if recomputed != *results {
        differences.push("score, tracks or their order do not follow from the runs".to_owned());
    }
    let drawn = drawn(&results.runs, draw);
    let mut again = 0;
    for world in benchmark.worlds.iter().filter(|world| scope.worlds.contains(world.name)) {
        let folder = folder.join(world.name);
        let plan = plan(benchmark, &results.entry, &scope.seeds, world, &folder)?;
        let claimed: BTreeSet<&str> =
            results.runs.iter().filter(|run| run.world == world.name).map(|run| run.id.as_str()).collect();
        let planned: BTreeSet<&str> = plan.runs.iter().map(|run| run.id.as_str()).collect();
        if claimed != planned {
            differences.push(format!("{}: its runs are not those of the benchmark", world.name));
            continue;
        }
        let only: BTreeSet<String> =
            drawn.iter().filter(|run| run.world == world.name).map(|run| run.id.clone()).collect();
        if only.is_empty() {
            continue;
        }
        let selection = Selection { only, ..Selection::default() };
        let summary = execute::execute_selected(&plan, folder.clone(), options, &selection, &mut *observer, stop)?;
        again += summary.done;
        let store = Store::open(&folder)?;
        for claimed in drawn.iter().filter(|run| run.world == world.name) {
            let what = format!("{}, seed {}", claimed.track(), claimed.seed);
            match store.run(&claimed.id)? {
                None => differences.push(format!("{what}: was not executed to its end")),
                Some(stored) if run(benchmark, world, &stored.row)? != **claimed => {
                    let digest = &stored.row.digest;
                    differences.push(format!("{what}: digest {digest}, in the file {}", claimed.digest));
                }
                Some(_) => {}
            }
        }
    }
    Ok(Verified { runs: again, differences })
}

/// A tenth of the runs, rounded up, each as likely as the others.
fn drawn(runs: &[Run], draw: u64) -> Vec<&Run> {
    let mut order: Vec<(blake3::Hash, &Run)> =
        runs.iter().map(|run| (blake3::hash(format!("{draw} {} {}", run.id, run.digest).as_bytes()), run)).collect();
    order.sort_by_key(|(hash, _)| *hash.as_bytes());
    order.into_iter().take(runs.len().div_ceil(10)).map(|(_, run)| run).collect()
}

#[cfg(test)]
mod tests {
    use std::num::NonZero;

    use agent_node::controllers::Registry;

    use super::*;
    use crate::execute::{Part, Transport};

    fn entry(controller: &str) -> Entry {
        Entry { controller: controller.to_owned(), set: BTreeMap::new(), command: Vec::new(), files: BTreeMap::new() }
    }

    fn options() -> Options {
        let jobs = NonZero::new(2).unwrap();
        Options { jobs, transport: Transport::Memory, part: Part::WHOLE, registry: Registry::BUILT_IN, prune: false }
    }

    #[test]
    fn every_world_has_a_plan_of_the_whole_benchmark() {
        let site = tempfile::tempdir().unwrap();
        for (benchmark, tracks) in [(&EXPLORATION_1, 5 * 2), (&EXPLORATION_2, 4 * 3 * 2)] {
            for world in benchmark.worlds {
                let seeds = Scope::public(benchmark).seeds;
                let folder = site.path().join(world.name);
                let plan = plan(benchmark, &entry("dsvp"), &seeds, world, &folder).unwrap();
                assert_eq!(plan.runs.len(), SEEDS * tracks, "{}", world.name);
                let is_of_one = |choices: &[Named], label: Option<&String>| {
                    choices.iter().filter(|choice| Some(&choice.label()) == label).count() == 1
                };
                for run in &plan.runs {
                    assert!(is_of_one(benchmark.radios, run.axes.get("communication")), "{:?}", run.axes);
                    let localisation = run.axes.get("localisation");
                    assert!(
                        localisation.is_none() || is_of_one(benchmark.localisations, localisation),
                        "{localisation:?}"
                    );
                    assert_eq!(localisation.is_none(), benchmark.localisations.is_empty());
                }
                let largest = benchmark.teams.iter().max();
                for run in plan.runs.iter().filter(|run| Some(&run.scenario.agents.count) == largest).take(2) {
                    sim_server::setup::build(&run.scenario).unwrap();
                }
            }
        }
    }

    #[test]
    fn worlds_belong_to_one_benchmark() {
        let names: Vec<&str> = Benchmark::ALL.iter().flat_map(|benchmark| benchmark.worlds()).collect();
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len(), "{names:?}");
    }

    #[test]
    fn name_of_a_controller_adds_nothing_to_a_plan() {
        let site = tempfile::tempdir().unwrap();
        let world = &EXPLORATION_1.worlds[0];
        let name = "x\"\nfolder = \"files\"\nseeds = [1]\n[[variant]]\nname = \"v\"\n\"agents.command\" = [\"sh\", \
                    \"{id}\"]\ncommand_signs = \"\"\"";
        let refused = plan(&EXPLORATION_1, &entry(name), &[1], world, site.path()).unwrap_err().to_string();
        // Written as it is, it would close the title, and be a plan of its own.
        assert!(refused.contains("agents.controller") && refused.contains("unknown"), "{refused}");
    }

    #[test]
    fn held_out_seeds_follow_from_the_phrase() {
        let of = |phrase: &str| Scope::held_out(&EXPLORATION_1, phrase);
        let scope = of("a secret");
        assert_eq!(scope, of("a secret"));
        assert!(scope.is_whole(&EXPLORATION_1) && scope.seeds.len() == SEEDS);
        let other = Scope::held_out(&EXPLORATION_2, "a secret");
        assert!(scope.seeds.iter().all(|seed| !of("another").seeds.contains(seed) && !other.seeds.contains(seed)));
        assert!(!scope.phrase.unwrap().contains("secret"));
    }

    /// Two seeds of the smallest world.
    fn small() -> Scope {
        Scope { worlds: BTreeSet::from(["station".to_owned()]), seeds: vec![1, 2], phrase: None }
    }

    #[test]
    fn results_are_resumed_and_verified() {
        let site = tempfile::tempdir().unwrap();
        let (out, again) = (site.path().join("out"), site.path().join("again"));
        let go = || {
            execute(&EXPLORATION_1, &entry("nearest-frontier"), &small(), &out, &options(), &mut (), &Stop::default())
                .unwrap()
        };
        let first = go();
        assert_eq!(first.summary, Summary { done: 20, ..Summary::default() });
        let results = first.results.unwrap();
        assert_eq!((results.tracks.len(), results.runs.len(), results.is_whole), (10, 20, false));
        assert!(results.score > 50.0 && results.score <= 100.0, "{}", results.score);
        let resumed = go();
        assert_eq!(resumed.summary.skipped, 20);
        assert_eq!(resumed.results.as_ref(), Some(&results));
        let file = out.join(EXPLORATION_1.result_file());
        assert_eq!(read(&file).unwrap(), results);
        assert_eq!(table(&results).lines().count(), 4);
        let check = |results: &ResultFile, folder: &str| {
            verify(results, 7, &again.join(folder), &options(), &mut (), &Stop::default()).unwrap()
        };
        assert_eq!(check(&results, "same"), Verified { runs: 2, differences: Vec::new() });
        // A file whose author has embellished a run that is drawn.
        let drawn = drawn(&results.runs, 7)[0].clone();
        let mut forged = results.clone();
        let place = forged.runs.iter().position(|run| *run == drawn).unwrap();
        forged.runs[place].area = 0.999;
        let forged = super::results(&EXPLORATION_1, &forged.entry.clone(), &small(), forged.runs);
        let found = check(&forged, "forged").differences;
        assert!(found.len() == 1 && found[0].contains("station"), "{found:?}");
        // And one who has embellished the score alone.
        let found = check(&ResultFile { score: 99.9, ..results.clone() }, "score").differences;
        assert!(found.len() == 1 && found[0].contains("score"), "{found:?}");
        // Of another build.
        let old = ResultFile { build: "0.0.1+old".to_owned(), ..results };
        std::fs::write(&file, serde_json::to_string(&old).unwrap()).unwrap();
        assert!(read(&file).unwrap_err().to_string().contains("made by build 0.0.1+old"));
    }
}
