//! A run over ROS 2: what was typed as the work of a supervisor, which starts the server and its
//! agents.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::{ArgMatches, Args};
use experiments::plan::BUILD;
use foxglove_server::{TOKEN_VARIABLE, Token};
use recording::Recording;
use recording::location::is_recording;
use recording::playback::{Horizon, Playback};
use sim_server::cli::KeyArgs;
use sim_server::exit;
use simulation::scenario::{Rtf, Scenario};
use supervisor::hosts::Hosts;
use supervisor::run::{Console, RemoteHosts, Run, STAY, Source};
use supervisor::team::{Order, Team};
use supervisor::{binaries, logs, outside};

use super::{DEFAULT_SCENARIO, OrderName, ProcessSize, RunArgs, flag, is_given};
use crate::{controllers, signals};

/// Real-time factor of a run that is shown: at full speed, most are over before one has looked.
const SHOWN_RTF: u32 = 5;

/// The file that the server reads the default scenario from.
const DEFAULT_FILE: &str = "default.toml";

impl RunArgs {
    fn source(&self) -> Source {
        match (&self.scenario, self.resume.as_ref().or(self.fork.fork.as_ref())) {
            (Some(file), _) => Source::File(file.clone()),
            (None, Some(_)) => Source::Resumed,
            (None, None) => Source::Text { name: DEFAULT_FILE, toml: DEFAULT_SCENARIO.to_owned() },
        }
    }

    fn team(&self) -> Team {
        Team {
            per_process: match self.agents_per_process {
                None | Some(ProcessSize::Auto) => None,
                Some(ProcessSize::Fixed(size)) => Some(size),
            },
            order: match self.order {
                None | Some(OrderName::Forward) => Order::Forward,
                Some(OrderName::Reverse) => Order::Reverse,
                Some(OrderName::Shuffle) => Order::Shuffle,
            },
            third_party: self.external.as_ref().map(|ids| ids.0.clone()).unwrap_or_default(),
            chaos_delay_ms: self.chaos_delay_ms,
            parameters: self.agent_parameters,
        }
    }

    /// Begins paused, as if that were typed.
    pub(crate) fn begin_paused(&mut self) {
        self.keys.paused = Some(true);
    }

    /// Refuses to start a program because a recording, which may come from anywhere, names it.
    pub(super) fn check_command(&self, scenario: &Scenario) -> anyhow::Result<()> {
        let command = &scenario.agents.command;
        let source = self.resume.as_ref().or(self.scenario.as_ref()).filter(|file| is_recording(file));
        let recording = source.or(self.fork.fork.as_ref());
        let is_typed = self.overrides().iter().any(|key| key.key == "agents.command");
        match recording {
            Some(file) if !command.is_empty() && !is_typed => bail!(
                "{}: agents.command = {command:?}: a program that a recording names is not started by itself; if you \
                 trust it, repeat it: --set 'agents.command={command:?}'",
                file.display()
            ),
            _ => Ok(()),
        }
    }

    /// The flags of `sim_server run` for what was typed.
    pub(crate) fn server_flags(&self, given: &ArgMatches) -> Vec<OsString> {
        let mut flags = Vec::new();
        for arg in KeyArgs::augment_args(clap::Command::new("keys")).get_arguments() {
            let id = arg.get_id().as_str();
            let Some(long) = arg.get_long().filter(|_| is_given(given, id)) else { continue };
            flags.extend(given.get_raw(id).into_iter().flatten().map(|value| flag(long, value)));
        }
        let settings = self.agent_set.iter();
        flags.extend(settings.map(|(key, value)| flag("set", format!("agents.set.{key}={value}"))));
        flags.extend(self.resume.iter().map(|file| flag("resume", file)));
        if let Some((file, at)) = self.fork.point() {
            flags.extend([flag("fork", file), flag("at", (at.time_ns() as f64 / 1e9).to_string())]);
        }
        flags.extend(self.view.iter().map(|address| flag("view", address)));
        flags.extend(self.profile.iter().map(|file| flag("profile", file)));
        flags.extend(self.page.iter().filter(|_| self.view.is_some()).map(|folder| flag("page", folder)));
        if self.view.is_some() {
            flags.extend(self.origin_flags());
        }
        flags
    }

    /// Further flags of `sim_server run` for a run that is shown: five times real time unless
    /// something else is wanted, and whether the page stays after the end.
    pub(crate) fn flags_of_view(&self, given: &ArgMatches, stays: bool) -> anyhow::Result<Vec<OsString>> {
        let mut flags = Vec::new();
        if !is_given(given, "rtf") && matches!(self.scenario()?.execution.rtf, Rtf::Max(_)) {
            flags.push(flag("rtf", SHOWN_RTF.to_string()));
        }
        if self.stay.unwrap_or(stays) {
            flags.push(STAY.into());
            let agents = binaries::program(&binaries::folder()?, "agent_node");
            flags.extend(agents.into_iter().map(|word| flag("check-agents", word)));
        }
        Ok(flags)
    }

