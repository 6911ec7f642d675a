//! The command `maes`. Every exit code is made here, or in [`sim_server::exit`].
//!
//! Each module is a subcommand or a few of one kind; what they do is in the libraries. `maes run`
//! starts `sim_server` and `agent_node`, which lie beside it. Where they do not, as after
//! `cargo install`, `maes sim_server` and `maes agent_node` are the same programs. `maes
//! serve-agents` is what `maes run --hosts` starts on a host.

mod allocator;
mod bench;
mod controllers;
#[cfg(feature = "ros")]
mod faults;
mod map;
mod movie;
mod new;
mod oracle;
mod output;
mod plans;
mod progress;
mod recordings;
#[cfg(feature = "ros")]
mod replay;
mod run;
mod scenario;
mod signals;
mod usage;
mod view;

#[cfg(feature = "ros")]
use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use bench::BenchCommand;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;
use experiments::plan::BUILD;
#[cfg(feature = "ros")]
use faults::FaultsArgs;
use in_memory::in_process::InProcessError;
use map::{MapCliError, MapCommand};
use movie::MovieArgs;
use new::NewArgs;
use oracle::OracleArgs;
use plans::{BatchArgs, CompareArgs, MergeArgs, ReportArgs};
use recordings::{DiffArgs, InfoArgs, RecoverArgs, SnapshotArgs, VerifyArgs};
#[cfg(feature = "ros")]
use replay::ReplayArgs;
use run::RunArgs;
use scenario::ScenarioArgs;
use sim_server::exit;
#[cfg(feature = "ros")]
use supervisor::SupervisorError;
#[cfg(feature = "ros")]
use supervisor::hosts::serve;
use system::diagnostics::{self, Format};
use system::{memory, os};
use view::ViewArgs;

/// A deterministic simulator of multi-robot exploration for ROS 2.
#[derive(Debug, Parser)]
#[command(name = "maes", version = BUILD, arg_required_else_help = true)]
struct Cli {
    /// Form of the lines on stderr: text, or json, with an object for each event
    #[arg(long, value_name = "FORMAT")]
    log_format: Option<Format>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a scenario: a world server, a process for each agent, one recording, one exit code
    #[command(after_help = run::AFTER_HELP)]
    Run(Box<RunArgs>),
    /// Execute the runs of a plan, and make its tables
    Batch(BatchArgs),
    /// Join the folders of one plan into one
    Merge(MergeArgs),
    /// Compare the results of a plan with stored ones; exit code 1 if a variant has become worse
    Compare(CompareArgs),
    /// Make figures, tables and a page from the runs of a folder
    Report(ReportArgs),
    /// Execute a benchmark that can be cited, or verify the results of others
    #[command(subcommand)]
    Bench(BenchCommand),
    /// Show a recording or a run in a browser, or let runs be started there
    View(Box<ViewArgs>),
    /// Play a recording on its ROS 2 topics
    #[cfg(feature = "ros")]
    Replay(ReplayArgs),
    /// Check a recording: execute its run again, and compare everything that comes of it
    Verify(VerifyArgs),
    /// Finish a cut recording, so that every reader of MCAP opens it
    Recover(RecoverArgs),
    /// Show the first message in which two recordings differ
    Diff(DiffArgs),
    /// Describe a recording: scenario, messages by topic, result, counters, digest
    Info(InfoArgs),
    /// Take a picture of a moment of a recording
    Snapshot(SnapshotArgs),
    /// Make a movie of a recording
    Movie(MovieArgs),
    /// Make, describe and convert maps
    #[command(subcommand)]
    Map(MapCommand),
    /// Print a scenario with all its keys, or one of them
    Scenario(ScenarioArgs),
    /// Make the folder of a controller of your own, in Rust or Python
    New(NewArgs),
    /// Say how fast a team could be that knows the map in advance, and what no team can beat
    Oracle(OracleArgs),
    /// Disturb runs over ROS 2 with seeded faults, and compare each with the undisturbed run
    #[cfg(feature = "ros")]
    Faults(Box<FaultsArgs>),
    /// Print a completion script for a shell, for example `maes completions bash`
    Completions {
        #[arg(value_enum)]
        shell: Shell,
    },
    /// Write a manual page for each command into a folder
    #[command(hide = true)]
    ManPages { folder: PathBuf },
}

