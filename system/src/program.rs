//! Programs: which agents a server wants to be started, and where those are that users name.

use std::fmt;
use std::path::{Path, PathBuf, absolute};
use std::process::Command;

/// The agents that may start: a line that a server writes into the pipe of `--ready`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StartableAgents {
    /// The agents of the scenario with which the server was started.
    OfStart,
    /// The agents of a run that was requested later, by its scenario file.
    OfScenario(PathBuf),
    /// The agents with these ids, which had left the run before it was reset.
    Restarted(Vec<u32>),
}

impl StartableAgents {
    const OF_START: &str = "ready";
    const RESTARTED: &str = "restarted ";

    /// Reads a line; what is no other word is a file.
    #[must_use]
    pub fn of_line(line: &str) -> Self {
        if line == Self::OF_START {
            return Self::OfStart;
        }
        let ids = line.strip_prefix(Self::RESTARTED).map(|ids| ids.split(',').map(str::parse).collect());
        match ids {
            Some(Ok(ids)) => Self::Restarted(ids),
            _ => Self::OfScenario(line.into()),
        }
    }
}

impl fmt::Display for StartableAgents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OfStart => f.write_str(Self::OF_START),
            Self::OfScenario(file) => write!(f, "{}", file.display()),
            Self::Restarted(ids) => {
                let ids: Vec<String> = ids.iter().map(u32::to_string).collect();
                write!(f, "{}{}", Self::RESTARTED, ids.join(","))
            }
        }
    }
}

/// A path as a process in `folder` finds it, the present folder if that is empty.
#[must_use]
pub fn within(folder: &Path, path: &Path) -> PathBuf {
    let path = folder.join(path);
    absolute(&path).unwrap_or(path)
}

/// The command of a program and its arguments, in `folder`, the present one if that is empty. A
/// program with a `/` in its name is looked for from that folder, another one in `PATH`.
#[must_use]
pub fn command(words: &[String], folder: &Path) -> Command {
    let (program, arguments) = words.split_first().map_or(("", [].as_slice()), |(first, rest)| (first.as_str(), rest));
    // A relative path would be that of a folder which depends on the system.
    let path = if program.contains('/') { within(folder, Path::new(program)) } else { PathBuf::from(program) };
    let mut command = Command::new(path);
    command.args(arguments);
    if !folder.as_os_str().is_empty() {
        command.current_dir(folder);
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_which_agents_may_start() {
        for agents in [
            StartableAgents::OfStart,
            StartableAgents::OfScenario("logs/run_2.toml".into()),
            StartableAgents::Restarted(vec![1, 40]),
        ] {
            assert_eq!(StartableAgents::of_line(&agents.to_string()), agents);
        }
    }
}
