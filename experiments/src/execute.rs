//! Execution of a plan: its runs without a record, several in parallel.
//!
//! A completed run is a file in the folder, so an execution that was stopped or killed resumes with
//! the runs that are missing. No result depends on wall time.

mod memory;
mod parts;
#[cfg(feature = "ros")]
mod ros;

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread;

use agent_node::controllers::Registry;
use msgs::printable;
use sim_server::setup::SetupError;
#[cfg(feature = "ros")]
use supervisor::SupervisorError;
use thiserror::Error;

use crate::merge::is_same_run;
use crate::oracle;
use crate::plan::{BUILD, Plan, PlannedRun};
use crate::retained_recordings::{self, Keep};
use crate::rows::{FailedRun, RunMetadata, RunRecord, RunRow, StoredRun};
use crate::store::{self, Store, StoreError};
use statistics::StatisticsError;
use system::file_lock::FileLock;
use system::wall_clock;

pub use parts::Part;
#[cfg(feature = "ros")]
pub use ros::Launcher;

/// The transport between a server and its agents.
#[derive(Debug, Clone)]
pub enum Transport {
    /// All in this process.
    Memory,
    /// Over ROS 2, with a process for the server and for each agent.
    #[cfg(feature = "ros")]
    Ros2(Launcher),
}

impl Transport {
    /// The flags of `maes batch` for it.
    pub(crate) fn flags(&self) -> &'static str {
        match self {
            Self::Memory => "",
            #[cfg(feature = "ros")]
            Self::Ros2(_) => " --transport ros2",
        }
    }
}

#[derive(Debug, Clone)]
pub struct Options {
    /// Number of runs in parallel.
    pub jobs: NonZero<usize>,
    pub transport: Transport,
    pub part: Part,
    /// The controllers of runs over memory; those over ROS 2 know the built-in ones.
    pub registry: Registry,
    /// Whether to remove runs from the folder that are not of this plan and build. Otherwise they
    /// are an error.
    pub prune: bool,
}

/// Which runs are executed, and which recordings stay.
#[derive(Debug, Clone, Default)]
pub struct Selection {
    /// The ids of the runs; all if it is empty.
    pub only: BTreeSet<String>,
    pub keep: Keep,
}

/// Requests to end an execution early.
#[derive(Debug, Default)]
pub struct Stop {
    /// No further run is started.
    pub soon: AtomicBool,
    /// Runs in progress are abandoned as well.
    pub at_once: AtomicBool,
}

/// Why a run has no record.
#[derive(Debug, Error)]
pub enum RunFailure {
    /// [`Stop::at_once`] was set.
    #[error("interrupted")]
    Interrupted,
    /// It cannot be set up, or fails.
    #[error("{0}")]
    Failed(String),
}

