//! `maes run`: a scenario over ROS 2, with a process for each agent, or in this process.

mod memory;
#[cfg(feature = "ros")]
pub(crate) mod processes;

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fmt;
#[cfg(feature = "ros")]
use std::io::IsTerminal;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{anyhow, bail};
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, ValueEnum};
use foxglove_server::PageOrigin;
use mapgen::MapError;
use recording::Recording;
use sim_server::cli::{ForkArgs, KeyArgs, assignment, recording_path, trace_file, whole};
use sim_server::setup::{self, SetupError};
use simulation::scenario::{Override, Scenario};
use system::input_file::{self, TEXT_BYTES_MAX};

use crate::controllers;

/// The scenario of a run that names none.
const DEFAULT_SCENARIO: &str = include_str!("../../launch_scripts/scenarios/default.toml");

/// Most agents of a team that no note warns of: a hundred run faster than real time.
const LARGE_TEAM: u32 = 200;

/// What it is called in errors.
const DEFAULT_NAME: &str = "the default scenario";

/// Why a program that was built without the feature `ros` refuses something.
#[cfg(not(feature = "ros"))]
pub(crate) const WITHOUT_ROS: &str = "this program was built without ROS 2";

pub(crate) const AFTER_HELP: &str = "\
With faults.on_agent_loss = \"wait\", agent processes that die are started again, each three times.

Exit codes: 0 the run has a result; 1 a failure of the system; 2 bad input; 3 agents were missing at
the start; 4 an agent was lost; 5 an agent was refused; 130 interrupted, or stopped by a request.";

/// Arguments of `run`.
#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// The scenario (.toml), or a recording of it (.mcap) [default: five agents walk at random
    /// through a cave for half an hour]
    #[arg(value_parser = recording_path())]
    pub(crate) scenario: Option<PathBuf>,
    /// Resume the run of this recording, whose server was killed; completes it, or the file that
    /// --record names
    #[arg(long, value_name = "FILE.mcap", value_parser = recording_path())]
    resume: Option<PathBuf>,
    #[command(flatten)]
    fork: ForkArgs,
    /// ros2: a server and a process for each agent; memory: all in this process, without a network
    #[arg(long, value_enum, default_value_t = Transport::USUAL, value_name = "ros2|memory", hide_possible_values = true)]
    transport: Transport,
    /// Show the run in a browser or in Foxglove at this address; `maes view` does more
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, default_missing_value = foxglove_server::DEFAULT_ADDRESS)]
    pub(crate) view: Option<String>,
    /// Keep the page after the end of a run that is shown, for a restart and new runs, until Ctrl-C
    /// [default: on a terminal; with `maes view`: true]
    #[arg(long, value_name = "true|false", num_args = 0..=1, default_missing_value = "true")]
    stay: Option<bool>,
    /// The folder of the page, if it is not the one that was built here
    #[arg(long, value_name = "DIR")]
    pub(crate) page: Option<PathBuf>,
    /// Let pages of this origin connect as well, such as <https://app.foxglove.dev>; may be
    /// repeated
    #[arg(long, value_name = "ORIGIN")]
    pub(crate) view_allow_origin: Vec<PageOrigin>,
    /// The folder of the processes' logs [default: out/logs/TIME-PID; over memory: no logs]
    #[arg(long, value_name = "DIR")]
    logs: Option<PathBuf>,

    /// A setting of the agents' controllers: the key agents.set.KEY; can be given again
    #[arg(long, value_name = "KEY=VALUE", value_parser = assignment, help_heading = "Agents")]
    agent_set: Vec<(String, toml::Value)>,
    /// Agents that are started elsewhere, each a process of its own; those of the key
    /// agents.cmd_vel are among them
    #[arg(long, value_name = "ID,...", value_parser = ids, help_heading = "Agents")]
    external: Option<Ids>,
    /// Agents in each process; the result does not depend on it [default: auto: one, or more in
    /// teams of over 20 agents if this machine has few cores]
    #[arg(long, value_name = "N|auto", value_parser = process_size, help_heading = "Agents")]
    agents_per_process: Option<ProcessSize>,
    /// The order in which agents start [default: forward]
    #[arg(
        long,
        value_enum,
        value_name = "forward|reverse|shuffle",
        hide_possible_values = true,
        help_heading = "Agents"
    )]
    order: Option<OrderName>,
    /// Longest random delay of an agent before each reply
    #[arg(long, value_name = "MS", help_heading = "Agents", value_parser = whole::<u64>(0..=u64::MAX))]
    chaos_delay_ms: Option<u64>,
    /// Run the agents on the hosts of this file; the server stays here (docs/hosts.md)
    #[arg(long, value_name = "FILE.toml", help_heading = "Agents")]
    hosts: Option<PathBuf>,
    /// Offer the properties of each agent as ROS parameters [default: if a process runs no more
    /// than 8 agents]
    #[arg(long, value_name = "true|false", hide_possible_values = true, help_heading = "Agents")]
    agent_parameters: Option<bool>,
    /// Run all agents on one thread; only with --transport memory
    #[arg(long, help_heading = "Agents")]
    together: bool,
    /// Print how much wall time the agents' decisions take; only with --transport memory
    #[arg(long, help_heading = "Agents")]
    decision_times: bool,
    /// Print where the wall time of the server went, and over memory that of the agents; with a
    /// name, also write a trace for Perfetto or chrome://tracing
    #[arg(long, value_name = "FILE.json", num_args = 0..=1, default_missing_value = "", value_parser = trace_file)]
    profile: Option<PathBuf>,
    /// Write what is printed about the run to this file as well; only with --transport memory
    #[arg(long, value_name = "FILE", hide = true)]
    log: Option<PathBuf>,

    #[command(flatten, next_help_heading = "Keys of the scenario")]
    keys: KeyArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Transport {
    Ros2,
    Memory,
}

