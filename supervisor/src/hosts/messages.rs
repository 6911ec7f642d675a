//! What a supervisor and the process on a host say to each other: a JSON object in each line.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::team::Group;

/// Longest line, bytes: that of a process that names a thousand agents, or of a line of a log.
pub(super) const LINE_MAX: usize = 1 << 16;

/// From the supervisor, on the standard input of the process. Its end means that the supervisor or
/// the connection is gone: all agents are ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ToHost {
    /// Start the process of these agents.
    Start { agents: Group, arguments: Vec<String>, environment: BTreeMap<String, String> },
    /// Send this signal to that process.
    Signal { agents: Group, number: i32 },
}

/// From the process on a host, on its standard output.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum FromHost {
    /// The first message.
    Hello { build: String, cores: usize },
    /// A line that a process of agents has printed.
    Log { agents: Group, line: String },
    /// A process of agents has ended.
    Ended { agents: Group, code: u8 },
}

/// The line of a message.
pub(super) fn line(message: &impl Serialize) -> String {
    let mut line = serde_json::to_string(message).unwrap_or_default();
    line.push('\n');
    line
}
