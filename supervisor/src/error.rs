use std::io;
use std::path::{Path, PathBuf};

use system::exit_code as exit;
use thiserror::Error;

/// Why a run cannot be supervised.
#[derive(Debug, Error)]
pub enum SupervisorError {
    /// Two servers in one domain would share their agents.
    #[error("a run is under way in ROS domain {0}; wait for its end, or take another domain: export ROS_DOMAIN_ID={next}", next = another(.0))]
    DomainTaken(String),
    /// An third-party agent that the team does not have.
    #[error("--external {agent}: agent {agent} is not in the run: ids are 0 to {}", count - 1)]
    UnknownExternal { agent: u32, count: u32 },
    /// Third-party agents are processes of their own, so the others have to be, too.
    #[error("--agents-per-process {0}: expected 1 if some agents are third-party, or have a program of their own")]
    SharedProcess(u32),
    /// A file of hosts, or what it says.
    #[error("{}: {reason}", file.display())]
    Hosts { file: PathBuf, reason: String },
    /// A host that agents cannot run on.
    #[error("{0}")]
    Host(String),
    #[error("{what}: {source}")]
    Io { what: String, source: io::Error },
    /// A program of the user cannot run the agents of a scenario.
    #[error("agents.command = {command}: {reason}")]
    Command { command: String, reason: String },
}

impl SupervisorError {
    pub(crate) fn io(what: impl Into<String>, source: io::Error) -> Self {
        Self::Io { what: what.into(), source }
    }

    /// The error of a file or a program.
    pub(crate) fn of(path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::io(path.display().to_string(), source)
    }

    /// The exit code of the supervising process.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Io { .. } => exit::FAILED,
            _ => exit::BAD_INPUT,
        }
    }
}

/// A domain beside this one, of those that need no other ports than the first hundred.
fn another(domain: &str) -> u32 {
    domain.parse().map_or(1, |domain: u32| (domain % 100 + 1) % 100)
}
