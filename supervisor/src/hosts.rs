//! Further hosts that run agents: the file that lists them, and which agents each runs.
//!
//! The server runs where the supervisor does. On each host of the file a launcher, such as ssh,
//! starts one process, which starts the agents there ([`serve`]) and stays connected through its
//! standard input and output (`connection`). Nothing else is needed on a host but the binaries.
//!
//! Invariants: every agent of the team runs on one host; which one it is does not change the run;
//! secrets go through the connection and stand on no command line.

pub(crate) mod connection;
mod log;
mod messages;
pub mod serve;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use system::input_file;

use crate::SupervisorError;
use crate::team::Group;

/// Most hosts of a file.
const HOSTS_MAX: usize = 1000;

/// Largest file.
const BYTES_MAX: u64 = 1 << 20;

/// Stands for the key of the same name in the words of `command`.
const PLACEHOLDERS: [&str; 2] = ["{name}", "{address}"];

/// How agents get to their hosts.
#[derive(Debug, Clone, PartialEq)]
pub struct Hosts {
    /// The file, for errors.
    pub file: PathBuf,
    /// The address at which the hosts reach the server.
    pub server: String,
    pub hosts: Vec<Host>,
}

/// One host.
#[derive(Debug, Clone, PartialEq)]
pub struct Host {
    pub name: String,
    /// The words before the program that starts the agents; none on this machine.
    pub launcher: Launcher,
    pub share: Share,
    /// The folder with `maes` there; that of this program if nothing is said.
    pub binaries: Option<PathBuf>,
    /// Environment variables of the agents.
    pub environment: BTreeMap<String, String>,
}

/// How a program is started on a host.
#[derive(Debug, Clone, PartialEq)]
pub enum Launcher {
    /// As a child process.
    Local,
    /// Words before the program and its arguments.
    Words(Vec<String>),
    /// Words before one word that a shell there splits.
    Shell(Vec<String>),
}

/// Which agents a host runs.
#[derive(Debug, Clone, PartialEq)]
pub enum Share {
    /// These.
    Agents(BTreeSet<u32>),
    /// Of the other agents so many, in proportion to the shares of the other hosts.
    Of(f64),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileText {
    server: String,
    #[serde(default)]
    host: Vec<HostText>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct HostText {
    name: String,
    launcher: Option<LauncherName>,
    address: Option<String>,
    command: Option<Vec<String>>,
    agents: Option<String>,
    share: Option<f64>,
    binaries: Option<PathBuf>,
    #[serde(default)]
    environment: BTreeMap<String, String>,
}

#[derive(Debug, Clone, Copy, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum LauncherName {
    Ssh,
    Srun,
    Command,
    Local,
}

impl Hosts {
    /// Reads a file of hosts.
    ///
    /// # Errors
    /// If it cannot be read, or says something that is not allowed.
    pub fn read(file: &Path) -> Result<Self, SupervisorError> {
        let failed = |reason: String| SupervisorError::Hosts { file: file.to_owned(), reason };
        let text = input_file::read_text(file, BYTES_MAX).map_err(|error| failed(error.to_string()))?;
        Self::parse(file, &text)
    }

    fn parse(file: &Path, text: &str) -> Result<Self, SupervisorError> {
        let failed = |reason: String| SupervisorError::Hosts { file: file.to_owned(), reason };
        let parsed: FileText = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let line = 1 + text.bytes().take(start).filter(|&byte| byte == b'\n').count();
            let message: Vec<&str> = error.message().lines().map(str::trim).collect();
            failed(format!("line {line}: {}", message.join("; ")))
        })?;
        if parsed.server.is_empty() || parsed.server.contains([';', ' ']) {
            let what = "the name or address at which the hosts reach this machine, such as \"10.0.0.1\"";
            return Err(failed(format!("server = {:?}: expected {what}", parsed.server)));
        }
        if parsed.host.is_empty() || parsed.host.len() > HOSTS_MAX {
            return Err(failed(format!("expected 1 to {HOSTS_MAX} tables [[host]]")));
        }
        let mut names = BTreeSet::new();
        let mut hosts = Vec::new();
        for host in parsed.host {
            let name = host.name.clone();
            let of_host = |reason: String| failed(format!("host {name:?}: {reason}"));
            let host = host.checked().map_err(of_host)?;
            if !names.insert(host.name.clone()) {
                return Err(of_host("two hosts have this name".to_owned()));
            }
            hosts.push(host);
        }
        Ok(Self { file: file.to_owned(), server: parsed.server, hosts })
    }

    /// The agents of each host.
    ///
    /// # Errors
    /// If an agent has no host, or two.
    pub(crate) fn distribute(&self, agents: &BTreeSet<u32>) -> Result<Vec<BTreeSet<u32>>, SupervisorError> {
        let failed = |reason: String| SupervisorError::Hosts { file: self.file.clone(), reason };
        let mut owners: BTreeMap<u32, &str> = BTreeMap::new();
        for host in &self.hosts {
            let Share::Agents(listed) = &host.share else { continue };
            for agent in listed {
                if !agents.contains(agent) {
                    let name = &host.name;
                    return Err(failed(format!("host {name:?}: agent {agent} takes no part, or is started elsewhere")));
                }
                if let Some(other) = owners.insert(*agent, &host.name) {
                    return Err(failed(format!("agent {agent}: on two hosts, {other:?} and {:?}", host.name)));
                }
            }
        }
        let unlisted: Vec<u32> = agents.iter().copied().filter(|agent| !owners.contains_key(agent)).collect();
        let share = |host: &Host| match host.share {
            Share::Agents(_) => 0.0,
            Share::Of(share) => share,
        };
        let sum: f64 = self.hosts.iter().map(share).sum();
        if let (Some(agent), true) = (unlisted.first(), sum <= 0.0) {
            return Err(failed(format!(
                "agent {agent} has no host: list it, or give a host a share instead of agents"
            )));
        }
        let (mut so_far, mut next) = (0.0, 0);
        let split = self.hosts.iter().map(|host| {
            if let Share::Agents(listed) = &host.share {
                return listed.clone();
            }
            so_far += share(host);
            let end = ((unlisted.len() as f64 * so_far / sum).round() as usize).min(unlisted.len());
            let begin = std::mem::replace(&mut next, end);
            unlisted[begin..end].iter().copied().collect()
        });
        Ok(split.collect())
    }
}

