//! `maes faults`: runs that are disturbed by seeded faults.

use std::num::NonZero;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::{Context, bail};
use clap::{Args, Subcommand};
use fault_injection::simulated::{self, SeedReport};
use fault_injection::{FaultsError, Options, Summary};
use sim_server::cli::{KeyArgs, positive, recording_path, whole};
use sim_server::{exit, setup};
use simulation::scenario::Scenario;

use crate::output::print;
use supervisor::binaries;

/// The run that is disturbed unless another one is named: short, with agents that share maps, and
/// slow enough to be disturbed in the middle. A second is long for a decision, and short for a
/// person who waits.
const SCENARIO: &str = "
seed = 7
duration_s = 60.0
stop_when_explored = false
[map]
kind = \"spheres\"
size = 30
[agents]
count = 5
controller = \"dsvp\"
share_period_ticks = 50
[faults]
on_agent_loss = \"wait\"
[execution]
rtf = 20.0
threads = 1
join_timeout_s = 20.0
decision_timeout_s = 1.0
";

/// Seeds unless others are named: over ROS 2, and simulated.
const SEEDS: u64 = 10;
const SIMULATED_SEEDS: u64 = 10_000;

/// Arguments of `faults`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
pub(crate) struct FaultsArgs {
    #[command(subcommand)]
    command: Option<FaultsCommand>,
    /// The scenario (.toml); needs faults.on_agent_loss = "wait" [default: five agents with dsvp in
    /// a small cave, for a minute]
    #[arg(conflicts_with = "simulated")]
    scenario: Option<PathBuf>,
    /// Simulate network, disk and time instead: server and agents in one thread, a small scenario
    /// for each seed, thousands of seeds a minute
    #[arg(long, conflicts_with_all = ["first_domain", "out", "expect", "list"])]
    simulated: bool,
    /// Print every event of the seed
    #[arg(long, requires = "simulated", requires = "seed_only")]
    log: bool,
    /// Number of seeds [default: 10; simulated: 10000]
    #[arg(long, value_name = "N", value_parser = whole::<NonZero<u64>>(1..=u64::MAX))]
    seeds: Option<NonZero<u64>>,
    /// The first seed
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = whole::<u64>(0..=u64::MAX))]
    first_seed: u64,
    /// Only this seed
    #[arg(long, value_name = "K", conflicts_with_all = ["seeds", "first_seed"], value_parser = whole::<u64>(0..=u64::MAX))]
    seed_only: Option<u64>,
    /// Runs in parallel [default: 1; simulated: as many as there are processors]
    #[arg(long, value_name = "N", value_parser = positive)]
    jobs: Option<NonZero<usize>>,
    /// The ROS domain of the first parallel run; the others use the next ones
    #[arg(long, value_name = "ID", default_value_t = 1, value_parser = whole::<u32>(0..=101))]
    first_domain: u32,
    /// Keep all recordings and logs in this folder [default: a temporary one keeps those of
    /// failures]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Compare with this recording instead of the undisturbed run
    #[arg(long, value_name = "FILE.mcap", value_parser = recording_path())]
    expect: Option<PathBuf>,
    /// Only print the faults of each seed
    #[arg(long)]
    list: bool,
    #[command(flatten, next_help_heading = "Keys of the scenario")]
    keys: KeyArgs,
}

#[derive(Debug, Subcommand)]
enum FaultsCommand {
    /// Send messages that no agent may send in the ROS domain of a run
    #[command(hide = true)]
    InjectGarbage(GarbageArgs),
}

/// Arguments of `inject-garbage`.
#[derive(Debug, Args)]
struct GarbageArgs {
    /// Size of the team
    #[arg(long, value_parser = whole::<u32>(1..=1000))]
    agents: u32,
    /// Number of messages
    #[arg(long)]
    messages: u32,
}

/// Whether an error is a failure of the system, and not bad input.
pub(crate) fn is_failure(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref::<FaultsError>(), Some(FaultsError::Write { .. }))
}

/// Disturbs runs.
pub(crate) fn faults(args: &FaultsArgs) -> anyhow::Result<ExitCode> {
    if let Some(FaultsCommand::InjectGarbage(args)) = &args.command {
        return inject_garbage(args);
    }
    let overrides = args.keys.overrides();
    if args.simulated {
        let Some(key) = overrides.first() else { return simulate(args) };
        bail!("{}: not with --simulated, which draws a scenario from each seed", key.origin);
    }
    let scenario = match &args.scenario {
        Some(file) => setup::load(file, &overrides)?,
        None => Scenario::parse("the scenario of `maes faults`", SCENARIO, &overrides)?,
    };
    let seeds: Vec<u64> = match args.seed_only {
        Some(seed) => vec![seed],
        None => (args.first_seed..args.first_seed.saturating_add(args.seeds.map_or(SEEDS, NonZero::get))).collect(),
    };
    if args.list {
        seeds.iter().for_each(|&seed| print(&format!("seed {seed}: {}", fault_injection::plan_of(&scenario, seed))));
        return Ok(ExitCode::SUCCESS);
    }
    let stop = stopped_by_signals()?;
    let options = Options {
        scenario,
        seeds,
        jobs: args.jobs.unwrap_or(NonZero::<usize>::MIN),
        binaries: binaries::folder()?,
        first_domain: args.first_domain,
        out: args.out.clone(),
        expected: args.expect.clone(),
    };
    let Summary { seeds, failures, is_interrupted } = fault_injection::run(&options, &stop, &print)?;
    print(&format!("{seeds} seeds, {failures} failures"));
    Ok(exit_code(is_interrupted, failures))
}

fn stopped_by_signals() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM, signal_hook::consts::SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).context("handling signals")?;
    }
    Ok(stop)
}

fn exit_code(is_interrupted: bool, failures: usize) -> ExitCode {
    match (is_interrupted, failures) {
        (true, _) => ExitCode::from(exit::BY_SIGNAL),
        (false, 0) => ExitCode::SUCCESS,
        (false, _) => ExitCode::from(exit::FAILED),
    }
}

/// Simulates runs under faults.
fn simulate(args: &FaultsArgs) -> anyhow::Result<ExitCode> {
    if let Some(seed) = args.seed_only {
        let SeedReport { verdict, log, .. } = simulated::of_seed(seed, None, args.log);
        log.iter().for_each(|line| print(line));
        return Ok(match verdict {
            Ok(verdict) => {
                print(&format!("seed {seed}: {verdict}"));
                ExitCode::SUCCESS
            }
            Err(reason) => {
                print(&format!("seed {seed}: FAILED: {reason}"));
                ExitCode::from(exit::FAILED)
            }
        });
    }
    let jobs = args.jobs.or_else(|| std::thread::available_parallelism().ok()).unwrap_or(NonZero::<usize>::MIN);
    let seeds = args.seeds.map_or(SIMULATED_SEEDS, NonZero::get);
    let options = simulated::Options { first_seed: args.first_seed, seeds, jobs };
    let stop = stopped_by_signals()?;
    let simulated::Summary { seeds, failures, counts, is_interrupted } = simulated::run(&options, &stop, &print);
    print(&counts.to_string());
    print(&format!("{seeds} seeds, {} failures", failures.len()));
    Ok(exit_code(is_interrupted, failures.len()))
}

fn inject_garbage(args: &GarbageArgs) -> anyhow::Result<ExitCode> {
    let env = ros_node::ros_env::RosEnv::from_vars(|name| std::env::var(name).ok())?;
    fault_injection::inject_garbage(u64::from(args.messages), args.agents, args.messages, &env)?;
    Ok(ExitCode::SUCCESS)
}
