//! Deterministic simulation of a whole run under faults, after FoundationDB and TigerBeetle:
//! server, agents, recorder and resumed servers run in one thread, over a simulated network and
//! disk, in virtual time.
//!
//! A seed determines a small scenario, an adversary, and every event. The server runs the session
//! of the real process, the agents its host; only the transport, the clock and the file below the
//! recorder are simulated. The recording must equal that of the same run over the in-memory
//! transport, message for message, and byte for byte unless the server has refused and counted
//! messages.
//!
//! Invariants: the same seed gives the same events; no result depends on the machine, its load or
//! the number of threads, each of which executes whole seeds.
//!
//! Not simulated: ROS 2, the processes of the system, and the real file system
//! ([`crate::run`] has these); services of the server, and observers.

mod adversary;
mod cluster;
mod disk;
mod memory_file;
mod messages;
mod network;
mod scenarios;
pub mod trace;

use std::num::NonZero;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use recording::Recording;
use recording::recorder::Recorder;
use sim_server::session::NullObserver;
use sim_server::setup;
use simulation::scenario::Scenario;
use system::wall_clock;

use crate::verdict::{self, Equivalence};
pub use adversary::Mutation;
use cluster::Cluster;
use in_memory::in_process::{self, AgentOptions, ThreadLayout};
use memory_file::MemoryFile;
pub use network::Counts;

/// Wall time between two reports of progress.
const REPORT_PERIOD: Duration = Duration::from_secs(10);

/// Failures after which no more seeds are tried.
const FAILURES_MAX: usize = 20;

/// What to simulate.
#[derive(Debug, Clone)]
pub struct Options {
    pub first_seed: u64,
    /// Number of seeds.
    pub seeds: u64,
    /// Number of threads.
    pub jobs: NonZero<usize>,
}

/// What came of many seeds.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Summary {
    /// Number of simulated seeds.
    pub seeds: u64,
    /// The seeds whose run was not the undisturbed one, in no order.
    pub failures: Vec<u64>,
    /// What happened in all of them.
    pub counts: Counts,
    pub is_interrupted: bool,
}

/// What came of a seed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SeedReport {
    /// How the run equals the undisturbed one, or why it does not.
    pub verdict: Result<Equivalence, String>,
    pub counts: Counts,
    /// The events, each with its virtual time; none unless a log was asked for.
    pub log: Vec<String>,
}

/// Simulates many seeds, and passes a line on each failure, and on the progress, to `report`.
pub fn run(options: &Options, stop: &AtomicBool, report: &(dyn Fn(&str) + Sync)) -> Summary {
    let begun = wall_clock::now();
    let next = AtomicU64::new(0);
    let progress = Mutex::new((Summary::default(), begun));
    thread::scope(|scope| {
        for _ in 0..options.jobs.get() {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= options.seeds {
                        return;
                    }
                    let seed = options.first_seed.wrapping_add(number);
                    let SeedReport { verdict, counts, .. } = of_seed(seed, None, false);
                    let (summary, reported) = &mut *progress.lock().unwrap_or_else(PoisonError::into_inner);
                    summary.seeds += 1;
                    summary.counts.add(&counts);
                    if let Err(reason) = verdict {
                        summary.failures.push(seed);
                        report(&format!("seed {seed}: FAILED: {reason}; its events: {}", again(seed)));
                        if summary.failures.len() >= FAILURES_MAX {
                            next.store(options.seeds, Ordering::Relaxed);
                        }
                    }
                    if reported.elapsed() >= REPORT_PERIOD {
                        *reported = wall_clock::now();
                        report(&progress_line(summary, options.seeds, begun));
                    }
                }
            });
        }
    });
    let (mut summary, _) = progress.into_inner().unwrap_or_else(PoisonError::into_inner);
    summary.is_interrupted = stop.load(Ordering::Relaxed);
    summary
}

fn progress_line(summary: &Summary, seeds: u64, begun: Instant) -> String {
    let per_minute = summary.seeds as f64 * 60.0 / begun.elapsed().as_secs_f64().max(1e-3);
    let failures = summary.failures.len();
    format!("{} of {seeds} seeds, {failures} failures, {per_minute:.0} seeds a minute", summary.seeds)
}

/// The command that prints the events of a seed.
#[must_use]
pub fn again(seed: u64) -> String {
    format!("maes faults --simulated --seed-only {seed} --log")
}

/// Simulates one seed, if wanted with a broken promise, and with the log of its events.
#[must_use]
pub fn of_seed(seed: u64, mutation: Option<Mutation>, keeps_log: bool) -> SeedReport {
    match scenarios::of_seed(seed) {
        Ok(scenario) => execute(Cluster::new(seed, &scenario, mutation, keeps_log), &scenario),
        Err(error) => SeedReport { verdict: Err(error.to_string()), counts: Counts::default(), log: Vec::new() },
    }
}

/// Executes the processes of a run, and compares it with the undisturbed one.
fn execute(mut cluster: Cluster<'_>, scenario: &Scenario) -> SeedReport {
    let mut report = SeedReport { verdict: Err(String::new()), counts: Counts::default(), log: Vec::new() };
    let found = catch_unwind(AssertUnwindSafe(|| cluster.run()));
    {
        let mut network = cluster.network.borrow_mut();
        report.counts = network.counts;
        report.log = network.take_log();
    }
    report.verdict = match found {
        Ok(found) => found.and_then(|found| compare(&undisturbed(scenario)?, found)),
        Err(panic) => Err(format!("a panic: {}", panic_text(&*panic))),
    };
    if let Ok(Equivalence::ExceptRefusals(refused)) = report.verdict {
        report.counts.refused = refused;
    }
    report
}

fn compare(expected: &Recording, found: Vec<u8>) -> Result<Equivalence, String> {
    let found = Recording::from_bytes("the recording".to_owned(), found).map_err(|error| error.to_string())?;
    verdict::compare_recordings(expected, &found)
}

/// The recording of the run without faults, over the in-memory transport.
fn undisturbed(scenario: &Scenario) -> Result<Recording, String> {
    let failed = |error: &dyn std::fmt::Display| format!("the undisturbed run: {error}");
    let (world, _) = setup::build(scenario).map_err(|error| failed(&error))?;
    let file = MemoryFile::default();
    let recorder = setup::with_documents(scenario, &world, |documents| {
        Recorder::create_in(file.clone(), Path::new("the undisturbed run"), documents)
    });
    let recorder = recorder.map_err(|error| failed(&error))?;
    let options = AgentOptions { threads: ThreadLayout::Together, ..AgentOptions::default() };
    let never = AtomicBool::new(false);
    in_process::run_in(scenario, world, Some(recorder.into()), &options, &mut NullObserver, &never)
        .map_err(|error| failed(&error))?;
    Recording::from_bytes("the undisturbed run".to_owned(), file.bytes()).map_err(|error| failed(&error))
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default()
}

#[cfg(test)]
mod tests;