fn main() -> ExitCode {
    #[cfg(feature = "ros")]
    if let Some(code) = other_program() {
        return code;
    }
    allocator::keep_large_blocks_in_pages();
    // Without it a full file ends the process as it always has.
    drop(os::report_full_files());
    drop(memory::report_lack());
    let parsed = taking_negative_numbers(Cli::command()).try_get_matches().and_then(|matches| {
        let cli = Cli::from_arg_matches(&matches)?;
        Ok((cli, matches))
    });
    let (cli, matches) = match parsed {
        Ok(parsed) => parsed,
        Err(error) => {
            diagnostics::show(None);
            return usage::report(&error);
        }
    };
    diagnostics::show(cli.log_format);
    let given = matches.subcommand().map(|(_, given)| given).unwrap_or(&matches);
    let done = match cli.command {
        Command::Run(args) => run::run(&args, given),
        Command::Batch(args) => plans::batch(&args),
        Command::Merge(args) => plans::merge(&args),
        Command::Compare(args) => plans::compare(&args),
        Command::Report(args) => plans::report(&args),
        Command::Bench(command) => bench::run(&command),
        Command::View(args) => view::view(*args, given),
        #[cfg(feature = "ros")]
        Command::Replay(args) => replay::replay(&args),
        Command::Verify(args) => recordings::verify(&args),
        Command::Recover(args) => recordings::recover(&args),
        Command::Diff(args) => recordings::diff(&args),
        Command::Info(args) => recordings::info(&args),
        Command::Snapshot(args) => recordings::snapshot(&args),
        Command::Movie(args) => movie::make(&args),
        Command::Map(command) => map::run(command).map(|()| ExitCode::SUCCESS).map_err(Into::into),
        Command::Scenario(args) => scenario::print(&args),
        Command::New(args) => new::new(&args),
        Command::Oracle(args) => oracle::print(&args),
        #[cfg(feature = "ros")]
        Command::Faults(args) => faults::faults(&args),
        Command::Completions { shell } => {
            // A reader that has enough, such as `head`, ends no writing to memory.
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "maes", &mut script);
            output::print_bytes(&script);
            Ok(ExitCode::SUCCESS)
        }
        Command::ManPages { folder } => {
            let programs = [Cli::command(), sim_server::cli::Cli::command(), agent_node::cli::Cli::command()];
            let written = std::fs::create_dir_all(&folder)
                .and_then(|()| programs.into_iter().try_for_each(|program| clap_mangen::generate_to(program, &folder)));
            written.with_context(|| folder.display().to_string()).map(|()| ExitCode::SUCCESS)
        }
    };
    let code = done.unwrap_or_else(|error| {
        tracing::error!("{}", output::without_numbers(&msgs::printable::line(&exit::described(&error))));
        exit_code(&error)
    });
    match output::failure() {
        Some(failure) if code == ExitCode::SUCCESS => {
            tracing::error!("{}", output::without_numbers(failure));
            ExitCode::from(exit::FAILED)
        }
        _ => code,
    }
}

/// A command whose options take negative numbers as values, so that their own errors say what is
/// allowed, and not that `-1` is no option.
fn taking_negative_numbers(command: clap::Command) -> clap::Command {
    command.allow_negative_numbers(true).mut_subcommands(taking_negative_numbers)
}

/// Runs one of the programs that this one is as well, if its name comes first.
#[cfg(feature = "ros")]
fn other_program() -> Option<ExitCode> {
    let mut arguments = std::env::args_os().skip(1);
    match arguments.next().as_deref().and_then(OsStr::to_str)? {
        "sim_server" => Some(sim_server::program::main(arguments)),
        "agent_node" => Some(agent_node::program::run(arguments, &[])),
        serve::SUBCOMMAND => Some(serve_agents()),
        _ => None,
    }
}

/// What a launcher starts on a host of `maes run --hosts`.
#[cfg(feature = "ros")]
fn serve_agents() -> ExitCode {
    diagnostics::show(None);
    let served = match std::env::current_exe() {
        Ok(maes) => serve::serve(&maes, BUILD).map_err(|error| (error.to_string(), error.exit_code())),
        Err(error) => Err((error.to_string(), exit::FAILED)),
    };
    match served {
        Ok(()) => ExitCode::SUCCESS,
        Err((reason, code)) => {
            tracing::error!("{}", msgs::printable::line(&reason));
            ExitCode::from(code)
        }
    }
}

fn exit_code(error: &anyhow::Error) -> ExitCode {
    #[cfg(feature = "ros")]
    if let Some(error) = error.downcast_ref::<SupervisorError>() {
        return ExitCode::from(error.exit_code());
    }
    #[cfg(feature = "ros")]
    if faults::is_failure(error) {
        return ExitCode::from(exit::FAILED);
    }
    if error.downcast_ref::<MapCliError>().is_some_and(MapCliError::is_failure) {
        return ExitCode::from(exit::FAILED);
    }
    match error.downcast_ref::<InProcessError>() {
        Some(InProcessError::Run(error)) => exit::of_error(error),
        Some(InProcessError::Record(error)) => exit::of_record_error(error),
        #[cfg(unix)]
        Some(InProcessError::OwnProgram(_)) => ExitCode::from(exit::FAILED),
        _ if plans::is_failure(error) || error.is::<new::NotWritten>() => ExitCode::from(exit::FAILED),
        _ => ExitCode::from(exit::BAD_INPUT),
    }
}

#[cfg(test)]
mod documented;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_declaration_is_consistent() {
        Cli::command().debug_assert();
    }
}
