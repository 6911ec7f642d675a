//! Carries out what is left of a plan, several runs at a time.
//!
//! A run that is done is a file in the folder, so a plan goes on where it was ended, however that was. Wall time decides nothing
//! but what people are shown.

mod display;
mod memory;
mod ros;

use std::collections::BTreeSet;
use std::num::NonZero;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread;

use thiserror::Error;

use crate::plan::{BUILD, Plan, PlannedRun};
use crate::rows::RunRecord;
use crate::store::{PLAN, Store, StoreError};

use display::Display;

pub use ros::Launcher;

/// How messages go between a server and its agents.
#[derive(Debug, Clone)]
pub enum Transport {
    /// In this process.
    Memory,
    /// Over ROS 2, in a process for each.
    Ros2(Launcher),
}

/// A part of a plan: of so many parts, which one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// From 0.
    pub index: usize,
    /// How many there are.
    pub parts: NonZero<usize>,
}

impl Part {
    /// The whole plan.
    pub const WHOLE: Self = Self { index: 0, parts: NonZero::<usize>::MIN };
}

/// How a plan is carried out.
#[derive(Debug, Clone)]
pub struct Options {
    /// How many runs at a time.
    pub jobs: NonZero<usize>,
    /// Over what.
    pub transport: Transport,
    /// Which part of it.
    pub part: Part,
    /// Whether runs in the folder that are not of this plan and build are taken out. Otherwise they are an error.
    pub prune: bool,
}

/// What ends the carrying out of a plan early.
#[derive(Debug, Default)]
pub struct Stop {
    /// No new run is begun.
    pub soon: AtomicBool,
    /// Runs in flight are given up, too.
    pub at_once: AtomicBool,
}

/// Why a run has no record.
#[derive(Debug, Error)]
pub enum RunFailure {
    /// It was given up, because [`Stop::at_once`] was set.
    #[error("interrupted")]
    Interrupted,
    /// It cannot be set up or carried out.
    #[error("{0}")]
    Failed(String),
}

/// Why a plan cannot be carried out.
#[derive(Debug, Error)]
pub enum ExecuteError {
    /// The folder cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The folder has other runs.
    #[error(
        "{folder}: holds {count} runs that are not of this plan and this build ({BUILD}), such as {example}: choose another \
         folder, or take them out with --prune"
    )]
    OtherRuns {
        /// Which.
        folder: String,
        /// How many.
        count: usize,
        /// The id of one.
        example: String,
    },
}

/// What became of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Summary {
    /// Runs that were there already.
    pub skipped: usize,
    /// Runs that were carried out.
    pub done: usize,
    /// Runs that failed.
    pub failed: usize,
    /// Runs that were not begun or not ended.
    pub left: usize,
}

/// Carries out a plan in a folder, and makes its tables.
///
/// A run that fails is reported on stderr and left out; the others go on.
///
/// # Errors
/// If the folder cannot be used.
pub fn execute(plan: &Plan, folder: PathBuf, options: &Options, stop: &Stop) -> Result<Summary, ExecuteError> {
    let store = Store::create(&folder)?;
    let done = store.done()?;
    prune(plan, &store, &done, options.prune)?;
    store.write(PLAN, plan.text.as_bytes())?;
    let Part { index, parts } = options.part;
    let mine: Vec<&PlannedRun> = plan.runs.iter().skip(index).step_by(parts.get()).collect();
    let todo: Vec<&PlannedRun> = mine.iter().copied().filter(|run| !done.contains(&run.id)).collect();
    let mut summary = Summary { skipped: mine.len() - todo.len(), ..Summary::default() };
    let mut display = Display::new(&mine, &todo);
    let carried_out = each(&todo, options, stop, |run, record| {
        match record {
            Ok(record) => {
                store.keep(&record)?;
                summary.done += 1;
                display.done(run, &record.row);
            }
            Err(RunFailure::Interrupted) => {}
            Err(RunFailure::Failed(reason)) => {
                summary.failed += 1;
                display.failed(run, &reason);
            }
        }
        Ok(())
    });
    display.end();
    carried_out?;
    summary.left = todo.len() - summary.done - summary.failed;
    store.write_tables()?;
    Ok(summary)
}

fn prune(plan: &Plan, store: &Store, done: &BTreeSet<String>, take_out: bool) -> Result<(), ExecuteError> {
    let planned: BTreeSet<&String> = plan.runs.iter().map(|run| &run.id).collect();
    let others: Vec<&String> = done.iter().filter(|id| !planned.contains(id)).collect();
    match others.first() {
        Some(example) if !take_out => Err(ExecuteError::OtherRuns {
            folder: store.folder().display().to_string(),
            count: others.len(),
            example: (*example).clone(),
        }),
        _ => Ok(others.into_iter().try_for_each(|id| store.remove(id))?),
    }
}

/// Carries out runs on as many threads as there are jobs, and hands over each record when it is there.
fn each(
    todo: &[&PlannedRun],
    options: &Options,
    stop: &Stop,
    mut take: impl FnMut(&PlannedRun, Result<RunRecord, RunFailure>) -> Result<(), StoreError>,
) -> Result<(), StoreError> {
    let next = AtomicUsize::new(0);
    let (sender, records) = channel();
    thread::scope(|scope| {
        for job in 0..options.jobs.get().min(todo.len()) {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                while !stop.soon.load(Ordering::Relaxed)
                    && let Some(&run) = todo.get(next.fetch_add(1, Ordering::Relaxed))
                {
                    let record = match &options.transport {
                        Transport::Memory => memory::carry_out(run, &stop.at_once),
                        Transport::Ros2(launcher) => launcher.carry_out(run, job, &stop.at_once),
                    };
                    // Nobody takes it if a record could not be kept; then the others are given up as well.
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

/// The processor of this machine and how many cores may be used.
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
