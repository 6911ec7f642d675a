//! Commands about plans: `batch`, `merge`, `report`.

use std::collections::BTreeSet;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;

use agent_node::controllers::Registry;
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use experiments::benchmark::BenchmarkError;
use experiments::cluster::{self, EmitError, Job, Scheduler};
#[cfg(feature = "ros")]
use experiments::execute::Launcher;
use experiments::execute::{self, ExecuteError, Options, Part, Selection, Stop, Summary, Transport};
use experiments::merge;
use experiments::plan::{BUILD, Plan};
use experiments::retained_recordings::Keep;
use experiments::store::{PLAN, Store, StoreError};
use report::regression::{self, RegressionMeasure};
use report::{Heading, ReportError, ReportSummary, routes};
use sim_server::cli::{positive, whole};
use sim_server::{exit, setup};

use crate::output::print;
use crate::progress::ProgressDisplay;
use crate::signals;

/// Arguments of `batch`.
#[derive(Debug, Args)]
pub(crate) struct BatchArgs {
    /// The plan (.toml)
    plan: PathBuf,
    /// The folder for its runs and tables; runs that are there already are skipped
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Runs in parallel [default: one for each core; over ROS 2: 1]
    #[arg(long, value_name = "N", value_parser = positive)]
    jobs: Option<NonZero<usize>>,
    /// How messages go between a server and its agents
    #[arg(long, value_enum, default_value_t = TransportName::Memory)]
    transport: TransportName,
    /// Only part K, from 0, of N parts of about equal cost
    #[arg(long, value_name = "K/N", value_parser = part)]
    part: Option<Part>,
    /// Remove runs from the folder that are not of this plan and build
    #[arg(long)]
    prune: bool,
    /// Only the run with this id, and others that are named in the same way
    #[arg(long, value_name = "ID")]
    run: Vec<String>,
    /// Which recordings to keep, in the folder `recordings`
    #[arg(long, value_enum, value_name = "WHICH", default_value_t = KeepName::None)]
    keep: KeepName,
    /// Make the report as well once all runs are done, as `maes report` does
    #[arg(long, conflicts_with_all = ["emit", "part", "run"])]
    report: bool,
    /// Run nothing; write a job into the folder that runs the plan on a cluster
    #[arg(long, value_enum, value_name = "SYSTEM")]
    emit: Option<SchedulerName>,
    #[command(flatten, next_help_heading = "With --emit")]
    job: JobArgs,
    /// Over ROS 2: the domain of the first parallel run; the others use the next ones
    #[arg(long, value_name = "ID", default_value_t = 1, value_parser = whole::<u32>(0..=101))]
    first_domain: u32,
}