/// Why a plan cannot be executed.
#[derive(Debug, Error)]
pub enum ExecuteError {
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The folder holds runs of another plan or build.
    #[error(
        "{folder}: holds {count} runs that are not of this plan and this build ({BUILD}), such as {example}: choose \
         another folder"
    )]
    OtherRuns {
        folder: String,
        count: usize,
        /// The id of one of them.
        example: String,
    },
    /// A run cannot be executed over this transport.
    #[error("{key} = {value}: {reason}")]
    Transport { key: &'static str, value: String, reason: &'static str },
    /// A program of the user cannot run agents.
    #[cfg(feature = "ros")]
    #[error(transparent)]
    Program(#[from] SupervisorError),
    /// [`Selection::only`] names a run that is not of the plan and this build.
    #[error("run {id}: not of this plan and this build ({BUILD}); its runs are in the column `id` of runs.csv")]
    UnknownRun { id: String },
    /// A run that was executed again differs from its record.
    #[error("run {id}: executed again it has other metrics than its record: was a file changed?")]
    OtherOutcome { id: String },
    /// The world of a run cannot be made for the oracle.
    #[error(transparent)]
    Oracle(#[from] SetupError),
    /// A record has a metric that is not finite.
    #[error("the runs have an invalid metric: {0}")]
    Statistics(#[from] StatisticsError),
}

/// Counts of the runs of an execution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Summary {
    /// Runs that had a record before.
    pub skipped: usize,
    /// Runs that got a record.
    pub done: usize,
    /// Runs that had a record, and were executed again for their recordings.
    pub recorded: usize,
    pub failed: usize,
    /// Runs that were not started, or were abandoned.
    pub left: usize,
}

/// Receives the progress of an execution, in the thread that has called [`execute`].
pub trait PlanObserver {
    /// Before the first run. `pending` are those of `runs` that have no record.
    fn started(&mut self, _runs: &[&PlannedRun], _pending: &[&PlannedRun]) {}
    /// A run has got its record.
    fn completed(&mut self, _run: &PlannedRun, _row: &RunRow) {}
    /// A run has failed, for a reason of one line.
    fn failed(&mut self, _run: &PlannedRun, _reason: &str) {}
    /// After the last run, also if the execution fails.
    fn ended(&mut self) {}
}

/// Observes nothing.
impl PlanObserver for () {}

/// Checks, before anything runs, whether every run of a plan can be executed over a transport:
/// other programs join over ROS 2 only, and know their controllers.
///
/// # Errors
/// Names the key and the remedy.
pub fn check(plan: &Plan, transport: &Transport) -> Result<(), ExecuteError> {
    match transport {
        Transport::Memory => {
            let of_ros_only = |run: &PlannedRun| run.scenario.agents.of_ros_only(cfg!(feature = "ros"));
            if let Some((key, value)) = plan.runs.iter().find_map(of_ros_only) {
                let reason = "expected [] over memory, which has no other nodes; use --transport ros2";
                return Err(ExecuteError::Transport { key, value, reason });
            }
            #[cfg(feature = "ros")]
            ros::check(plan)?;
            Ok(())
        }
        #[cfg(feature = "ros")]
        Transport::Ros2(_) => ros::check(plan),
    }
}

/// Executes a plan in a folder, and writes its tables. A part writes them if no run is left in the
/// folder. No recordings are kept.
///
/// A run that fails is reported to `observer` and gets no record; the other runs continue.
///
/// # Errors
/// If the folder cannot be used, or a run cannot be executed; see [`check`].
pub fn execute(
    plan: &Plan,
    folder: PathBuf,
    options: &Options,
    observer: &mut dyn PlanObserver,
    stop: &Stop,
) -> Result<Summary, ExecuteError> {
    execute_selected(plan, folder, options, &Selection::default(), observer, stop)
}

/// Executes a selection of the runs of a plan, see [`execute`], and keeps recordings in the folder
/// `recordings`. A run that has a record and no recording is executed again if its recording is to
/// be kept; its metrics must be those of its record.
///
/// # Errors
/// If the folder cannot be used, the selection has a run that the plan does not have, or a run that
/// is executed again differs from its record.
pub fn execute_selected(
    plan: &Plan,
    folder: PathBuf,
    options: &Options,
    selection: &Selection,
    observer: &mut dyn PlanObserver,
    stop: &Stop,
) -> Result<Summary, ExecuteError> {
    if let Some(id) = selection.only.iter().find(|id| plan.runs.iter().all(|run| run.id != **id)) {
        return Err(ExecuteError::UnknownRun { id: id.clone() });
    }
    execute_in(&open(plan, &folder, options)?, plan, options, selection, observer, stop)
}

/// A folder that is ready for the runs of a plan, and locked for as long as this lives.
#[derive(Debug)]
pub struct OpenFolder {
    pub store: Store,
    _lock: Option<FileLock>,
}

/// Opens the folder of a plan, and creates it if it does not exist; with [`Options::prune`] the
/// runs of other plans are removed. Runs of this part that are not
/// [versioned](PlannedRun::is_versioned) are removed in any case, to be executed again.
///
/// # Errors
/// If the folder cannot be used, or a run of the plan cannot be executed; see [`check`].
pub fn open(plan: &Plan, folder: &Path, options: &Options) -> Result<OpenFolder, ExecuteError> {
    check(plan, &options.transport)?;
    let store = Store::create(folder)?;
    let lock = store.lock(options.part != Part::WHOLE)?;
    prune(plan, &store, &store.done()?, options.prune)?;
    store.save_plan(plan)?;
    for run in options.part.of(&plan.runs).into_iter().filter(|run| !run.is_versioned) {
        store.remove(&run.id)?;
        store.forget_failure(&run.id)?;
    }
    Ok(OpenFolder { store, _lock: lock })
}

/// [`execute_selected`] in a folder that is open for this plan.
///
/// # Errors
/// If a file cannot be written, or a run that is executed again differs from its record.
pub fn execute_in(
    OpenFolder { store, .. }: &OpenFolder,
    plan: &Plan,
    options: &Options,
    Selection { only, keep }: &Selection,
    observer: &mut dyn PlanObserver,
    stop: &Stop,
) -> Result<Summary, ExecuteError> {
    let done = store.done()?;
    let is_selected = |run: &&PlannedRun| only.is_empty() || only.contains(&run.id);
    let mine: Vec<&PlannedRun> = options.part.of(&plan.runs).into_iter().filter(is_selected).collect();
    let lacks_recording = |run: &PlannedRun| !store.recording_file(&run.id).exists();
    let is_pending = |run: &&PlannedRun| !done.contains(&run.id) || (*keep == Keep::All && lacks_recording(run));
    let todo: Vec<&PlannedRun> = mine.iter().copied().filter(is_pending).collect();
    let mut summary = Summary { skipped: mine.len() - todo.len(), ..Summary::default() };
    observer.started(&mine, &todo);
    let mut failed = Vec::new();
    let mut executed =
        batch((store, plan), &todo, options, *keep == Keep::All, (&mut summary, &mut failed), (&mut *observer, stop));
    summary.left = todo.len() - summary.done - summary.recorded - summary.failed;
    if executed.is_ok() && matches!(keep, Keep::Failures | Keep::Outliers) {
        let chosen = retained_recordings::chosen(*keep, plan, &store.records()?)?;
        let has_failed = |run: &PlannedRun| *keep == Keep::Failures && failed.contains(&run.id);
        let again = |run: &&PlannedRun| (chosen.contains(&run.id) || has_failed(run)) && lacks_recording(run);
        let again: Vec<&PlannedRun> = mine.iter().copied().filter(again).collect();
        // Failed once more, a run is not counted twice.
        let mut repeated = Summary::default();
        executed =
            batch((store, plan), &again, options, true, (&mut repeated, &mut Vec::new()), (&mut *observer, stop));
        summary.recorded += repeated.recorded;
        summary.done += repeated.done;
        summary.failed -= repeated.done;
    }
    observer.ended();
    executed?;
    if plan.oracle && !stop.soon.load(Ordering::Relaxed) {
        oracles(store, &mine, options, stop)?;
    }
    // Thousands of parts would each read all runs. The part that ends last sees that all are done.
    let is_whole = options.part == Part::WHOLE;
    if is_whole || store.done()?.len() == plan.runs.len() {
        store.write_tables()?;
    }
    Ok(summary)
}

/// Executes runs and saves their records; counts them, and lists those that failed.
fn batch(
    (store, plan): (&Store, &Plan),
    todo: &[&PlannedRun],
    options: &Options,
    is_recorded: bool,
    (summary, failed): (&mut Summary, &mut Vec<String>),
    (observer, stop): (&mut dyn PlanObserver, &Stop),
) -> Result<(), ExecuteError> {
    let recordings = store.folder().join(store::RECORDINGS);
    if is_recorded && !todo.is_empty() {
        let failed = |source| StoreError::File { file: recordings.display().to_string(), source };
        std::fs::create_dir_all(&recordings).map_err(failed)?;
    }
    let recording = |run: &PlannedRun| is_recorded.then(|| store.recording_file(&run.id));
    each(todo, options, stop, &recording, |run, record| {
        match record {
            Ok(record) => match store.run(&run.id)?.map(|known| known.split().0) {
                Some(known) if is_same_run(&known, &store::as_stored(&record)?) => summary.recorded += 1,
                Some(_) => return Err(ExecuteError::OtherOutcome { id: run.id.clone() }),
                None => {
                    let mut scenario = plan.inputs.as_copied(run.scenario.clone());
                    scenario.execution.record = None;
                    store.save_scenario(&run.id, &scenario.to_toml())?;
                    let stored = StoredRun::new(record, made(run));
                    store.save_run(&stored)?;
                    observer.completed(run, &stored.row);
                    summary.done += 1;
                }
            },
            Err(RunFailure::Interrupted) => {}
            Err(RunFailure::Failed(reason)) => {
                summary.failed += 1;
                failed.push(run.id.clone());
                save_failure(store, run, &reason)?;
                observer.failed(run, &reason);
            }
        }
        Ok(())
    })
}

/// Saves that a run of a plan has failed, with the reason.
///
/// # Errors
/// If the file cannot be written.
pub fn save_failure(store: &Store, run: &PlannedRun, reason: &str) -> Result<(), StoreError> {
    store.save_failure(&failed_run(run, reason))
}

fn made(run: &PlannedRun) -> RunMetadata {
    RunMetadata { date: Some(today()), map: Some(run.map.clone()) }
}

/// What stays of a run that has failed.
fn failed_run(run: &PlannedRun, reason: &str) -> FailedRun {
    let scenario = &run.scenario;
    FailedRun {
        id: run.id.clone(),
        build: BUILD.to_owned(),
        controller: scenario.controllers_label(),
        seed: scenario.seed,
        size: scenario.map.size.map(|size| size.cells()),
        agents: scenario.agents.count,
        axes: run.axes.clone(),
        duration_s: scenario.duration_s,
        // It may quote what a program has printed.
        reason: printable::line(reason).into_owned(),
        made: made(run),
    }
}

/// Adds the oracle to the records of these runs that lack it. Runs that differ in their controllers
/// alone have the same one, which is computed once.
fn oracles(store: &Store, mine: &[&PlannedRun], options: &Options, stop: &Stop) -> Result<(), ExecuteError> {
    let mut worlds: BTreeMap<String, Vec<(&PlannedRun, StoredRun)>> = BTreeMap::new();
    for run in mine {
        if let Some(stored) = store.run(&run.id)?.filter(|stored| stored.row.oracle.is_none()) {
            worlds.entry(oracle::world(&run.scenario)).or_default().push((run, stored));
        }
    }
    let worlds: Vec<_> = worlds.into_values().collect();
    let next = AtomicUsize::new(0);
    let workers = options.jobs.get().min(worlds.len());
    thread::scope(|scope| {
        let work = || -> Result<(), ExecuteError> {
            while !stop.soon.load(Ordering::Relaxed)
                && let Some(runs) = worlds.get(next.fetch_add(1, Ordering::Relaxed))
            {
                let Some((run, _)) = runs.first() else { continue };
                let row = oracle::of(&run.scenario)?;
                for (_, stored) in runs {
                    let mut stored = stored.clone();
                    stored.row.oracle = Some(row);
                    store.save_run(&stored)?;
                }
            }
            Ok(())
        };
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let ended =
            workers.into_iter().map(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        ended.collect()
    })
}

fn prune(plan: &Plan, store: &Store, done: &BTreeSet<String>, is_allowed: bool) -> Result<(), ExecuteError> {
    let planned: BTreeSet<&String> = plan.runs.iter().map(|run| &run.id).collect();
    let others: Vec<&String> = done.iter().filter(|id| !planned.contains(id)).collect();
    match others.first() {
        Some(example) if !is_allowed => Err(ExecuteError::OtherRuns {
            folder: store.folder().display().to_string(),
            count: others.len(),
            example: (*example).clone(),
        }),
        _ => {
            others.into_iter().try_for_each(|id| store.remove(id))?;
            // Failures are no results: those of another plan or build go.
            let failures = store.failures()?;
            let others = failures.iter().filter(|failed| !planned.contains(&failed.id));
            Ok(others.into_iter().try_for_each(|failed| store.forget_failure(&failed.id))?)
        }
    }
}

/// Performs runs on as many threads as there are jobs, and passes each record to `take`.
/// `recording` names the file of a recording that is kept.
fn each(
    todo: &[&PlannedRun],
    options: &Options,
    stop: &Stop,
    recording: &(dyn Fn(&PlannedRun) -> Option<PathBuf> + Sync),
    mut take: impl FnMut(&PlannedRun, Result<RunRecord, RunFailure>) -> Result<(), ExecuteError>,
) -> Result<(), ExecuteError> {
    let next = AtomicUsize::new(0);
    let (sender, records) = channel();
    let jobs = options.jobs.get();
    thread::scope(|scope| {
        #[cfg_attr(not(feature = "ros"), expect(unused_variables, reason = "runs over memory need no domain"))]
        for job in 0..jobs.min(todo.len()) {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                while !stop.soon.load(Ordering::Relaxed)
                    && let Some(&run) = todo.get(next.fetch_add(1, Ordering::Relaxed))
                {
                    let kept = recording(run);
                    let record = match &options.transport {
                        Transport::Memory => memory::carry_out(run, kept, options.registry, &stop.at_once),
                        #[cfg(feature = "ros")]
                        Transport::Ros2(launcher) => {
                            launcher.carry_out(run, (job, jobs), kept.as_deref(), &stop.at_once)
                        }
                    };
                    // The receiver is gone if a record could not be saved, which abandons all runs.
                    if sender.send((run, record)).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        for (run, record) in records {
            if let Err(error) = take(run, record) {
                stop.soon.store(true, Ordering::Relaxed);
                stop.at_once.store(true, Ordering::Relaxed);
                return Err(error);
            }
        }
        Ok(())
    })
}

/// The processor of this machine and its number of usable cores.
#[must_use]
pub fn machine() -> String {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map_or(std::env::consts::ARCH, |(_, name)| name.trim());
    format!("{model}, {cores} cores")
}

/// The day, UTC, such as `2026-11-22`.
fn today() -> String {
    date(wall_clock::since_epoch().as_secs() / 86_400)
}

/// The date of a day after 1 January 1970 (proleptic Gregorian calendar).
fn date(days: u64) -> String {
    // Years begin in March, so that a leap day is the last one; 400 years have 146 097 days.
    let shifted = days + 719_468;
    let (era, day) = (shifted / 146_097, shifted % 146_097);
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (month, is_next) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    format!("{:04}-{month:02}-{day:02}", era * 400 + year + is_next)
}

#[cfg(test)]
mod tests;
