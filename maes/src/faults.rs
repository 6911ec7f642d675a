//! `maes faults`: runs that are disturbed by seeded faults.

use std::num::NonZero;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Context;
use clap::{Args, Subcommand};
use experiments::faults::{self, Options, Summary};
use sim_server::cli::KeyArgs;
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

/// Arguments of `faults`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
pub(crate) struct FaultsArgs {
    #[command(subcommand)]
    command: Option<FaultsCommand>,
    /// The scenario (.toml); needs faults.on_agent_loss = "wait" [default: five agents with dsvp in
    /// a small cave, for a minute]
    scenario: Option<PathBuf>,
    /// Number of seeds
    #[arg(long, value_name = "N", default_value_t = 10)]
    seeds: u64,
    /// The first seed
    #[arg(long, value_name = "K", default_value_t = 1)]
    first_seed: u64,
    /// Only this seed
    #[arg(long, value_name = "K", conflicts_with_all = ["seeds", "first_seed"])]
    seed_only: Option<u64>,
    /// Runs in parallel
    #[arg(long, value_name = "N", default_value = "1")]
    jobs: NonZero<usize>,
    /// The ROS domain of the first parallel run; the others use the next ones
    #[arg(long, value_name = "ID", default_value_t = 1, value_parser = clap::value_parser!(u32).range(0..=101))]
    first_domain: u32,
    /// Keep all recordings and logs in this folder [default: a temporary one keeps those of
    /// failures]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Compare with this recording instead of the undisturbed run
    #[arg(long, value_name = "FILE.mcap")]
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
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1000))]
    agents: u32,
    /// Number of messages
    #[arg(long)]
    messages: u32,
}

/// Disturbs runs.
pub(crate) fn faults(args: &FaultsArgs) -> anyhow::Result<ExitCode> {
    if let Some(FaultsCommand::InjectGarbage(args)) = &args.command {
        return inject_garbage(args);
    }
    let overrides = args.keys.overrides();
    let scenario = match &args.scenario {
        Some(file) => setup::load(file, &overrides)?,
        None => Scenario::parse("the scenario of `maes faults`", SCENARIO, &overrides)?,
    };
    let seeds: Vec<u64> = match args.seed_only {
        Some(seed) => vec![seed],
        None => (args.first_seed..args.first_seed.saturating_add(args.seeds)).collect(),
    };
    if args.list {
        seeds.iter().for_each(|&seed| print(&format!("seed {seed}: {}", faults::plan_of(&scenario, seed))));
        return Ok(ExitCode::SUCCESS);
    }
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM, signal_hook::consts::SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).context("handling signals")?;
    }
    let options = Options {
        scenario,
        seeds,
        jobs: args.jobs,
        binaries: binaries::folder()?,
        first_domain: args.first_domain,
        out: args.out.clone(),
        expected: args.expect.clone(),
    };
    let Summary { seeds, failures, is_interrupted } = faults::run(&options, &stop, &print)?;
    print(&format!("{seeds} seeds, {failures} failures"));
    Ok(match (is_interrupted, failures) {
        (true, _) => ExitCode::from(exit::BY_SIGNAL),
        (false, 0) => ExitCode::SUCCESS,
        (false, _) => ExitCode::from(exit::FAILED),
    })
}

fn inject_garbage(args: &GarbageArgs) -> anyhow::Result<ExitCode> {
    let env = ros_node::ros_env::RosEnv::from_vars(|name| std::env::var(name).ok())?;
    faults::inject_garbage(u64::from(args.messages), args.agents, args.messages, &env)?;
    Ok(ExitCode::SUCCESS)
}
