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

use clap::Parser;

use crate::cli::Cli;
use controllers::{Registration, Registry};

/// Bad input: an argument, a controller, a setting.
const BAD_INPUT: u8 = 2;

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
    let cli = Cli::parse_from([name].into_iter().chain(arguments));
    if cli.controllers {
        print(&registry.text());
        return 0;
    }
    if cli.check {
        return match cli.options(registry, 0).check(&cli.announced, &cli.announced_set) {
            Ok(()) => 0,
            Err(error) => fail(&error, BAD_INPUT),
        };
    }
    serve::run(&cli, registry)
}

/// Prints an error; returns the exit code.
fn fail(error: &dyn std::fmt::Display, code: u8) -> u8 {
    eprintln!("error: {}", msgs::printable::text(&error.to_string()));
    code
}

#[expect(clippy::print_stdout, reason = "the list that was asked for")]
fn print(text: &str) {
    print!("{text}");
}

#[cfg(feature = "ros")]
mod serve {
    use std::sync::Arc;

    use ros_node::join_secret::{self, JoinSecretError};
    use ros_node::process_guard::{Limits, ProcessGuard, stop_on_signals};
    use ros_node::ros_env::RosEnv;

    use crate::cli::Cli;
    use crate::host::{self, Credentials, Options, RunError};
    use crate::ros::RosTransport;
    use controllers::Registry;

    /// A failure of the system or of the protocol.
    const FAILED: u8 = 1;
    /// The server has refused an agent.
    const REFUSED: u8 = 5;

    pub(super) fn run(cli: &Cli, registry: Registry) -> u8 {
        match serve(cli, registry) {
            Ok(()) => 0,
            Err(error) => {
                let code = match error.downcast_ref::<RunError>() {
                    Some(RunError::Refused { .. } | RunError::WrongProtocol { .. }) => REFUSED,
                    Some(RunError::Controller(_)) => super::BAD_INPUT,
                    _ if error.is::<JoinSecretError>() => super::BAD_INPUT,
                    _ => FAILED,
                };
                super::fail(&error, code)
            }
        }
    }

    fn serve(cli: &Cli, registry: Registry) -> anyhow::Result<()> {
        let secret = join_secret::read(cli.join_secret_file.as_deref(), |name| std::env::var_os(name))?;
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

    pub(super) fn run(_cli: &Cli, _registry: Registry) -> u8 {
        super::fail(&"this program was built without the feature `ros` of agent_node", 1)
    }
}
