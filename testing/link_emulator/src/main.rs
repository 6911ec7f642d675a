//! `link_emulator`: a command with some hosts and an emulated link between them.

use std::ffi::OsString;
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, ExitCode};
use std::time::Duration;

use clap::Parser;
use link_emulator::{Link, Network, Outage};
use signal_hook::consts::{SIGINT, SIGTERM};

/// Makes hosts (network namespaces) with an emulated link between them, executes a command, and
/// removes them
///
/// The command stays on this machine. It finds the hosts in its environment: HOST_0 is the name of
/// the first namespace, ADDRESS_0 its address, and so on; ip netns exec "$HOST_0" executes
/// something there. Needs root. Afterwards the frames are counted on stderr.
#[derive(Debug, Parser)]
#[command(name = "link_emulator", version)]
struct Cli {
    #[arg(long, default_value_t = 2)]
    hosts: usize,
    /// Delay of each frame
    #[arg(long, value_name = "MS", default_value_t = 0.0, value_parser = milliseconds)]
    delay_ms: f64,
    /// Share of the frames that are lost
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    loss: f64,
    /// Share of the frames that take up to four times as long, so that others overtake them
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    reorder: f64,
    /// Lose everything for so long, once
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = seconds)]
    outage_s: f64,
    /// After so many frames
    #[arg(long, value_name = "N", default_value_t = 1000)]
    outage_after: u64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[arg(required = true, last = true)]
    command: Vec<OsString>,
}

fn bounded(text: &str, max: f64) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| (0.0..=max).contains(number));
    number.ok_or_else(|| format!("expected a number from 0 to {max}"))
}

fn milliseconds(text: &str) -> Result<f64, String> {
    bounded(text, 10_000.0)
}

fn share(text: &str) -> Result<f64, String> {
    bounded(text, 1.0)
}

fn seconds(text: &str) -> Result<f64, String> {
    bounded(text, 3600.0)
}

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(1)
        }
    }
}

/// The exit code of the command.
fn run(cli: &Cli) -> Result<u8, Box<dyn std::error::Error>> {
    let lasts = Duration::from_secs_f64(cli.outage_s);
    let link = Link {
        delay: Duration::from_secs_f64(cli.delay_ms / 1e3),
        loss: cli.loss,
        reordered: cli.reorder,
        outage: (!lasts.is_zero()).then_some(Outage { after_frames: cli.outage_after, lasts }),
        seed: cli.seed,
    };
    // They reach the command as well, and its end is waited for.
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, std::sync::Arc::default())?;
    }
    let network = Network::create(cli.hosts, link)?;
    let mut command = Command::new(&cli.command[0]);
    command.args(&cli.command[1..]);
    for (host, name) in network.hosts().iter().enumerate() {
        command.env(format!("HOST_{host}"), name).env(format!("ADDRESS_{host}"), network.address(host).to_string());
    }
    let status = command.status().map_err(|error| format!("{}: {error}", cli.command[0].display()))?;
    eprintln!("{:?}", network.counts());
    let code = status.code().or_else(|| status.signal().map(|signal| 128 + signal));
    Ok(code.and_then(|code| u8::try_from(code).ok()).unwrap_or(u8::MAX))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