impl Transport {
    const USUAL: Self = if cfg!(feature = "ros") { Self::Ros2 } else { Self::Memory };
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum OrderName {
    Forward,
    Reverse,
    Shuffle,
}

/// Ids of agents.
#[derive(Debug, Clone)]
struct Ids(BTreeSet<u32>);

/// Most digits of an id, and of a number of agents.
const DIGITS_MAX: usize = 4;

fn number(text: &str) -> Option<u32> {
    let is_plain = (1..=DIGITS_MAX).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
    is_plain.then(|| text.parse().ok())?
}

fn ids(text: &str) -> Result<Ids, String> {
    let parts = text.split(',').filter(|_| !text.is_empty());
    parts
        .map(number)
        .collect::<Option<BTreeSet<u32>>>()
        .map(Ids)
        .ok_or_else(|| "expected ids of agents, such as 0,3".to_owned())
}

/// How many agents share a process.
#[derive(Debug, Clone, Copy)]
enum ProcessSize {
    Auto,
    Fixed(NonZero<u32>),
}

impl fmt::Display for ProcessSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Fixed(size) => size.fmt(f),
        }
    }
}

fn process_size(text: &str) -> Result<ProcessSize, String> {
    if text == "auto" {
        return Ok(ProcessSize::Auto);
    }
    let size = number(text).and_then(NonZero::new);
    size.map(ProcessSize::Fixed).ok_or_else(|| "expected a number from 1, or auto".to_owned())
}

impl RunArgs {
    /// What was typed as overrides of the scenario.
    fn overrides(&self) -> Vec<Override> {
        let mut overrides = self.keys.overrides();
        overrides.extend(self.agent_set.iter().map(|(key, value)| Override {
            origin: format!("--agent-set {key}={value}"),
            key: format!("agents.set.{key}"),
            value: Some(value.clone()),
        }));
        overrides
    }

    pub(crate) fn scenario(&self) -> anyhow::Result<Scenario> {
        let overrides = self.overrides();
        if let Some((file, at)) = self.fork.point() {
            return Ok(setup::fork(&Recording::open(file)?, at, &overrides)?);
        }
        let scenario = match self.resume.as_ref().or(self.scenario.as_ref()) {
            Some(file) => setup::load(file, &overrides).map_err(|error| match is_plan(file) {
                true => {
                    anyhow!("{0}: a plan of many runs; expected a scenario: maes batch {0} --out DIR", file.display())
                }
                false => error.into(),
            })?,
            None => setup::parse(DEFAULT_NAME, DEFAULT_SCENARIO, &overrides)?,
        };
        // A resumed run has the map of its recording.
        if self.resume.is_none() {
            self.check_map(&scenario, &overrides)?;
        }
        Ok(scenario)
    }

