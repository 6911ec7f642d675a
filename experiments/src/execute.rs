//! Execution of a plan: its runs without a record, several in parallel.
//!
//! A completed run is a file in the folder, so an execution that was stopped or killed resumes with
//! the runs that are missing. No result depends on wall time.

mod memory;
mod parts;
mod ros;

use std::collections::BTreeSet;
use std::num::NonZero;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread;

use supervisor::{SupervisorError, outside};
use thiserror::Error;

use crate::plan::{BUILD, Plan, PlannedRun};
use crate::rows::{RunRecord, RunRow};
use crate::store::{Store, StoreError};

pub use parts::Part;
pub use ros::Launcher;

/// The transport between a server and its agents.
#[derive(Debug, Clone)]
pub enum Transport {
    /// All in this process.
    Memory,
    /// Over ROS 2, with a process for the server and for each agent.
    Ros2(Launcher),
}

#[derive(Debug, Clone)]
pub struct Options {
    /// Number of runs in parallel.
    pub jobs: NonZero<usize>,
    pub transport: Transport,
    pub part: Part,
    /// Whether to remove runs from the folder that are not of this plan and build. Otherwise they
    /// are an error.
    pub prune: bool,
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
         another folder, or remove them with --prune"
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
    #[error(transparent)]
    Program(#[from] SupervisorError),
}

/// Counts of the runs of an execution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Summary {
    /// Runs that had a record before.
    pub skipped: usize,
    /// Runs that got a record.
    pub done: usize,
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
/// other programs take part over ROS 2 only, and know their controllers.
///
/// # Errors
/// Names the key and the remedy.
pub fn check(plan: &Plan, transport: &Transport) -> Result<(), ExecuteError> {
    let mut checked = BTreeSet::new();
    for run in &plan.runs {
        let agents = &run.scenario.agents;
        let Some((key, value)) = agents.of_ros_only() else { continue };
        if matches!(transport, Transport::Memory) {
            let reason = "expected [] over memory, where no other program takes part; use --transport ros2";
            return Err(ExecuteError::Transport { key, value, reason });
        }
        if let Some(agent) = agents.cmd_vel.iter().find(|&&agent| !agents.is_commanded(agent)) {
            let reason = "nothing in a plan starts the node of this agent; name its program in agents.command";
            return Err(ExecuteError::Transport { key: "agents.cmd_vel", value: agent.to_string(), reason });
        }
        if checked.insert((&agents.command, &agents.controller, format!("{:?}", agents.set))) {
            outside::check(&run.scenario, &run.folder)?;
        }
    }
    Ok(())
}

/// Executes a plan in a folder, and writes its tables. A part writes them if no run is left in the
/// folder.
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
    check(plan, &options.transport)?;
    let store = Store::create(&folder)?;
    let done = store.done()?;
    prune(plan, &store, &done, options.prune)?;
    store.save_plan(plan)?;
    let mine = options.part.of(&plan.runs);
    let todo: Vec<&PlannedRun> = mine.iter().copied().filter(|run| !done.contains(&run.id)).collect();
    let mut summary = Summary { skipped: mine.len() - todo.len(), ..Summary::default() };
    observer.started(&mine, &todo);
    let executed = each(&todo, options, stop, |run, record| {
        match record {
            Ok(record) => {
                store.save(&record)?;
                summary.done += 1;
                observer.completed(run, &record.row);
            }
            Err(RunFailure::Interrupted) => {}
            Err(RunFailure::Failed(reason)) => {
                summary.failed += 1;
                observer.failed(run, &reason);
            }
        }
        Ok(())
    });
    observer.ended();
    executed?;
    summary.left = todo.len() - summary.done - summary.failed;
    // Thousands of parts would each read all runs. The part that ends last sees that all are done.
    let is_whole = options.part == Part::WHOLE;
    if is_whole || store.done()?.len() == plan.runs.len() {
        store.write_tables()?;
    }
    Ok(summary)
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
        _ => Ok(others.into_iter().try_for_each(|id| store.remove(id))?),
    }
}

/// Performs runs on as many threads as there are jobs, and passes each record to `take`.
fn each(
    todo: &[&PlannedRun],
    options: &Options,
    stop: &Stop,
    mut take: impl FnMut(&PlannedRun, Result<RunRecord, RunFailure>) -> Result<(), StoreError>,
) -> Result<(), StoreError> {
    let next = AtomicUsize::new(0);
    let (sender, records) = channel();
    let jobs = options.jobs.get();
    thread::scope(|scope| {
        for job in 0..jobs.min(todo.len()) {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                while !stop.soon.load(Ordering::Relaxed)
                    && let Some(&run) = todo.get(next.fetch_add(1, Ordering::Relaxed))
                {
                    let record = match &options.transport {
                        Transport::Memory => memory::carry_out(run, &stop.at_once),
                        Transport::Ros2(launcher) => launcher.carry_out(run, (job, jobs), &stop.at_once),
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

#[cfg(test)]
mod tests;
