//! The program `agent_node`: its command line, its ROS 2 node, and its exit codes. Start reading at
//! [`crate::host`].
//!
//! A program of its own, with further controllers, has this as its `main`:
//!
//! ```ignore
//! fn main() -> ExitCode {
//!     agent_node::program::main(CONTROLLERS)
//! }
//! ```

use std::ffi::OsString;
use std::process::ExitCode;
#[cfg(unix)]
use std::time::Duration;

use clap::Parser;

use crate::cli::Cli;
use crate::host::RunError;
#[cfg(unix)]
use crate::host::{AgentProcess, Options};
#[cfg(unix)]
use crate::pipe::PipeTransport;
use controllers::{Registration, Registry};
use system::{diagnostics, memory, results};

/// A failure of the system or of the protocol.
const FAILED: u8 = 1;
/// Bad input: an argument, a controller, a setting.
const BAD_INPUT: u8 = 2;
/// The server has refused an agent.
const REFUSED: u8 = 5;

/// Runs the agents that the command line names, with the built-in controllers and these. The exit
/// code: 0 the run is over; 1 a failure of the system or of the protocol; 2 bad input; 5 the server
/// has refused an agent.
#[must_use]
pub fn main(own: &'static [Registration]) -> ExitCode {
    run(std::env::args_os().skip(1), own)
}

/// Runs the agents as [`main`] does, with arguments after the name of the program.
#[must_use]
pub fn run(arguments: impl IntoIterator<Item = OsString>, own: &'static [Registration]) -> ExitCode {
    match Registry::with(own) {
        Err(error) => ExitCode::from(fail(&error, BAD_INPUT)),
        Ok(registry) => ExitCode::from(run_with(arguments, registry)),
    }
}

/// Runs the agents as [`run`] does, with a registry; returns the exit code, for programs that
/// end in another way.
#[must_use]
pub fn run_with(arguments: impl IntoIterator<Item = OsString>, registry: Registry) -> u8 {
    let name = OsString::from("agent_node");
    diagnostics::show(None);
    let cli = Cli::parse_from([name].into_iter().chain(arguments));
    // Without it the process is aborted as ever.
    drop(memory::report_lack());
    if cli.controllers {
        return match results::write(registry.text().as_bytes()) {
            Ok(()) => 0,
            Err(error) => fail(&format!("stdout: {error}"), FAILED),
        };
    }
    if cli.check {
        return match cli.options(registry, 0).check(&cli.announced, &cli.announced_set) {
            Ok(()) => 0,
            Err(error) => fail(&error, BAD_INPUT),
        };
    }
    let ended = if cli.over_stdin { serve_stdin(&cli, registry) } else { serve::run(&cli, registry) };
    match ended {
        Ok(()) => 0,
        Err(error) => fail(&error, code_of(&error)),
    }
}

/// The exit code for why agents have ended.
fn code_of(error: &anyhow::Error) -> u8 {
    match error.downcast_ref::<RunError>() {
        Some(RunError::Refused { .. } | RunError::WrongProtocol { .. }) => REFUSED,
        Some(RunError::Controller(_)) => BAD_INPUT,
        None if error.is::<BadInput>() => BAD_INPUT,
        _ => FAILED,
    }
}

/// An argument or a file that the user has to change.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
struct BadInput(anyhow::Error);

/// Runs the agents for a run in memory that has started this program.
#[cfg(unix)]
fn serve_stdin(cli: &Cli, registry: Registry) -> anyhow::Result<()> {
    let transport = PipeTransport::on_stdin().map_err(|error| {
        let text = format!("--over-stdin: {error}; expected a start by maes run --transport memory");
        BadInput(anyhow::Error::msg(text))
    })?;
    let options = Options { server_timeout: Duration::MAX, ..cli.options(registry, getrandom::u64()?) };
    let mut process = AgentProcess::new(transport, options);
    while process.step()?.is_continue() {
        let is_closed = process.transport().is_some_and(PipeTransport::is_closed);
        anyhow::ensure!(!is_closed, "the run in memory is gone");
    }
    Ok(())
}

#[cfg(not(unix))]
fn serve_stdin(_cli: &Cli, _registry: Registry) -> anyhow::Result<()> {
    anyhow::bail!("--over-stdin needs a Unix system")
}

/// Prints an error; returns the exit code.
fn fail(error: &dyn std::fmt::Display, code: u8) -> u8 {
    tracing::error!("{error}");
    code
}

#[cfg(feature = "ros")]
mod serve {
    use std::sync::Arc;

    use ros_node::join_secret;
    use ros_node::process_guard::{Limits, ProcessGuard, stop_on_signals};
    use ros_node::ros_env::RosEnv;

    use super::{BadInput, FAILED};
    use crate::cli::Cli;
    use crate::host::{self, Credentials, Options};
    use crate::ros::RosTransport;
    use controllers::Registry;

    pub(super) fn run(cli: &Cli, registry: Registry) -> anyhow::Result<()> {
        let secret = join_secret::read(cli.join_secret_file.as_deref(), |name| std::env::var_os(name));
        let secret = secret.map_err(|error| BadInput(error.into()))?;
        let mut nonce = [0; 32];
        getrandom::fill(&mut nonce)?;
        let stop = stop_on_signals(FAILED)?;
        ros_node::suspension::exit_on_continue()?;
        let guard = ProcessGuard::watch(
            Limits::from_vars(cli.agents().len(), |name| std::env::var(name).ok())?,
            Arc::clone(&stop),
        )?;
        let env = RosEnv::from_vars(|name| std::env::var(name).ok())?;
        if guard.starts() <= cli.stalled_starts {
            ros_node::process_guard::stall();
        }
        let mut transport = RosTransport::new(cli.agents(), cli.has_parameters(), &env)?;
        guard.started();
        let credentials = Some(Credentials { secret, nonce, starts: guard.starts() });
        let options = Options { credentials, ..cli.options(registry, getrandom::u64()?) };
        let ended = host::run(&mut transport, &options, &stop);
        guard.shutting_down();
        drop(transport);
        ended?;
        anyhow::ensure!(!guard.memory_exceeded(), "this process has ended because of its memory");
        Ok(())
    }
}

#[cfg(not(feature = "ros"))]
mod serve {
    use crate::cli::Cli;
    use controllers::Registry;

    pub(super) fn run(_cli: &Cli, _registry: Registry) -> anyhow::Result<()> {
        anyhow::bail!(
            "this program was built without the feature `ros` of agent_node: maes run --transport memory runs it"
        )
    }
}