    /// Refuses a map that a flag has made impossible, and names the flag.
    fn check_map(&self, scenario: &Scenario, overrides: &[Override]) -> anyhow::Result<()> {
        let Err(error) = setup::check_map(scenario) else { return Ok(()) };
        let is_of_map = |change: &&Override| change.key == "map" || change.key.starts_with("map.");
        match overrides.iter().rfind(is_of_map) {
            Some(change) if change.key == "map.file" && scenario.map.file.as_deref() == Some(Path::new("")) => {
                bail!(
                    "{} is empty; expected spheres, noise, building, mine, scene, or a map file",
                    change.origin.trim_end()
                )
            }
            // The name of the file is in both.
            Some(change) if change.key == "map.file" => {
                bail!("{error}; expected spheres, noise, building, mine, scene, or a map file: {}", change.origin)
            }
            Some(change) => {
                let remedy = match &error {
                    SetupError::Map { table, source: MapError::OutOfRange { key, .. } } => {
                        format!("; choose a larger map, or a value that fits: --set {table}.{key}=VALUE")
                    }
                    _ => String::new(),
                };
                bail!("{}: {error}{remedy}", change.origin)
            }
            None => bail!("{}: {error}", self.name()),
        }
    }

    /// That a team is larger than what runs fast, if it is.
    fn note_on_team(&self, scenario: &Scenario) -> Option<String> {
        let agents = scenario.agents.count;
        (agents > LARGE_TEAM).then(|| {
            let remedy = match self.transport {
                Transport::Ros2 => "; --transport memory is faster, with the same result",
                Transport::Memory => "",
            };
            format!("{agents} agents: a run of so many may be slower than real time{remedy}")
        })
    }

    /// What the scenario is called in errors.
    fn name(&self) -> String {
        let file = self.scenario.as_ref().or(self.fork.fork.as_ref());
        file.map_or_else(|| DEFAULT_NAME.to_owned(), |file| file.display().to_string())
    }

    /// Refuses flags that have no meaning over this transport.
    pub(crate) fn check_transport(&self) -> anyhow::Result<()> {
        if self.stay.is_some() && self.view.is_none() {
            bail!("--stay: only with --view");
        }
        if self.transport == Transport::Ros2 {
            let of_memory = [("together", self.together), ("decision-times", self.decision_times)];
            let of_memory = of_memory.into_iter().chain([("log", self.log.is_some())]);
            if let Some((flag, _)) = of_memory.into_iter().find(|(_, is_given)| *is_given) {
                bail!("--{flag}: only with --transport memory");
            }
            return Ok(());
        }
        if let Some(file) = &self.hosts {
            bail!("--hosts {}: over memory no processes are started; leave it out", file.display());
        }
        if let Some(size) = self.agents_per_process {
            bail!("--agents-per-process {size}: over memory there is one process; leave it out");
        }
        if let Some(Ids(ids)) = &self.external {
            let ids: Vec<String> = ids.iter().map(u32::to_string).collect();
            bail!("--external {}: over memory there are no other processes; leave it out", ids.join(","));
        }
        if let Some(order) = self.order.and_then(|order| order.to_possible_value()) {
            bail!("--order {}: over memory no processes are started; leave it out", order.get_name());
        }
        if let Some(file) = &self.resume {
            bail!("--resume {}: over memory no server is left to resume; leave out --transport", file.display());
        }
        if self.view.is_some() {
            bail!("--view: runs over memory cannot be observed; record the run, and view the recording");
        }
        if let Some(parameters) = self.agent_parameters {
            bail!("--agent-parameters {parameters}: over memory there are no nodes; leave it out");
        }
        Ok(())
    }

    /// The first flag that was typed; of a command that has these arguments.
    pub(crate) fn first_flag(given: &ArgMatches, but: &[&str]) -> Option<String> {
        let command = Self::augment_args(clap::Command::new("run"));
        let flags = command.get_arguments().filter_map(|arg| Some((arg.get_id().as_str(), arg.get_long()?)));
        let mut typed = flags.filter(|(id, _)| !but.contains(id) && is_given(given, id));
        typed.next().map(|(_, long)| format!("--{long}"))
    }
}

/// Whether a file has the keys of a plan, and not those of a scenario.
fn is_plan(file: &Path) -> bool {
    let text = input_file::read_text(file, TEXT_BYTES_MAX).unwrap_or_default();
    let has = |key: &str| toml::from_str::<toml::Table>(&text).is_ok_and(|table| table.contains_key(key));
    has("seeds") && !has("agents")
}

/// Whether an argument was typed.
pub(crate) fn is_given(given: &ArgMatches, id: &str) -> bool {
    given.value_source(id) == Some(ValueSource::CommandLine)
}