    /// The flags of `sim_server run` for the origins whose pages may connect.
    pub(crate) fn origin_flags(&self) -> impl Iterator<Item = OsString> {
        self.view_allow_origin.iter().map(|origin| flag("view-allow-origin", origin.to_string()))
    }
}

/// The environment of a server with this token, which no user but this one can read.
pub(crate) fn token_env(token: &Token) -> Vec<(&'static str, String)> {
    vec![(TOKEN_VARIABLE, token.as_str().to_owned())]
}

/// Runs a scenario with these flags of `sim_server run`, and this token if it is observed.
pub(crate) fn run(args: &RunArgs, server_flags: Vec<OsString>, token: Option<&Token>) -> anyhow::Result<ExitCode> {
    let interruptions = signals::count()?;
    if let Some(file) = &args.resume
        && let Horizon::Ended(tick) = Playback::new(&Recording::open(file)?)?.horizon()
    {
        tracing::info!("note: {}: its run has ended in tick {tick}, and its recording is complete", file.display());
        return Ok(ExitCode::SUCCESS);
    }
    let scenario = args.scenario()?;
    let team = args.team();
    team.check(&scenario)?;
    // The server does not know the controllers.
    controllers::check(&scenario, &team.third_party)?;
    args.check_command(&scenario)?;
    outside::check(&scenario, Path::new(""))?;
    args.note_on_team(&scenario).iter().for_each(|note| tracing::info!("note: {note}"));
    if interruptions() > 0 {
        return Ok(ExitCode::from(exit::BY_SIGNAL));
    }
    let hosts = args.hosts.as_deref().map(Hosts::read).transpose()?;
    let run = Run {
        binaries: binaries::folder()?,
        domain: None,
        scenario: &scenario,
        source: args.source(),
        server_flags,
        server_env: token.map(token_env).unwrap_or_default(),
        team,
        hosts: hosts.map(|hosts| RemoteHosts { hosts, build: BUILD }),
        folder: PathBuf::new(),
        logs: args.logs.clone().unwrap_or_else(logs::default_folder),
        console: Console::Inherited,
    };
    let ended = run.supervise(&interruptions, &|text| tracing::info!("{text}"))?;
    Ok(ExitCode::from(ended.code))
}

#[cfg(test)]
mod tests {
    use super::super::tests::parsed;
    use super::*;

    #[test]
    fn keys_are_passed_on_as_they_were_typed() {
        let (args, given) = parsed(
            "run s.toml --seed 7 --record-topics map,odom --paused --set a.b=[1,2] --set c=-1 --size=9x8x7 \
             --agent-set speed=1.5 --agents 2 --view --order reverse --view-allow-origin https://a.example",
        );
        let mut flags: Vec<_> = args.server_flags(&given).into_iter().map(|flag| flag.into_string().unwrap()).collect();
        flags.sort();
        let expected = [
            "--agents=2",
            "--paused=true",
            "--record-topics=map",
            "--record-topics=odom",
            "--seed=7",
            "--set=a.b=[1,2]",
            "--set=agents.set.speed=1.5",
            "--set=c=-1",
            "--size=9x8x7",
            "--view-allow-origin=https://a.example",
            "--view=127.0.0.1:8765",
        ];
        assert_eq!(flags, expected);
        assert_eq!(RunArgs::first_flag(&given, &[]).as_deref(), Some("--view"));
        assert_eq!(RunArgs::first_flag(&parsed("run a.mcap").1, &[]), None);
    }

    #[test]
    fn a_shown_run_takes_five_times_real_time_unless_something_else_is_wanted() {
        let rtf = |line: &str| {
            let (args, given) = parsed(line);
            let flags = args.flags_of_view(&given, false).unwrap();
            flags.into_iter().map(|flag| flag.into_string().unwrap()).collect::<Vec<_>>()
        };
        assert_eq!(rtf("run --view"), ["--rtf=5"]);
        assert!(rtf("run --view --rtf max").is_empty());
        assert!(rtf("run --view --set execution.rtf=2.0").is_empty());
        assert_eq!(rtf("run --view --rtf 1 --stay")[0], "--stay");
        let (args, given) = parsed("run --view --rtf 1 --stay false");
        assert!(args.flags_of_view(&given, true).unwrap().is_empty());
    }

    #[test]
    fn program_of_a_recording_has_to_be_typed() {
        let scenario = parsed("run --set agents.command=[\"./own\"]").0.scenario().unwrap();
        let check = |line: &str| parsed(line).0.check_command(&scenario);
        for trusted in ["run", "run s.toml", "run a.mcap --set agents.command=[\"./own\"]"] {
            assert!(check(trusted).is_ok(), "{trusted}");
        }
        for foreign in [
            "run a.mcap",
            "run a.mcap --set agents.command_signs=true",
            "run --resume a.mcap",
            "run --fork a.mcap --at 1",
        ] {
            let refused = check(foreign).unwrap_err().to_string();
            assert!(refused.ends_with("repeat it: --set 'agents.command=[\"./own\"]'"), "{refused}");
        }
    }
}
