//! Runs without a network. Every exit code is made here.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use experiments::single::{self, Grouping, SingleError, Team};
use sim_server::cli::KeyArgs;
use sim_server::terminal::{self, Terminal};
use sim_server::{exit, setup};

/// Runs without a network.
#[derive(Debug, Parser)]
#[command(name = "experiments", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Carry out one scenario in this process, over the in-memory link
    Single(SingleArgs),
}

#[derive(Debug, Args)]
struct SingleArgs {
    /// The scenario (.toml)
    scenario: PathBuf,
    #[command(flatten)]
    keys: KeyArgs,
    /// Run all agents on one thread
    #[arg(long)]
    together: bool,
    /// Let agents tell those in contact what is new on their maps every so many ticks (the reference: 251); 0: never
    #[arg(long, value_name = "TICKS", default_value_t = 0)]
    share_period: u32,
    /// Wait up to so many milliseconds, at random, before each answer of an agent
    #[arg(long, value_name = "MS", default_value_t = 0)]
    chaos_delay_ms: u64,
}

fn main() -> ExitCode {
    let Command::Single(args) = Cli::parse().command;
    match run_single(&args) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            match error.downcast_ref::<SingleError>() {
                Some(SingleError::Run(error)) => exit::of_error(error),
                Some(SingleError::Record(_)) => ExitCode::from(exit::FAILED),
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
    let mut terminal = Terminal::new(scenario.duration_ticks(), scenario.agents.count);
    let grouping = if args.together { Grouping::Together } else { Grouping::Apart };
    let chaos_delay = Duration::from_millis(args.chaos_delay_ms);
    let team = Team { grouping, share_period_ticks: args.share_period, chaos_delay };
    let outcome = single::run(&scenario, team, &mut terminal, &stop);
    terminal.clear();
    let outcome = outcome?;
    // Results go to stdout; that nobody listens is no failure.
    drop(writeln!(std::io::stdout(), "{}", terminal::result_text(&outcome)));
    Ok(exit::of_outcome(&outcome))
}
