//! The commands about plans: what the user types, and what it sets going.

pub(crate) mod faults;
#[cfg(feature = "view")]
pub(crate) mod movie;
mod progress;

use std::io::Write;
use std::num::NonZero;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use experiments::cluster::{self, Scheduler};
use experiments::diff;
use experiments::execute::{self, ExecuteError, Launcher, Options, Part, Stop, Summary, Transport};
use experiments::faults::FaultsError;
use experiments::merge;
use experiments::plan::{BUILD, Plan};
use experiments::report::{self, ReportError, Written};
use experiments::store::{Store, StoreError};
use progress::ProgressDisplay;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use sim_server::exit;
use sim_server::recording::Recording;

/// Arguments of `run`.
#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// The plan (.toml)
    plan: PathBuf,
    /// The folder for its runs and tables; runs that are there already are not made again
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Runs at a time [default: one for each core; over ROS 2: 1]
    #[arg(long, value_name = "N")]
    jobs: Option<NonZero<usize>>,
    /// How messages go between a server and its agents
    #[arg(long, value_enum, default_value_t = TransportName::Memory)]
    transport: TransportName,
    /// Only every N-th run, from the K-th on, K from 0
    #[arg(long, value_name = "K/N", value_parser = part)]
    part: Option<Part>,
    /// Take out runs in the folder that are not of this plan and build
    #[arg(long)]
    prune: bool,
    /// Run nothing; write a job into the folder that carries out the plan on a cluster
    #[arg(long, value_enum, value_name = "SYSTEM")]
    emit: Option<SchedulerName>,
    /// With --emit: how many jobs share the plan
    #[arg(long, value_name = "N", default_value = "16", requires = "emit")]
    parts: NonZero<usize>,
    /// Over ROS 2: the domain of the first run at a time; the others have the next ones
    #[arg(long, value_name = "ID", default_value_t = 1, value_parser = clap::value_parser!(u32).range(0..=101))]
    first_domain: u32,
    /// Over ROS 2: the script that starts a run
    #[arg(long, value_name = "FILE", default_value = "launch_scripts/run.sh")]
    launcher: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum TransportName {
    /// In this process
    Memory,
    /// Over ROS 2, a process for each agent
    Ros2,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SchedulerName {
    /// A job array for Slurm: sbatch plan.slurm.sh
    Slurm,
    /// An indexed job for Kubernetes: kubectl apply -f plan.k8s.yaml
    K8s,
}

impl From<SchedulerName> for Scheduler {
    fn from(name: SchedulerName) -> Self {
        match name {
            SchedulerName::Slurm => Self::Slurm,
            SchedulerName::K8s => Self::K8s,
        }
    }
}

/// Arguments of `merge`.
#[derive(Debug, Args)]
pub(crate) struct MergeArgs {
    /// Folders of one plan
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// The folder that gets all their runs, and the tables; may be one of them
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Arguments of `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// The folder of a plan
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// Arguments of `diff`.
#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// A recording (.mcap)
    first: PathBuf,
    /// Another one (.mcap)
    second: PathBuf,
}

fn part(text: &str) -> Result<Part, String> {
    let expected = || "expected K/N, such as 0/4, with K from 0 to N - 1".to_owned();
    let (index, parts) = text.split_once('/').ok_or_else(expected)?;
    let part = index.parse().ok().zip(parts.parse().ok()).map(|(index, parts)| Part { index, parts });
    part.filter(|part| part.index < part.parts.get()).ok_or_else(expected)
}

/// Whether an error is the system's fault, not that of what was typed.
pub(crate) fn is_failure(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref::<ExecuteError>(), Some(ExecuteError::Store(_)))
        || error.downcast_ref::<StoreError>().is_some()
        || matches!(error.downcast_ref::<FaultsError>(), Some(FaultsError::Write { .. }))
        || matches!(error.downcast_ref::<ReportError>(), Some(ReportError::Png { .. } | ReportError::Write { .. }))
}

/// Carries out what is left of a plan.
pub(crate) fn run(args: &RunArgs) -> anyhow::Result<ExitCode> {
    let plan = Plan::load(&args.plan)?;
    if let Some(scheduler) = args.emit {
        let file = cluster::emit(&plan, &args.out, scheduler.into(), args.parts)?;
        say(&format!("{}", file.display()));
        return Ok(ExitCode::SUCCESS);
    }
    let cores = thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
    let (transport, jobs) = match args.transport {
        TransportName::Memory => (Transport::Memory, cores),
        TransportName::Ros2 => (Transport::Ros2(launcher(args)?), NonZero::<usize>::MIN),
    };
    let jobs = args.jobs.unwrap_or(jobs);
    let options = Options { jobs, transport, part: args.part.unwrap_or(Part::WHOLE), prune: args.prune };
    let stop = Arc::new(Stop::default());
    let mut signals = Signals::new([SIGINT, SIGTERM]).context("handling signals")?;
    let handle = signals.handle();
    let summary = thread::scope(|scope| {
        scope.spawn(|| {
            for _ in signals.forever() {
                if stop.soon.swap(true, Ordering::Relaxed) {
                    stop.at_once.store(true, Ordering::Relaxed);
                } else {
                    eprintln!("ending after the runs in flight; once more to give them up");
                }
            }
        });
        let summary = execute::execute(&plan, args.out.clone(), &options, &mut ProgressDisplay::default(), &stop);
        handle.close();
        summary
    })?;
    let Summary { skipped, done, failed, left } = summary;
    say(&format!("{done} runs done, {skipped} were there already, {failed} failed, {left} left; build {BUILD}"));
    say(&format!("{}", args.out.join("runs.csv").display()));
    Ok(match summary {
        Summary { left: 1.., .. } => ExitCode::from(exit::BY_SIGNAL),
        Summary { failed: 1.., .. } => ExitCode::from(exit::FAILED),
        _ => ExitCode::SUCCESS,
    })
}

fn launcher(args: &RunArgs) -> anyhow::Result<Launcher> {
    if !args.launcher.is_file() {
        bail!("--launcher {}: no such file; it is launch_scripts/run.sh of the repository", args.launcher.display());
    }
    let binary = std::env::current_exe().context("finding the folder of the binaries")?;
    let binaries = binary.parent().context("finding the folder of the binaries")?.to_owned();
    let script = args.launcher.canonicalize().with_context(|| args.launcher.display().to_string())?;
    Ok(Launcher { script, binaries, first_domain: args.first_domain })
}

/// Joins folders.
pub(crate) fn merge(args: &MergeArgs) -> anyhow::Result<ExitCode> {
    let runs = merge::merge(&args.folders, &args.out)?;
    say(&format!("{runs} runs in {}", args.out.join("runs.csv").display()));
    Ok(ExitCode::SUCCESS)
}

/// Makes the report of a folder, and its tables of all runs.
pub(crate) fn report(args: &ReportArgs) -> anyhow::Result<ExitCode> {
    let Written { page, runs, lacking } = report::write(&args.folder)?;
    Store::open(&args.folder)?.write_tables()?;
    let lacking = if lacking > 0 { format!(", {lacking} lacking for a whole comparison") } else { String::new() };
    say(&format!("{runs} runs{lacking}"));
    say(&format!("{}", page.display()));
    Ok(ExitCode::SUCCESS)
}

/// Compares two recordings.
pub(crate) fn diff(args: &DiffArgs) -> anyhow::Result<ExitCode> {
    let (first, second) = (Recording::open(&args.first)?, Recording::open(&args.second)?);
    let verdict = diff::diff(&first, &second);
    say(&diff::text(&verdict, &first, &second));
    Ok(if verdict.is_same_run() { ExitCode::SUCCESS } else { ExitCode::from(exit::DIFFERENT) })
}

/// Results go to stdout; that nobody listens is no failure.
fn say(text: &str) {
    drop(writeln!(std::io::stdout(), "{text}"));
}
