//! Benchmarks that can be cited: fixed worlds, teams, radios and seeds, one number for each track.
//!
//! A benchmark is one [`Plan`] for each world, in a folder of its own, so it is resumable and has
//! the tables and reports of any plan. The [`ResultFile`] has a line for each run with its digest:
//! who has the build can execute any of them again ([`verify`]), and [`schedule`] says how long the
//! whole takes on many cores. Tracks, metrics and rules: docs/exploration-1.md.
//!
//! Invariant: what is measured is fixed by the name of the benchmark. A change of worlds, teams,
//! radios, seeds or score is a benchmark with another name.

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

pub use results::{ResultFile, Run, Track, read, table};
use results::{results, rounded};

/// The name of the benchmark.
pub const EXPLORATION_1: &str = "exploration-1";

/// File name of the results, in the folder of the runs.
pub const RESULT_FILE: &str = "exploration-1.json";

/// Number of seeds of each track.
pub const SEEDS: usize = 30;

/// The teams.
pub const TEAMS: [u32; 5] = [1, 2, 5, 10, 20];

/// The radios: name, and `[communication]`.
const RADIOS: [(&str, &str); 2] =
    [("perfect", "{ model = \"line_of_sight\" }"), ("lossy", "{ range_m = 15.0, loss = 0.3, bytes_per_s = 20000.0 }")];

/// A world: its name, the greatest sim time, and what a scenario has beside team and radio.
struct BenchmarkWorld {
    name: &'static str,
    duration_s: u32,
    map: &'static str,
    spawn: &'static str,
}

/// The imported world, which is written beside its plan.
const STATION: (&str, &str) = ("station.obj", include_str!("benchmark/station.obj"));

const WORLDS: [BenchmarkWorld; 6] = [
    BenchmarkWorld { name: "cave-50", duration_s: 300, map: "{ kind = \"spheres\", size = 50 }", spawn: NEAR },
    BenchmarkWorld { name: "cave-75", duration_s: 600, map: "{ kind = \"spheres\", size = 75 }", spawn: NEAR },
    BenchmarkWorld { name: "cave-100", duration_s: 900, map: "{ kind = \"spheres\", size = 100 }", spawn: NEAR },
    BenchmarkWorld { name: "noise", duration_s: 600, map: "{ kind = \"noise\", size = 60 }", spawn: NEAR },
    BenchmarkWorld {
        name: "building",
        duration_s: 600,
        map: "{ kind = \"building\", size = [60, 60, 13] }",
        spawn: "{ kind = \"entrances\" }",
    },
    BenchmarkWorld {
        name: "station",
        duration_s: 300,
        map: "{ kind = \"file\", file = \"station.obj\", cell_m = 1.0, import = { free_from = [20.5, 20.5, 2.5] } }",
        spawn: "{ kind = \"scattered\", min_distance_m = 1.0 }",
    },
];

const NEAR: &str = "{ kind = \"nearest_origin\" }";

/// The names of the worlds.
pub fn worlds() -> impl Iterator<Item = &'static str> {
    WORLDS.iter().map(|world| world.name)
}

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
    pub fn public() -> Self {
        Self { worlds: worlds().map(str::to_owned).collect(), seeds: (1..=SEEDS as u64).collect(), phrase: None }
    }

    /// Seeds made from a phrase, in all worlds: whoever does not know it cannot tune for them.
    #[must_use]
    pub fn held_out(phrase: &str) -> Self {
        let mut bytes = blake3::Hasher::new_derive_key("maes exploration-1 seeds v1");
        let mut stream = bytes.update(phrase.as_bytes()).finalize_xof();
        let mut seeds = BTreeSet::new();
        while seeds.len() < SEEDS {
            let mut number = [0; 8];
            stream.fill(&mut number);
            // Seeds of a plan are integers of TOML; those up to a million are left to the public.
            let seed = u64::from_le_bytes(number) >> 1;
            seeds.extend((seed > 1_000_000).then_some(seed));
        }
        let hash = blake3::derive_key("maes exploration-1 phrase v1", phrase.as_bytes());
        let phrase = Some(blake3::Hash::from_bytes(hash).to_hex().to_string());
        Self { seeds: seeds.into_iter().collect(), phrase, ..Self::public() }
    }

    /// Whether it has all worlds, and as many seeds as the benchmark.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.worlds.len() == WORLDS.len() && self.seeds.len() == SEEDS
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
    let plans: Vec<(&BenchmarkWorld, Plan)> = WORLDS
        .iter()
        .filter(|world| scope.worlds.contains(world.name))
        .map(|world| Ok((world, plan(entry, &scope.seeds, world, &folder.join(world.name))?)))
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
        runs.extend(records.iter().map(|record| run(world, &record.row)));
    }
    if summary.failed + summary.left > 0 {
        return Ok(Executed { summary, results: None });
    }
    let results = results(entry, scope, runs);
    let text = serde_json::to_string_pretty(&results).map_err(|source| {
        let file = folder.join(RESULT_FILE).display().to_string();
        BenchmarkError::NoResult { file, source }
    })?;
    Store::write_in(folder, RESULT_FILE, (text + "\n").as_bytes())?;
    Ok(Executed { summary, results: Some(results) })
}

