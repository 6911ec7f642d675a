//! Runs that are disturbed, one for each seed, and whether each is the undisturbed run all the same.
//!
//! A [`plan`] of faults is drawn from a seed; the run is carried out over ROS 2 with a process for each agent, which are killed,
//! stopped, started twice and lied to as the plan says; [`verdict`] compares what came of it with the same run over memory.
//!
//! Invariants: a seed has one plan; no process outlives its run; wall time positions faults, and a hang is a failure, but
//! nothing else hangs on it.

mod carry_out;
#[cfg(feature = "ros")]
pub mod garbage;
pub mod plan;
pub mod verdict;
mod watch;

use std::fs::{self, File, TryLockError};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use sim_server::session::NullObserver;
use simulation::scenario::{OnAgentLoss, Rtf, Scenario};
use thiserror::Error;

use crate::single::{self, Grouping, SingleError, Team};
use carry_out::{Bench, Failure};
use plan::Plan;
use verdict::Sameness;

/// What is disturbed.
#[derive(Debug, Clone)]
pub struct Options {
    /// The run, with its `[execution]`.
    pub scenario: Scenario,
    /// Of the faults.
    pub seeds: Vec<u64>,
    /// How many runs at a time.
    pub jobs: NonZero<usize>,
    /// The folder of the binaries.
    pub binaries: PathBuf,
    /// ROS domain of the first run at a time; the others have the next ones.
    pub first_domain: u32,
    /// Where recordings and logs are kept; otherwise only those of failures are.
    pub out: Option<PathBuf>,
    /// The recording that is expected, if not that of the undisturbed run.
    pub expected: Option<PathBuf>,
}

/// What came of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Runs that have a verdict.
    pub seeds: usize,
    /// Those that were not the undisturbed one.
    pub failures: usize,
    /// Whether somebody ended it early.
    pub is_interrupted: bool,
}

/// Why nothing can be said.
#[derive(Debug, Error)]
pub enum FaultsError {
    /// The run would not survive what is done to it.
    #[error("faults.on_agent_loss = {0:?}: expected wait, for agents are killed")]
    NotWaiting(OnAgentLoss),
    /// The undisturbed run does not come about.
    #[error("the undisturbed run: {0}")]
    Undisturbed(#[from] SingleError),
    /// A file or a folder cannot be written.
    #[error("{file}: {source}")]
    Write {
        /// Which.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A run is under way in a domain.
    #[error("a run is under way in ROS domain {0}; choose another --first-domain")]
    DomainTaken(u32),
    /// The expected recording cannot be read.
    #[error("{0}")]
    Expected(String),
}

/// Carries out the run with the faults of each seed; `say` is given a line for each.
///
/// # Errors
/// If nothing can be said about any of them.
pub fn run(options: &Options, stop: &AtomicBool, say: &(dyn Fn(&str) + Sync)) -> Result<Summary, FaultsError> {
    let scenario = &options.scenario;
    if scenario.faults.on_agent_loss != OnAgentLoss::Wait {
        return Err(FaultsError::NotWaiting(scenario.faults.on_agent_loss));
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
    say(&format!("expected digest: {digest}"));
    let locks: Vec<File> =
        (0..options.jobs.get() as u32).map(|job| lock_domain(options.first_domain + job)).collect::<Result<_, _>>()?;
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
                        pace: if let Rtf::Limit(pace) = scenario.execution.rtf { pace } else { 0.0 },
                        stop,
                    };
                    let plan = plan_of(scenario, seed);
                    let verdict = match judge(&bench, &plan, expected) {
                        Ok(Sameness::Bytes) => "same, byte for byte".to_owned(),
                        Ok(Sameness::Refusals(count)) => format!("same, {count} messages refused"),
                        Err(Failure::Interrupted) => return,
                        Err(Failure::Failed(reason)) => {
                            failed.fetch_add(1, Ordering::Relaxed);
                            let kept = folder.display();
                            format!("FAILED: {reason}; logs: {kept}; again: {}", again(file, seed))
                        }
                    };
                    let is_same = verdict.starts_with("same");
                    done.fetch_add(1, Ordering::Relaxed);
                    say(&format!("seed {seed}: {plan}: {verdict}"));
                    if is_same && options.out.is_none() {
                        // What is left over is removed with the folder of all.
                        drop(fs::remove_dir_all(&folder));
                    }
                }
            });
        }
    });
    let [_, seeds, failures] = counts.map(AtomicUsize::into_inner);
    if failures > 0 {
        // It has what failures are looked into with.
        let _kept = temporary.keep();
    }
    Ok(Summary { seeds, failures, is_interrupted: stop.load(Ordering::Relaxed) })
}

/// The faults of a seed.
#[must_use]
pub fn plan_of(scenario: &Scenario, seed: u64) -> Plan {
    let duration_s = scenario.duration_ticks().time_ns() as f64 * 1e-9;
    // A minute is more than anybody waits for.
    let timeout_ms = (scenario.execution.decision_timeout_s.min(60.0) * 1e3) as u32;
    Plan::of_seed(seed, scenario.agents.count, duration_s, timeout_ms.max(2))
}

fn again(scenario: &Path, seed: u64) -> String {
    format!("experiments faults {} --seed-only {seed}", scenario.display())
}

fn judge(bench: &Bench<'_>, plan: &Plan, expected: &Path) -> Result<Sameness, Failure> {
    fs::create_dir_all(bench.folder)?;
    let recording = carry_out::carry_out(bench, plan)?;
    let digests = verdict::digest(expected).and_then(|digest| Ok((digest, verdict::digest(&recording)?)));
    let (before, now) = digests.map_err(Failure::Failed)?;
    if before != now {
        return Err(Failure::Failed(format!("the digest is {now}")));
    }
    verdict::compare(expected, &recording).map_err(Failure::Failed)
}

/// Carries out the run without faults, over memory and as fast as it goes.
fn undisturbed(scenario: &Scenario, file: &Path) -> Result<PathBuf, FaultsError> {
    let mut scenario = scenario.clone();
    scenario.execution.record = Some(file.to_owned());
    scenario.execution.rtf = Rtf::MAX;
    let team = Team { grouping: Grouping::Together, chaos_delay: Duration::ZERO, decision_times: None };
    single::run(&scenario, &team, &mut NullObserver, &AtomicBool::new(false))?;
    Ok(file.to_owned())
}

/// Tells `run.sh`, and other processes of this kind, that the domain is taken.
fn lock_domain(domain: u32) -> Result<File, FaultsError> {
    let file = std::env::temp_dir().join(format!("maes-domain-{domain}.lock"));
    let lock = File::create(&file).map_err(|source| write_error(&file, source))?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(TryLockError::WouldBlock) => Err(FaultsError::DomainTaken(domain)),
        Err(TryLockError::Error(source)) => Err(write_error(&file, source)),
    }
}

fn write_error(file: &Path, source: std::io::Error) -> FaultsError {
    FaultsError::Write { file: file.display().to_string(), source }
}