impl HostText {
    fn checked(self) -> Result<Host, String> {
        let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
        if self.name.is_empty() || !self.name.bytes().all(is_plain) {
            return Err("expected a name of letters, digits, `-`, `_` and `.`".to_owned());
        }
        let address = self.address.clone().unwrap_or_else(|| self.name.clone());
        if address.starts_with('-') || address.is_empty() {
            return Err(format!("address = {address:?}: expected a name or an address"));
        }
        let share = match (&self.agents, self.share) {
            (Some(_), Some(_)) => return Err("expected agents or a share, not both".to_owned()),
            (Some(agents), None) => Share::Agents(ids(agents)?),
            (None, share) => {
                let share = share.unwrap_or(1.0);
                if !(share > 0.0 && share <= 1e6) {
                    return Err(format!("share = {share}: expected a number above 0 and at most 1e6"));
                }
                Share::Of(share)
            }
        };
        for (name, value) in &self.environment {
            if name.is_empty() || name.contains(['=', '\0']) || value.contains('\0') {
                return Err(format!("environment: {name:?}: expected a name without `=`"));
            }
        }
        let launcher = self.launcher(&address)?;
        Ok(Host { name: self.name, launcher, share, binaries: self.binaries, environment: self.environment })
    }

    fn launcher(&self, address: &str) -> Result<Launcher, String> {
        let words = |words: &[&str]| words.iter().map(|&word| word.to_owned()).collect();
        let name = match (self.launcher, &self.command) {
            (Some(LauncherName::Command) | None, Some(command)) => {
                if command.first().is_none_or(String::is_empty) {
                    return Err("command: expected a program and its arguments".to_owned());
                }
                let [name, at] = PLACEHOLDERS;
                let filled = command.iter().map(|word| word.replace(name, &self.name).replace(at, address));
                return Ok(Launcher::Words(filled.collect()));
            }
            (Some(LauncherName::Command), None) => return Err("launcher = \"command\": expected a command".to_owned()),
            (Some(_), Some(_)) => return Err("command: only with launcher = \"command\"".to_owned()),
            (None, None) => {
                return Err("expected a launcher: \"ssh\", \"srun\", \"local\", or a command".to_owned());
            }
            (Some(name), None) => name,
        };
        Ok(match name {
            LauncherName::Local => Launcher::Local,
            // ssh asks nothing, and ends when nothing comes from the host for 15 s.
            LauncherName::Ssh => {
                let options =
                    ["-T", "-o", "BatchMode=yes", "-o", "ServerAliveInterval=5", "-o", "ServerAliveCountMax=3"];
                Launcher::Shell(words(&[&["ssh"], &options[..], &[address]].concat()))
            }
            // One task, on the node of that name, beside other steps of the allocation.
            _ => Launcher::Words(words(&["srun", "--nodes=1", "--ntasks=1", "--overlap", "--nodelist", address])),
        })
    }
}

/// Ids and ranges, such as `0-4,9`.
fn ids(text: &str) -> Result<BTreeSet<u32>, String> {
    let wrong = || format!("agents = {text:?}: expected ids and ranges below 10000, such as \"0-4,9\"");
    let number = |text: &str| {
        let text = text.trim();
        let is_plain = (1..=4).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
        is_plain.then(|| text.parse::<u32>().ok()).flatten().ok_or_else(wrong)
    };
    let mut ids = BTreeSet::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last) = (number(first)?, number(last)?);
        if last < first {
            return Err(wrong());
        }
        ids.extend(first..=last);
    }
    Ok(ids)
}

/// The processes for these agents, with at most `size` agents each.
pub(crate) fn groups(agents: &BTreeSet<u32>, size: u32) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for &agent in agents {
        match groups.last_mut() {
            Some(group) if group.last + 1 == agent && agent - group.first < size => group.last = agent,
            _ => groups.push(Group { first: agent, last: agent }),
        }
    }
    groups
}

#[cfg(test)]
mod tests;
