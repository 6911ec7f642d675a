//! What the user types.

use std::time::Duration;

use clap::Parser;
use msgs::ids::AgentId;

/// Agents of a deterministic simulator of 3-D multi-agent exploration: one process for one agent or several.
#[derive(Debug, Parser)]
#[command(name = "agent_node", version, arg_required_else_help = true)]
pub struct Cli {
    /// Which agents this process runs: one id, or a range such as 0-19
    #[arg(long, value_name = "N|FROM-TO", value_parser = ids)]
    pub id: Ids,
    /// What they run, if not what the scenario says
    #[arg(long, value_name = "NAME")]
    pub controller: Option<String>,
    /// A setting of the controller; can be given again
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// End, with exit code 1, when the server has said nothing for so long, not even that it is there
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = seconds)]
    pub server_timeout: f64,
    /// Offer what each agent is as parameters of its node [default: if this process runs no more than 8 agents]
    #[arg(long, value_name = "true|false")]
    pub parameters: Option<bool>,
    /// Wait up to so many milliseconds, at random, before each answer: a test of the lock-step
    #[arg(long, value_name = "MS", default_value_t = 0)]
    pub chaos_delay_ms: u64,
    /// Show what has changed of an agent's map on its topic `map` so many times a second at the most, while somebody listens
    #[arg(long, value_name = "HZ", default_value_t = 5.0, value_parser = hertz)]
    pub map_hz: f64,
    /// Only check the controller and its settings
    #[arg(long, requires = "controller")]
    pub check: bool,
}

impl Cli {
    /// Whether the agents offer their parameters.
    #[must_use]
    pub fn has_parameters(&self) -> bool {
        self.parameters.unwrap_or(self.id.0.len() <= PARAMETERS_AGENTS_MAX)
    }

    /// The silence after which the server is taken to be gone.
    #[must_use]
    pub fn server_timeout(&self) -> Duration {
        Duration::from_secs_f64(self.server_timeout)
    }

    /// The longest random delay before an answer.
    #[must_use]
    pub fn chaos_delay(&self) -> Duration {
        Duration::from_millis(self.chaos_delay_ms)
    }
}

/// Agents of a process that offer their parameters unless they are told to: each needs twelve endpoints more for it.
const PARAMETERS_AGENTS_MAX: usize = 8;

/// Ids of agents, ascending.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ids(pub Vec<AgentId>);

/// Ids that may be given at the most, so that a slip of the key does not fill the memory.
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
    fn the_declaration_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }
}
