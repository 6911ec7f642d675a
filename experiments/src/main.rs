//! Many runs, or one without a network. Every exit code is made here.

mod commands;

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use agent_node::stopwatch::DecisionTimes;
use anyhow::Context;
use clap::{Args, Parser, Subcommand};
use commands::faults::FaultsArgs;
use commands::{DiffArgs, MergeArgs, ReportArgs, RunArgs};
use experiments::in_process::{self, AgentOptions, InProcessError, ThreadLayout};
use sim_server::cli::KeyArgs;
use sim_server::terminal::{self, Terminal};
use sim_server::{exit, setup};

/// Experiments: many runs, and what comes out of them.
#[derive(Debug, Parser)]
#[command(name = "experiments", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Carry out one scenario in this process, over the in-memory link
    Single(Box<SingleArgs>),
    /// Carry out what is left of a plan, and make its tables
    Run(RunArgs),
    /// Join the folders of one plan into one
    Merge(MergeArgs),
    /// Make figures, tables and a page from the runs of a folder
    Report(ReportArgs),
    /// Disturb runs over ROS 2 with faults drawn from seeds, and compare each with the undisturbed one
    Faults(Box<FaultsArgs>),
    /// Say what no agent may say in the ROS domain of a run
    #[cfg(feature = "ros")]
    #[command(hide = true)]
    Garbage(commands::faults::GarbageArgs),
    /// Say in which message two recordings differ first
    Diff(DiffArgs),
    /// Make a movie of a recording
    #[cfg(feature = "view")]
    Movie(commands::movie::MovieArgs),
}

#[derive(Debug, Args)]
struct SingleArgs {
    /// The scenario (.toml)
    scenario: PathBuf,
    #[command(flatten)]
    keys: KeyArgs,
    /// Also write what is said about the run to this file
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Run all agents on one thread
    #[arg(long)]
    together: bool,
    /// Wait up to so many milliseconds, at random, before each answer of an agent
    #[arg(long, value_name = "MS", default_value_t = 0)]
    chaos_delay_ms: u64,
    /// Say how much wall time the decisions of the agents have taken
    #[arg(long)]
    decision_times: bool,
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Single(args) => run_single(&args),
        Command::Run(args) => commands::run(&args),
        Command::Merge(args) => commands::merge(&args),
        Command::Report(args) => commands::report(&args),
        Command::Faults(args) => commands::faults::run(&args),
        #[cfg(feature = "ros")]
        Command::Garbage(args) => commands::faults::garbage(&args),
        Command::Diff(args) => commands::diff(&args),
        #[cfg(feature = "view")]
        Command::Movie(args) => commands::movie::run(&args),
    };
    match done {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            match error.downcast_ref::<InProcessError>() {
                Some(InProcessError::Run(error)) => exit::of_error(error),
                Some(InProcessError::Record(_)) => ExitCode::from(exit::FAILED),
                _ if commands::is_failure(&error) => ExitCode::from(exit::FAILED),
                _ => ExitCode::from(exit::BAD_INPUT),
            }
        }
    }
}

fn run_single(args: &SingleArgs) -> anyhow::Result<ExitCode> {
    let scenario = setup::load(&args.scenario, &args.keys.overrides())?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, exit::BY_SIGNAL.into(), Arc::clone(&stop))?;
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let log = args.log.as_ref().map(|file| File::create(file).context(file.display().to_string())).transpose()?;
    let mut terminal = Terminal::new(scenario.duration_ticks(), scenario.agents.count).with_log(log);
    let threads = if args.together { ThreadLayout::Shared } else { ThreadLayout::PerAgent };
    let chaos_delay = Duration::from_millis(args.chaos_delay_ms);
    let decision_times = args.decision_times.then(DecisionTimes::default);
    let options = AgentOptions { threads, chaos_delay, decision_times: decision_times.clone() };
    let finished = in_process::run(&scenario, &options, &mut terminal, &stop);
    terminal.clear();
    if let Some(times) = decision_times {
        eprintln!("{}", summary(&times.sorted()));
    }
    let outcome = finished
        .map_err(|error| match error {
            InProcessError::Setup(_) | InProcessError::OverRosOnly(_) => {
                anyhow::anyhow!("{}: {error}", args.scenario.display())
            }
            other => other.into(),
        })?
        .outcome;
    let text = terminal::result_text(&outcome);
    terminal.keep(&text);
    // Results go to stdout; that nobody listens is no failure.
    drop(writeln!(std::io::stdout(), "{text}"));
    Ok(exit::of_outcome(&outcome))
}

/// Of durations in ascending order.
fn summary(times: &[Duration]) -> String {
    let share = |permille: usize| {
        let place = (times.len() * permille / 1000).min(times.len().saturating_sub(1));
        times.get(place).copied().unwrap_or_default()
    };
    let (median, p99, longest) = (share(500), share(990), share(1000));
    format!("{} decisions: median {median:.1?}, p99 {p99:.1?}, longest {longest:.1?}", times.len())
}
