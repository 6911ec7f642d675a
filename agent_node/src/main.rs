//! The process of one or more agents. Start reading at [`agent_node::host`]; every exit code is set
//! here.

use std::process::ExitCode;

use agent_node::controllers;
use clap::Parser;

fn main() -> ExitCode {
    let cli = agent_node::cli::Cli::parse();
    match &cli.controller {
        Some(name) if cli.check => match controllers::check(name, &cli.set) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("error: {}", msgs::printable::text(&error.to_string()));
                ExitCode::from(BAD_INPUT)
            }
        },
        _ => serve::run(cli),
    }
}

/// Bad input: an argument, a controller, a setting.
const BAD_INPUT: u8 = 2;

#[cfg(feature = "ros")]
mod serve {
    use std::process::ExitCode;
    use std::sync::Arc;

    use agent_node::cli::Cli;
    use agent_node::host::{self, Credentials, Options, RunError};
    use agent_node::ros::RosTransport;
    use ros_node::join_secret::{self, JoinSecretError};
    use ros_node::process_guard::{Limits, ProcessGuard, stop_on_signals};
    use ros_node::ros_env::RosEnv;

    /// A failure of the system or of the protocol.
    const FAILED: u8 = 1;
    /// The server has refused an agent.
    const REFUSED: u8 = 5;

    pub(super) fn run(cli: Cli) -> ExitCode {
        match serve(cli) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("error: {}", msgs::printable::text(&error.to_string()));
                ExitCode::from(match error.downcast_ref::<RunError>() {
                    Some(RunError::Refused { .. } | RunError::WrongProtocol { .. }) => REFUSED,
                    Some(RunError::Controller(_)) => super::BAD_INPUT,
                    _ if error.is::<JoinSecretError>() => super::BAD_INPUT,
                    _ => FAILED,
                })
            }
        }
    }

    fn serve(cli: Cli) -> anyhow::Result<()> {
        let secret = join_secret::read(cli.join_secret_file.as_deref(), |name| std::env::var_os(name))?;
        let mut nonce = [0; 32];
        getrandom::fill(&mut nonce)?;
        let stop = stop_on_signals(FAILED)?;
        ros_node::suspension::exit_on_continue()?;
        let guard = ProcessGuard::watch(Limits::from_vars(|name| std::env::var(name).ok())?, Arc::clone(&stop))?;
        let env = RosEnv::from_vars(|name| std::env::var(name).ok())?;
        if guard.starts() <= cli.stalled_starts {
            ros_node::process_guard::stall();
        }
        let mut transport = RosTransport::new(&cli.id.0, cli.has_parameters(), &env)?;
        guard.started();
        let options = Options {
            chaos_delay: cli.chaos_delay(),
            server_timeout: cli.server_timeout(),
            map_hz: cli.map_hz,
            agents: cli.id.0,
            controller: cli.controller,
            decision_times: None,
            settings: cli.set,
            instance: getrandom::u64()?,
            credentials: Some(Credentials { secret, nonce, starts: guard.starts() }),
        };
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
    use std::process::ExitCode;

    use agent_node::cli::Cli;

    pub(super) fn run(_cli: Cli) -> ExitCode {
        eprintln!("error: this agent_node was built without the feature `ros`");
        ExitCode::FAILURE
    }
}