/// What a workload manager is asked for.
#[derive(Debug, Args)]
struct JobArgs {
    /// Tasks that share the plan, more than there are workers [default: one for each run, at most
    /// 1000]
    #[arg(long, value_name = "N", requires = "emit", value_parser = positive)]
    parts: Option<NonZero<usize>>,
    /// Most tasks at a time
    #[arg(long, value_name = "N", requires = "emit", value_parser = positive)]
    limit: Option<NonZero<usize>>,
    /// Greatest wall time of a task: minutes, or HH:MM:SS
    #[arg(long, value_name = "TIME", value_parser = time_s, requires = "emit")]
    time: Option<NonZero<u64>>,
    /// Memory of a task, such as 512M or 4G
    #[arg(long, value_name = "SIZE", value_parser = memory_mib, default_value = "4G", requires = "emit")]
    memory: NonZero<u64>,
    /// Partition or queue
    #[arg(long, value_name = "NAME", value_parser = word, requires = "emit")]
    partition: Option<String>,
    /// Account that is charged
    #[arg(long, value_name = "NAME", value_parser = word, requires = "emit")]
    account: Option<String>,
    /// Do not start tasks again whose node or process has failed
    #[arg(long, requires = "emit")]
    no_requeue: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum TransportName {
    /// In this process
    Memory,
    /// Over ROS 2, a process for each agent
    Ros2,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum KeepName {
    /// Of every run; runs that have a row and no recording are executed again
    All,
    /// Of runs that fail or do not reach 99 %
    Failures,
    /// Of runs far from the others of their kind in time, area under the curve or distance
    Outliers,
    None,
}

impl From<KeepName> for Keep {
    fn from(name: KeepName) -> Self {
        match name {
            KeepName::All => Self::All,
            KeepName::Failures => Self::Failures,
            KeepName::Outliers => Self::Outliers,
            KeepName::None => Self::None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SchedulerName {
    /// A job array for Slurm: sbatch plan.slurm.sh
    Slurm,
    /// A job array for PBS Pro and OpenPBS: qsub plan.pbs.sh
    Pbs,
    /// Jobs for HTCondor: condor_submit plan.condor.sub
    Htcondor,
    /// An indexed job for Kubernetes: kubectl apply -f plan.k8s.yaml
    K8s,
    /// GNU parallel, on one machine or several: bash plan.parallel.sh
    Parallel,
}

impl From<SchedulerName> for Scheduler {
    fn from(name: SchedulerName) -> Self {
        match name {
            SchedulerName::Slurm => Self::Slurm,
            SchedulerName::Pbs => Self::Pbs,
            SchedulerName::Htcondor => Self::HtCondor,
            SchedulerName::K8s => Self::K8s,
            SchedulerName::Parallel => Self::Parallel,
        }
    }
}

impl JobArgs {
    fn job(&self, scheduler: Scheduler) -> Job {
        Job {
            scheduler,
            parts: self.parts,
            limit: self.limit,
            time_s: self.time,
            memory_mib: self.memory,
            partition: self.partition.clone(),
            account: self.account.clone(),
            is_requeued: !self.no_requeue,
        }
    }
}

fn time_s(text: &str) -> Result<NonZero<u64>, String> {
    let numbers: Option<Vec<u64>> = text.split(':').map(|part| part.parse().ok()).collect();
    let seconds = match numbers.as_deref() {
        Some([minutes]) => minutes.checked_mul(60),
        Some([hours, minutes @ 0..60, seconds @ 0..60]) => {
            hours.checked_mul(3600).and_then(|hours| hours.checked_add(minutes * 60 + seconds))
        }
        _ => None,
    };
    seconds.and_then(NonZero::new).ok_or_else(|| "expected minutes, or HH:MM:SS such as 01:30:00".to_owned())
}

fn memory_mib(text: &str) -> Result<NonZero<u64>, String> {
    let size = text.strip_suffix('M').map(|size| (size, 1)).or(text.strip_suffix('G').map(|size| (size, 1024)));
    let mib = size.and_then(|(size, mib)| size.parse::<u64>().ok()?.checked_mul(mib));
    mib.and_then(NonZero::new).ok_or_else(|| "expected a size such as 512M or 4G".to_owned())
}

/// One word, so that it adds no other request to a job.
fn word(text: &str) -> Result<String, String> {
    let is_word =
        !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.@,/".contains(&byte));
    is_word.then(|| text.to_owned()).ok_or_else(|| "expected letters, digits, and - _ . @ , /".to_owned())
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

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// The stored results: runs.csv, or the folder of a plan
    base: PathBuf,
    /// The new results of the same plan
    new: PathBuf,
    /// What is compared, restricted to the duration
    #[arg(long, value_enum, value_name = "MEASURE", default_value_t = MeasureName::Area)]
    measure: MeasureName,
    /// How much worse the mean may be, in per cent
    #[arg(long, value_name = "PERCENT", default_value_t = 5.0, value_parser = tolerance)]
    tolerance: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MeasureName {
    /// Mean time until a cell is seen, which is what the area under the explored share leaves
    Area,
    #[value(name = "time-90")]
    Time90,
    #[value(name = "time-99")]
    Time99,
    #[value(name = "time-100")]
    Time100,
}

impl From<MeasureName> for RegressionMeasure {
    fn from(name: MeasureName) -> Self {
        match name {
            MeasureName::Area => Self::Unseen,
            MeasureName::Time90 => Self::TimeTo(90),
            MeasureName::Time99 => Self::TimeTo(99),
            MeasureName::Time100 => Self::TimeTo(100),
        }
    }
}

fn tolerance(text: &str) -> Result<f64, String> {
    let percent = text.parse::<f64>().ok().filter(|percent| (0.0..=1000.0).contains(percent));
    percent.ok_or_else(|| "expected per cent, 0 to 1000".to_owned())
}

/// Arguments of `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// The folder of a plan
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The title of the page [default: that of the plan, or the names of what it compares]
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    /// The date on the page [default: the days on which the runs were executed]
    #[arg(long, value_name = "TEXT")]
    date: Option<String>,
    /// Draw only routes that were recorded; else one run of each variant and panel is executed
    /// again
    #[arg(long)]
    no_routes: bool,
}

fn part(text: &str) -> Result<Part, String> {
    let expected = || "expected K/N, such as 0/4, with K from 0 to N - 1".to_owned();
    let (index, parts) = text.split_once('/').ok_or_else(expected)?;
    let part = index.parse().ok().zip(parts.parse().ok()).map(|(index, parts)| Part { index, parts });
    part.filter(|part| part.index < part.parts.get()).ok_or_else(expected)
}

/// Whether an error is a failure of the system, and not bad input.
pub(crate) fn is_failure(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref::<ExecuteError>(), Some(ExecuteError::Store(error)) if error.is_failure())
        || matches!(error.downcast_ref::<BenchmarkError>(), Some(BenchmarkError::Store(_)))
        || matches!(error.downcast_ref::<EmitError>(), Some(EmitError::Store(_)))
        || error.downcast_ref::<StoreError>().is_some_and(StoreError::is_failure)
        || matches!(error.downcast_ref::<ReportError>(), Some(ReportError::Png { .. } | ReportError::Write { .. }))
}

/// Executes what is left of a plan.
pub(crate) fn batch(args: &BatchArgs) -> anyhow::Result<ExitCode> {
    let plan = Plan::load(&args.plan).map_err(|error| match is_scenario(&args.plan) {
        true => anyhow!("{0}: a scenario of one run; expected a plan of many: maes run {0}", args.plan.display()),
        false => error.into(),
    })?;
    if let Some(note) = plan.too_few_blocks() {
        tracing::info!("note: {note}");
    }
    let cores = thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
    let (transport, jobs) = match args.transport {
        TransportName::Memory => (Transport::Memory, cores),
        TransportName::Ros2 => (over_ros(args.first_domain)?, NonZero::<usize>::MIN),
    };
    if let Some(scheduler) = args.emit {
        let file = cluster::emit(&plan, &args.out, &args.job.job(scheduler.into()), &transport)?;
        print(&format!("{}", file.display()));
        return Ok(ExitCode::SUCCESS);
    }
    let jobs = args.jobs.unwrap_or(jobs);
    let options = Options {
        jobs,
        transport,
        part: args.part.unwrap_or(Part::WHOLE),
        prune: args.prune,
        registry: Registry::BUILT_IN,
    };
    let selection = Selection { only: args.run.iter().cloned().collect::<BTreeSet<_>>(), keep: args.keep.into() };
    let summary = interruptible(|stop| {
        let mut display = ProgressDisplay::default();
        let executed = execute::execute_selected(&plan, args.out.clone(), &options, &selection, &mut display, stop);
        // The other commands that execute plans have no such flag.
        let summary = executed.map_err(|error| match error {
            ExecuteError::OtherRuns { .. } => anyhow!("{error}, or remove them with --prune"),
            other => other.into(),
        })?;
        if args.report && summary.failed + summary.left == 0 {
            record_routes(&args.out, jobs, stop);
        }
        Ok(summary)
    })?;
    let Summary { skipped, done, recorded, failed, left } = summary;
    let recorded = if recorded > 0 { format!(", {recorded} executed again and recorded") } else { String::new() };
    print(&format!(
        "{done} runs done, {skipped} were there already{recorded}, {failed} failed, {left} left; build {BUILD}"
    ));
    // A part writes the tables if it ends last.
    if options.part == Part::WHOLE {
        print(&format!("{}", args.out.join("runs.csv").display()));
    }
    if args.report && failed + left == 0 {
        write_report(&args.out, &Heading::default())?;
    }
    Ok(match summary {
        Summary { left: 1.., .. } => ExitCode::from(exit::BY_SIGNAL),
        Summary { failed: 1.., .. } => ExitCode::from(exit::FAILED),
        _ => ExitCode::SUCCESS,
    })
}

/// Whether a file is a legal scenario.
fn is_scenario(file: &Path) -> bool {
    setup::load(file, &[]).is_ok()
}

/// Executes something that a first Ctrl-C ends after the runs under way, and a second one at once.
pub(crate) fn interruptible<T>(execute: impl FnOnce(&Stop) -> anyhow::Result<T>) -> anyhow::Result<T> {
    let stop = Arc::new(Stop::default());
    let requested = Arc::clone(&stop);
    signals::each(move || {
        if requested.soon.swap(true, Ordering::Relaxed) {
            requested.at_once.store(true, Ordering::Relaxed);
        } else {
            tracing::info!("ending after the runs under way; once more to give them up");
        }
    })?;
    execute(&stop)
}

/// Runs with a process for each agent, in this ROS domain and the next ones.
#[cfg(feature = "ros")]
pub(crate) fn over_ros(first_domain: u32) -> anyhow::Result<Transport> {
    Ok(Transport::Ros2(Launcher { binaries: supervisor::binaries::folder()?, first_domain }))
}

/// Runs with a process for each agent, which this program cannot start.
#[cfg(not(feature = "ros"))]
pub(crate) fn over_ros(_first_domain: u32) -> anyhow::Result<Transport> {
    anyhow::bail!("{}; expected runs over memory, without programs of their own", crate::run::WITHOUT_ROS)
}

/// Joins folders.
pub(crate) fn merge(args: &MergeArgs) -> anyhow::Result<ExitCode> {
    let runs = merge::merge(&args.folders, &args.out)?;
    print(&format!("{runs} runs in {}", args.out.join("runs.csv").display()));
    Ok(ExitCode::SUCCESS)
}

/// Compares results with stored ones; fails if a variant has become worse.
pub(crate) fn compare(args: &CompareArgs) -> anyhow::Result<ExitCode> {
    let changes = regression::changes(&args.base, &args.new, args.measure.into())?;
    let mut regressions = 0;
    for change in &changes {
        let is_worse = change.is_regression(args.tolerance / 100.0);
        regressions += usize::from(is_worse);
        print(&format!("{}{change}", if is_worse { "regression: " } else { "" }));
    }
    print(&format!(
        "{regressions} of {} variants are worse by more than {} %, or fail more often",
        changes.len(),
        args.tolerance
    ));
    Ok(if regressions > 0 { ExitCode::from(exit::DIFFERENT) } else { ExitCode::SUCCESS })
}

/// Makes the report of a folder, and its tables of all runs.
pub(crate) fn report(args: &ReportArgs) -> anyhow::Result<ExitCode> {
    let heading = Heading { title: args.title.clone(), date: args.date.clone() };
    if !args.no_routes && args.folder.join(PLAN).exists() {
        let cores = thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
        interruptible(|stop| {
            record_routes(&args.folder, cores, stop);
            Ok(())
        })?;
    }
    write_report(&args.folder, &heading)?;
    Ok(ExitCode::SUCCESS)
}

/// Records the runs whose routes a report shows, as far as they are of this build; a note says why
/// there are none.
fn record_routes(folder: &Path, jobs: NonZero<usize>, stop: &Stop) {
    let record = || -> anyhow::Result<()> { record_runs(folder, routes::without_recording(folder)?, jobs, stop) };
    if let Err(error) = record() {
        tracing::info!("note: no picture of routes: {error}");
    }
}

/// Executes runs of a folder once more, and keeps their recordings.
pub(crate) fn record_runs(
    folder: &Path,
    runs: BTreeSet<String>,
    jobs: NonZero<usize>,
    stop: &Stop,
) -> anyhow::Result<()> {
    if runs.is_empty() {
        return Ok(());
    }
    let (transport, part) = (Transport::Memory, Part::WHOLE);
    let options = Options { jobs, transport, part, prune: false, registry: Registry::BUILT_IN };
    tracing::info!("{}: executing {} runs once more, to record them", folder.display(), runs.len());
    routes::record(folder, &Plan::load(&folder.join(PLAN))?, runs, &options, &mut (), stop)?;
    Ok(())
}

/// How many verdicts a terminal gets: those of seven variants on one panel.
const VERDICTS_MAX: usize = 21;

fn write_report(folder: &Path, heading: &Heading) -> anyhow::Result<()> {
    let ReportSummary { page, runs, lacking, warnings, verdicts } = report::write_with(folder, heading)?;
    Store::open(folder)?.write_tables()?;
    let lacking = if lacking > 0 { format!(", {lacking} lacking for a whole comparison") } else { String::new() };
    print(&format!("{runs} runs{lacking}"));
    verdicts.iter().take(VERDICTS_MAX).for_each(|verdict| print(verdict));
    if verdicts.len() > VERDICTS_MAX {
        print(&format!("{} more comparisons are in the report", verdicts.len() - VERDICTS_MAX));
    }
    warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    print(&format!("{}", page.display()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_of_jobs_are_read() {
        let seconds = |text| time_s(text).map(NonZero::get).ok();
        assert_eq!((seconds("90"), seconds("01:30:00"), seconds("100:00:01")), (Some(5400), Some(5400), Some(360_001)));
        for wrong in ["", "0", "1:30", "00:60:00", "00:00:60", "-1", "1h", "99999999999999999999"] {
            assert!(time_s(wrong).is_err(), "{wrong}");
        }
        let mib = |text| memory_mib(text).map(NonZero::get).ok();
        assert_eq!((mib("512M"), mib("4G"), mib("4"), mib("0G"), mib("G")), (Some(512), Some(4096), None, None, None));
        assert!(word("gpu-short,long@site/a").is_ok());
        for wrong in ["", "a b", "a\n#SBATCH --uid=0", "a;b", "$(id)"] {
            assert!(word(wrong).is_err(), "{wrong}");
        }
    }
}
