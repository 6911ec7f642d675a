//! The command line.

use std::path::PathBuf;
use std::time::Duration;

use clap::Parser;
use msgs::ids::AgentId;

use crate::host::Options;
use controllers::Registry;

/// Agents of a deterministic simulator of 3-D multi-agent exploration: one process for one or more
/// agents
#[derive(Debug, Parser)]
#[command(name = "agent_node", version, arg_required_else_help = true)]
pub struct Cli {
    /// Agents of this process: one id, or a range such as 0-19
    #[arg(long, value_name = "N|FROM-TO", value_parser = ids, required_unless_present_any = ["check", "controllers"])]
    pub id: Option<Ids>,
    /// Controller, instead of the one of the scenario
    #[arg(long, value_name = "NAME")]
    pub controller: Option<String>,
    /// Setting of the controller; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Exit with code 1 after this time without any message from the server
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = seconds)]
    pub server_timeout: f64,
    /// Provide the ROS 2 parameters of each agent [default: if this process runs at most 8 agents]
    #[arg(long, value_name = "true|false")]
    pub parameters: Option<bool>,
    /// Delay each reply at random by up to this many milliseconds: a test of the lock-step
    #[arg(long, value_name = "MS", default_value_t = 0)]
    pub chaos_delay_ms: u64,
    /// Maximum rate at which the changes of an agent's map are published on its topic `map`, while
    /// it has subscribers
    #[arg(long, value_name = "HZ", default_value_t = 5.0, value_parser = hertz)]
    pub map_hz: f64,
    /// Serve a run in memory, which has started this program with a socket as its standard input
    #[arg(long, hide = true)]
    pub over_stdin: bool,
    /// Block the first starts for ever, as a deadlock would: a test of the restart
    #[arg(long, value_name = "N", default_value_t = 0, hide = true)]
    pub stalled_starts: u32,
    /// File with the join secret of the run, readable by its owner only [default: the environment
    /// variable MAES_JOIN_SECRET, or none]
    #[arg(long, value_name = "FILE")]
    pub join_secret_file: Option<PathBuf>,
    /// Check the controller and its settings, and exit
    #[arg(long)]
    pub check: bool,
    /// With --check: the controller that the scenario announces
    #[arg(long, value_name = "NAME", requires = "check", default_value = "rbw")]
    pub announced: String,
    /// With --check: a setting that the scenario announces; repeatable
    #[arg(long, value_name = "KEY=VALUE", requires = "check")]
    pub announced_set: Vec<String>,
    /// List the controllers of this program with their settings, and exit
    #[arg(long)]
    pub controllers: bool,
}

impl Cli {
    /// Whether the agents provide their parameters.
    #[must_use]
    pub fn has_parameters(&self) -> bool {
        self.parameters.unwrap_or(self.agents().len() <= PARAMETERS_AGENTS_MAX)
    }

    /// The agents of this process; none if it only checks or lists.
    #[must_use]
    pub fn agents(&self) -> &[AgentId] {
        self.id.as_ref().map_or(&[], |ids| &ids.0)
    }

    /// The options of a host, without credentials.
    #[must_use]
    pub fn options(&self, registry: Registry, instance: u64) -> Options {
        Options {
            agents: self.agents().to_vec(),
            registry,
            controller: self.controller.clone(),
            settings: self.set.clone(),
            instance,
            credentials: None,
            server_timeout: self.server_timeout(),
            chaos_delay: self.chaos_delay(),
            map_hz: self.map_hz,
            decision_times: None,
        }
    }

    /// Time without a message after which the server is taken to be gone.
    #[must_use]
    pub fn server_timeout(&self) -> Duration {
        Duration::from_secs_f64(self.server_timeout)
    }

    /// The longest random delay before a reply.
    #[must_use]
    pub fn chaos_delay(&self) -> Duration {
        Duration::from_millis(self.chaos_delay_ms)
    }
}

/// Up to this many agents provide their parameters by default: it takes twelve more endpoints for
/// each agent.
const PARAMETERS_AGENTS_MAX: usize = 8;

/// Ids of agents, ascending.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ids(pub Vec<AgentId>);

/// Upper bound on the ids of one process, so that a typing error does not exhaust the memory.
const IDS_MAX: u32 = 1000;

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 1e6 => Ok(seconds),
        _ => Err("expected a number of seconds above 0 and at most 1e6".to_owned()),
    }
}

fn hertz(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (0.1..=1000.0).contains(&rate) => Ok(rate),
        _ => Err("expected a rate from 0.1 to 1000 in hertz".to_owned()),
    }
}

fn ids(text: &str) -> Result<Ids, String> {
    let number = |text: &str| {
        let parsed = text.trim().parse::<u32>();
        parsed.map_err(|_| format!("`{text}` is no agent id; expected a number, or a range such as 0-19"))
    };
    let (first, last) = match text.split_once('-') {
        Some((first, last)) => (number(first)?, number(last)?),
        None => (number(text)?, number(text)?),
    };
    if last < first {
        return Err(format!("the range {first}-{last} is empty"));
    }
    if last - first >= IDS_MAX {
        return Err(format!("the range {first}-{last} has more than {IDS_MAX} ids"));
    }
    Ok(Ids((first..=last).map(AgentId).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_id_or_a_range() {
        assert_eq!(ids("3"), Ok(Ids(vec![AgentId(3)])));
        assert_eq!(ids("2-4"), Ok(Ids(vec![AgentId(2), AgentId(3), AgentId(4)])));
        for wrong in ["", "x", "4-2", "-1", "1-", "0-1000", "1.5"] {
            assert!(ids(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn command_line_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }
}