pub(crate) fn flag(name: &str, value: impl Into<OsString>) -> OsString {
    let mut flag = OsString::from(format!("--{name}="));
    flag.push(value.into());
    flag
}

/// Runs a scenario.
#[cfg_attr(not(feature = "ros"), expect(unused_variables, reason = "a server is given what was typed"))]
pub(crate) fn run(args: &RunArgs, given: &ArgMatches) -> anyhow::Result<ExitCode> {
    args.check_transport()?;
    match args.transport {
        Transport::Memory => {
            let scenario = args.scenario()?;
            controllers::check(&scenario, &BTreeSet::new())?;
            args.note_on_team(&scenario).iter().for_each(|note| tracing::info!("note: {note}"));
            memory::run(args, &scenario)
        }
        #[cfg(feature = "ros")]
        Transport::Ros2 => {
            let mut flags = args.server_flags(given);
            if args.view.is_some() {
                flags.extend(args.flags_of_view(given, std::io::stderr().is_terminal())?);
            }
            processes::run(args, flags, None)
        }
        #[cfg(not(feature = "ros"))]
        Transport::Ros2 => bail!("--transport ros2: {WITHOUT_ROS}; expected memory"),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Cli {
        #[command(flatten)]
        run: RunArgs,
    }

    pub(super) fn parsed(line: &str) -> (RunArgs, ArgMatches) {
        use clap::{CommandFactory, FromArgMatches};
        let matches = Cli::command().try_get_matches_from(line.split(' ')).unwrap();
        (Cli::from_arg_matches(&matches).unwrap().run, matches)
    }

    #[test]
    fn a_run_without_a_scenario_is_the_default_one() {
        let scenario = parsed("run --agents 2").0.scenario().unwrap();
        assert_eq!((scenario.agents.count, scenario.seed), (2, 1));
    }

    #[test]
    fn map_that_a_flag_makes_impossible_is_the_fault_of_the_flag() {
        let refused = |line: &str| parsed(line).0.scenario().unwrap_err().to_string();
        let text = refused("run --size 12");
        assert!(text.starts_with("--size 12: map.spheres: radius_max is 8, allowed is 3 to 4; "), "{text}");
        let text = refused("run --map none.m3dm");
        assert!(text.starts_with("none.m3dm: ") && text.ends_with("or a map file: --map none.m3dm"), "{text}");
        assert!(!text.contains(DEFAULT_NAME), "{text}");
    }

    #[test]
    fn large_teams_are_noted() {
        let note = |line: &str| parsed(line).0.note_on_team(&parsed(line).0.scenario().unwrap());
        assert_eq!(note("run --agents 200"), None);
        assert!(note("run --agents 500").is_some_and(|note| note.starts_with("500 agents: ")));
    }

    #[test]
    fn plan_is_no_scenario() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("plan.toml");
        std::fs::write(&file, "seeds = \"1..3\"\n[scenario]\nduration_s = 5.0\n").unwrap();
        let error = parsed(&format!("run {}", file.display())).0.scenario().unwrap_err().to_string();
        assert!(error.contains("a plan of many runs") && error.contains("maes batch"), "{error}");
    }

    #[test]
    fn ids_are_numbers_of_four_digits() {
        assert_eq!(ids("3,0,3").unwrap().0, BTreeSet::from([0, 3]));
        assert!(ids("").unwrap().0.is_empty());
        for wrong in ["a", "1,", "-1", "12345", "1;2"] {
            assert!(ids(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn flags_that_do_not_fit_the_transport_are_refused() {
        let refused = |line: &str| parsed(line).0.check_transport().unwrap_err().to_string();
        assert_eq!(refused("run --together"), "--together: only with --transport memory");
        let over_memory = |flags: &str| refused(&format!("run --transport memory {flags}"));
        assert!(over_memory("--order shuffle").starts_with("--order shuffle: over memory no processes are started"));
        assert!(over_memory("--hosts h.toml").starts_with("--hosts h.toml: over memory no processes are started"));
        assert!(over_memory("--external 1,0").starts_with("--external 0,1: over memory"));
        assert!(over_memory("--view").starts_with("--view: "));
        assert!(over_memory("--resume a.mcap").starts_with("--resume a.mcap: "));
        assert!(over_memory("--agent-parameters true").starts_with("--agent-parameters true: "));
    }
}
