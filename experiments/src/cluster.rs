//! Job files that run a plan on a cluster, for five workload managers.
//!
//! A plan is divided into many more parts than there are workers, and each task of the job executes
//! one of them ([`crate::execute::Part`]): the workload manager balances the load, starts a task
//! again whose node has failed, and keeps the limits of its users. All tasks write into one shared
//! folder, so no merge is needed; the task that ends last writes the tables of all.
//!
//! The folder has everything but the binary `maes`, and its files name no absolute path, so it may
//! be moved before it is submitted. This module submits nothing.

mod templates;

use std::num::NonZero;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::execute::{self, ExecuteError, Transport};
use crate::plan::Plan;
use crate::store::{PLAN, Store, StoreError};

/// Most parts unless a number is given: arrays of Slurm have at most 1001 tasks unless its
/// administrator allows more.
const PARTS_MAX: usize = 1000;

/// The script that executes one part, for all workload managers.
const PART: &str = "part.sh";

/// A workload manager.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheduler {
    /// A job array for Slurm.
    Slurm,
    /// A job array for PBS Pro and OpenPBS.
    Pbs,
    /// A cluster of jobs for HTCondor.
    HtCondor,
    /// An indexed job for Kubernetes.
    K8s,
    /// GNU parallel, on one machine or several.
    Parallel,
}

/// The request to a workload manager.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Job {
    pub scheduler: Scheduler,
    /// Number of parts; if `None`, one for each run, and at most `PARTS_MAX`.
    pub parts: Option<NonZero<usize>>,
    /// Most tasks at a time.
    pub limit: Option<NonZero<usize>>,
    /// Greatest wall time of a task, s.
    pub time_s: Option<NonZero<u64>>,
    /// Memory of a task, MiB.
    pub memory_mib: NonZero<u64>,
    /// Partition or queue.
    pub partition: Option<String>,
    /// Account that is charged.
    pub account: Option<String>,
    /// Whether a task whose node or process has failed is started again.
    pub is_requeued: bool,
}

#[derive(Debug, Error)]
pub enum EmitError {
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The plan cannot be executed over this transport.
    #[error(transparent)]
    Execute(#[from] ExecuteError),
    /// A file of the plan would not be found on another machine.
    #[error("{0}: a file that the plan reads; expected a path relative to the plan, so that it can be copied with it")]
    Absolute(String),
    /// The workload manager has no such request.
    #[error("{flag} {value}: {reason}; leave it out")]
    Unknown { flag: &'static str, value: String, reason: &'static str },
}

/// Writes a plan, the files that it reads and a job into a folder; returns the path of the job.
///
/// # Errors
/// If the plan does not fit the transport or reads files with absolute paths, the workload manager
/// has no such request, or the folder cannot be used.
pub fn emit(plan: &Plan, folder: &Path, job: &Job, transport: &Transport) -> Result<PathBuf, EmitError> {
    execute::check(plan, transport)?;
    if let Some(path) = plan.inputs.absolute.iter().next() {
        return Err(EmitError::Absolute(path.display().to_string()));
    }
    let parts = job.parts.map_or(PARTS_MAX, NonZero::get).min(plan.runs.len());
    let (name, text) = templates::job(job, &plan.runs, parts)?;
    let store = Store::create(folder)?;
    store.save_plan(plan)?;
    store.make_folder(templates::LOGS)?;
    store.write(PART, templates::part(parts, transport.flags()).as_bytes())?;
    Ok(store.write(name, text.as_bytes())?)
}

#[cfg(test)]
mod tests;
