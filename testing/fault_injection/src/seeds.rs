//! The runs of all seeds, each with the faults of its plan, and their verdicts.

use std::fs;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use sim_server::session::NullObserver;
use simulation::scenario::{OnAgentLoss, Rtf, Scenario};
use supervisor::SupervisorError;
use supervisor::domain::DomainLock;
use thiserror::Error;

use super::fault_run::{self, Bench, Failure};
use super::plan::Plan;
use super::verdict::{self, Equivalence};
use in_memory::in_process::{self, AgentOptions, InProcessError, ThreadLayout};

#[derive(Debug, Clone)]
pub struct Options {
    /// The run to disturb, with its `[execution]`.
    pub scenario: Scenario,
    /// Seeds of the fault plans.
    pub seeds: Vec<u64>,
    /// Number of runs in parallel.
    pub jobs: NonZero<usize>,
    /// The folder of the executables.
    pub binaries: PathBuf,
    /// ROS domain of the first parallel run; the others use the next ones.
    pub first_domain: u32,
    /// The folder for all recordings and logs; without it, those of failures are kept in a
    /// temporary folder.
    pub out: Option<PathBuf>,
    /// The recording to compare with instead of that of the undisturbed run.
    pub expected: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Number of runs with a verdict.
    pub seeds: usize,
    /// Number of runs that differ from the undisturbed one.
    pub failures: usize,
    pub is_interrupted: bool,
}

#[derive(Debug, Error)]
pub enum FaultsError {
    /// The run would end with the first agent that is killed.
    #[error("faults.on_agent_loss: expected \"wait\", because agents are killed")]
    NotWaiting,
    /// The undisturbed run has no result.
    #[error("the undisturbed run: {0}")]
    Undisturbed(#[from] InProcessError),
    #[error("{file}: {source}")]
    Write {
        /// Which.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A domain cannot be had.
    #[error(transparent)]
    Domain(#[from] SupervisorError),
    /// The expected recording cannot be read.
    #[error("{0}")]
    Expected(String),
}

/// Performs the run with the faults of each seed, and passes a line on each to `report`.
///
/// # Errors
/// If there is nothing to compare with, or no run can be started.
pub fn run(options: &Options, stop: &AtomicBool, report: &(dyn Fn(&str) + Sync)) -> Result<Summary, FaultsError> {
    let scenario = &options.scenario;
    if scenario.faults.on_agent_loss != OnAgentLoss::Wait {
        return Err(FaultsError::NotWaiting);
    }
    let temporary = tempfile::tempdir().map_err(|source| write_error(&std::env::temp_dir(), source))?;
    let folder = options.out.as_deref().unwrap_or(temporary.path());
    fs::create_dir_all(folder).map_err(|source| write_error(folder, source))?;
    let file = folder.join("scenario.toml");
    fs::write(&file, scenario.to_toml()).map_err(|source| write_error(&file, source))?;
    let expected = match &options.expected {
        Some(file) => file.clone(),
        None => undisturbed(scenario, &folder.join("expected.mcap"))?,
    };
    let digest = verdict::digest(&expected).map_err(FaultsError::Expected)?;
    report(&format!("expected digest: {digest}"));
    let domains = (0..options.jobs.get() as u32).map(|job| (options.first_domain + job).to_string());
    let locks: Vec<DomainLock> = domains.map(|domain| DomainLock::take(&domain)).collect::<Result<_, _>>()?;
    let counts = [const { AtomicUsize::new(0) }; 3];
    let [next, done, failed] = &counts;
    thread::scope(|scope| {
        for job in 0..locks.len() as u32 {
            let (expected, file) = (&expected, &file);
            scope.spawn(move || {
                while let Some(&seed) = options.seeds.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let folder = folder.join(format!("seed-{seed}"));
                    let bench = Bench {
                        binaries: &options.binaries,
                        scenario: file,
                        folder: &folder,
                        domain: options.first_domain + job,
                        agents: scenario.agents.count,
                        rtf: if let Rtf::Limit(pace) = scenario.execution.rtf { pace } else { 0.0 },
                        stop,
                    };
                    let plan = plan_of(scenario, seed);
                    let (is_same, verdict) = match judge(&bench, &plan, expected) {
                        Ok(equivalence) => (true, equivalence.to_string()),
                        Err(Failure::Interrupted) => return,
                        Err(Failure::Failed(reason)) => {
                            failed.fetch_add(1, Ordering::Relaxed);
                            let kept = folder.display();
                            (false, format!("FAILED: {reason}; logs: {kept}; again: {}", again(file, seed)))
                        }
                    };
                    done.fetch_add(1, Ordering::Relaxed);
                    report(&format!("seed {seed}: {plan}: {verdict}"));
                    if is_same && options.out.is_none() {
                        // What cannot be removed here is removed with the temporary folder.
                        drop(fs::remove_dir_all(&folder));
                    }
                }
            });
        }
    });
    let [_, seeds, failures] = counts.map(AtomicUsize::into_inner);
    if failures > 0 {
        // It holds the recordings and logs of the failures.
        let _kept = temporary.keep();
    }
    Ok(Summary { seeds, failures, is_interrupted: stop.load(Ordering::Relaxed) })
}

/// The fault plan of a seed for a scenario.
#[must_use]
pub fn plan_of(scenario: &Scenario, seed: u64) -> Plan {
    let duration_s = scenario.duration_ticks().time_ns() as f64 * 1e-9;
    // Faults are not spread over more than a minute.
    let timeout_ms = (scenario.execution.decision_timeout_s.min(60.0) * 1e3) as u32;
    Plan::of_seed(seed, scenario.agents.count, duration_s, timeout_ms.max(2))
}

fn again(scenario: &Path, seed: u64) -> String {
    format!("maes faults {} --seed-only {seed}", scenario.display())
}

fn judge(bench: &Bench<'_>, plan: &Plan, expected: &Path) -> Result<Equivalence, Failure> {
    fs::create_dir_all(bench.folder)?;
    let recording = fault_run::execute(bench, plan)?;
    let digests = verdict::digest(expected).and_then(|digest| Ok((digest, verdict::digest(&recording)?)));
    let (before, now) = digests.map_err(Failure::Failed)?;
    if before != now {
        return Err(Failure::Failed(format!("the digest is {now}")));
    }
    verdict::compare(expected, &recording).map_err(Failure::Failed)
}

/// Records the run without faults, in this process and without a real-time limit.
fn undisturbed(scenario: &Scenario, file: &Path) -> Result<PathBuf, FaultsError> {
    let mut scenario = scenario.clone();
    scenario.execution.record = Some(file.to_owned());
    scenario.execution.rtf = Rtf::MAX;
    let options = AgentOptions { threads: ThreadLayout::Together, ..AgentOptions::default() };
    in_process::run(&scenario, &options, &mut NullObserver, &AtomicBool::new(false))?;
    Ok(file.to_owned())
}

fn write_error(file: &Path, source: std::io::Error) -> FaultsError {
    FaultsError::Write { file: file.display().to_string(), source }
}