/// The plan of a world, whose map file, if it has one, is written into the folder.
fn plan(entry: &Entry, seeds: &[u64], world: &BenchmarkWorld, folder: &Path) -> Result<Plan, BenchmarkError> {
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
    let radios = RADIOS.map(|(_, radio)| radio).join(", ");
    let BenchmarkWorld { name, duration_s, map, spawn } = world;
    // Texts of the entry, which may be a stranger's, are values of the plan and never part of its
    // syntax.
    let title = toml::Value::from(format!("{EXPLORATION_1}, {name}: {}", entry.controller));
    let text = format!(
        "title = {title}\nfolder = \"files\"\nseeds = {seeds:?}\n\n[axes]\n\
         \"agents.count\" = {TEAMS:?}\ncommunication = [{radios}]\n\n[scenario]\nduration_s = {duration_s}.0\nmap = {map}\n\
         spawn = {spawn}\nagents = {agents}\n",
        agents = toml::Value::Table(agents),
    );
    Ok(Plan::parse(&format!("{EXPLORATION_1}, {name}"), &text, folder)?)
}

fn run(world: &BenchmarkWorld, row: &RunRow) -> Run {
    let label = row.axes.get("communication").map(String::as_str).unwrap_or_default();
    // The lossy radio is the only one that loses anything.
    let (radio, _) = RADIOS[usize::from(label.contains("loss"))];
    Run {
        world: world.name.to_owned(),
        agents: row.agents,
        radio: radio.to_owned(),
        seed: row.seed,
        id: row.id.clone(),
        area: rounded(row.area_under_explored),
        t99_s: row.t99_s,
        digest: row.digest.clone(),
    }
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
    let worlds: BTreeSet<String> = results.runs.iter().map(|run| run.world.clone()).collect();
    let scope = Scope { worlds, seeds: results.seeds.clone(), phrase: results.phrase.clone() };
    let recomputed = results::results(&results.entry, &scope, results.runs.clone());
    if recomputed != *results {
        differences.push("score, tracks or their order do not follow from the runs".to_owned());
    }
    let drawn = drawn(&results.runs, draw);
    let mut again = 0;
    for world in WORLDS.iter().filter(|world| scope.worlds.contains(world.name)) {
        let folder = folder.join(world.name);
        let plan = plan(&results.entry, &scope.seeds, world, &folder)?;
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
            let Run { agents, radio, seed, .. } = claimed;
            let what = format!("{}, {agents} agents, {radio} radio, seed {seed}", world.name);
            match store.run(&claimed.id)? {
                None => differences.push(format!("{what}: was not executed to its end")),
                Some(stored) if run(world, &stored.row) != **claimed => {
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
        for world in &WORLDS {
            let plan = plan(&entry("dsvp"), &Scope::public().seeds, world, &site.path().join(world.name)).unwrap();
            assert_eq!(plan.runs.len(), SEEDS * TEAMS.len() * RADIOS.len(), "{}", world.name);
            for run in plan.runs.iter().filter(|run| run.scenario.agents.count == 20).take(2) {
                sim_server::setup::build(&run.scenario).unwrap();
            }
        }
    }

    #[test]
    fn name_of_a_controller_adds_nothing_to_a_plan() {
        let site = tempfile::tempdir().unwrap();
        let world = &WORLDS[0];
        let name = "x\"\nfolder = \"files\"\nseeds = [1]\n[[variant]]\nname = \"v\"\n\"agents.command\" = [\"sh\", \
                    \"{id}\"]\ncommand_signs = \"\"\"";
        let refused = plan(&entry(name), &[1], world, site.path()).unwrap_err().to_string();
        // Written as it is, it would close the title, and be a plan of its own.
        assert!(refused.contains("agents.controller") && refused.contains("unknown"), "{refused}");
    }

    #[test]
    fn held_out_seeds_follow_from_the_phrase() {
        let scope = Scope::held_out("a secret");
        assert_eq!(scope, Scope::held_out("a secret"));
        assert!(scope.is_whole() && scope.seeds.len() == SEEDS);
        assert!(scope.seeds.iter().all(|seed| !Scope::held_out("another").seeds.contains(seed)));
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
        let go = || execute(&entry("nearest-frontier"), &small(), &out, &options(), &mut (), &Stop::default()).unwrap();
        let first = go();
        assert_eq!(first.summary, Summary { done: 20, ..Summary::default() });
        let results = first.results.unwrap();
        assert_eq!((results.tracks.len(), results.runs.len(), results.is_whole), (10, 20, false));
        assert!(results.score > 50.0 && results.score <= 100.0, "{}", results.score);
        let resumed = go();
        assert_eq!(resumed.summary.skipped, 20);
        assert_eq!(resumed.results.as_ref(), Some(&results));
        let file = out.join(RESULT_FILE);
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
        let forged = super::results(&forged.entry.clone(), &small(), forged.runs);
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
