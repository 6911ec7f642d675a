//! One run: a server, its agents, an exit code and a summary.
//!
//! With `faults.on_agent_loss = "wait"` the server holds the clock for agents that are lost; then
//! agent processes that die are started again, each [`RESTARTS_MAX`] times.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use simulation::scenario::{OnAgentLoss, Scenario};
use system::diagnostics;
use system::exit_code as exit;
use system::program::{self, StartableAgents};
use system::summary::Summary;

use crate::child::{ChildGuard, Signal, exit_code};
use crate::domain::{self, DomainLock};
use crate::hosts::Hosts;
use crate::idle::RequestedAgents;
use crate::processes::{self, AgentProcess, ChildEvents, JoinSecret, send};
use crate::ready::ReadyPipe;
use crate::remote::{self, RANGE, RemoteTeam, SUBNET};
use crate::team::{Group, Team};
use crate::{SupervisorError, outside};

/// Restarts of each agent process before it is given up.
pub const RESTARTS_MAX: u32 = 3;

/// The flag of a server that does not end with its run.
pub const STAY: &str = "--stay";

/// Exit code of an agent process that cannot join: an argument, a controller, a setting.
const AGENT_BAD_INPUT: u8 = 2;

/// Exit code of an agent process that the server has refused, because another one has its id.
const AGENT_REFUSED: u8 = 5;

/// Exit code of a process that SIGTERM has ended.
const BY_SIGTERM: u8 = 128 + Signal::SIGTERM as u8;

/// Where the server reads the scenario.
#[derive(Debug, Clone)]
pub enum Source {
    File(PathBuf),
    /// A text, whose paths start from the folder of the run; the server reads it from a file of
    /// this name in the folder of the logs.
    Text {
        name: &'static str,
        toml: String,
    },
    /// The recording that `--resume` names.
    Resumed,
}

/// Where the server prints.
#[derive(Debug, Clone)]
pub enum Console {
    /// Where this process does.
    Inherited,
    /// Results nowhere, everything else to a file.
    Quiet { stderr: PathBuf },
}

/// A run to supervise.
#[derive(Debug, Clone)]
pub struct Run<'a> {
    /// The folder with `sim_server` and `agent_node`.
    pub binaries: PathBuf,
    /// The ROS domain, if it is not that of the environment.
    pub domain: Option<u32>,
    /// The scenario as the server will read it, flags included.
    pub scenario: &'a Scenario,
    pub source: Source,
    /// Further flags of `sim_server run`.
    pub server_flags: Vec<OsString>,
    /// Further environment variables of `sim_server`, for what other users must not see.
    pub server_env: Vec<(&'static str, String)>,
    pub team: Team,
    /// Where the agents run, if that is not here.
    pub hosts: Option<RemoteHosts>,
    /// The folder that relative paths of the scenario start from; empty: the present one. Unless it
    /// is empty, the paths in `server_flags` and `logs` have to be absolute.
    pub folder: PathBuf,
    /// The folder of the logs.
    pub logs: PathBuf,
    pub console: Console,
}

/// Hosts, and the build that they must have.
#[derive(Debug, Clone)]
pub struct RemoteHosts {
    pub hosts: Hosts,
    pub build: &'static str,
}

/// How a supervised run has ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Ended {
    /// 0: the run has a result; 1: a failure of the system; 2: bad input; 3: agents were missing at
    /// the start; 4: an agent was lost; 5: an agent was refused; 130: interrupted, or stopped by a
    /// request; that of the server if a signal has ended it.
    pub code: u8,
    /// What the server says of the run, if it has a result.
    pub summary: Option<Summary>,
}

impl Run<'_> {
    /// Runs the processes to their end. `interruptions` is how often the user has asked for the end
    /// so far; `say` is given lines for stderr.
    ///
    /// # Errors
    /// If the run cannot begin, or a process cannot be started; no process is left then.
    pub fn supervise(&self, interruptions: &dyn Fn() -> u32, say: &dyn Fn(&str)) -> Result<Ended, SupervisorError> {
        self.team.check(self.scenario)?;
        let domain = self.domain.map_or_else(domain::of_environment, |id| id.to_string());
        let _lock = DomainLock::take(&domain)?;
        fs::create_dir_all(&self.logs).map_err(SupervisorError::of(&self.logs))?;
        let summary = self.logs.join("summary.json");
        drop(fs::remove_file(&summary));
        let mut events = ChildEvents::new()?;
        let mut ready = ReadyPipe::create(&self.logs)?;
        let secret = JoinSecret::of_environment()?;
        let Some(remote) = self.connect(&secret, interruptions, &mut events)? else {
            return Ok(Ended { code: exit::BY_SIGNAL, summary: None });
        };
        let server = processes::start(self.server(&ready, &summary, &secret)?)?;
        let mut supervision = Supervision {
            run: self,
            interruptions,
            say,
            secret,
            remote,
            server,
            forwarded: 0,
            agents: BTreeMap::new(),
            requested: RequestedAgents::default(),
            present: PresentRun::OfStart,
            restarts: BTreeMap::new(),
            refusal: None,
        };
        let code = match supervision.await_ready(&mut ready, &mut events)? {
            Some(code) => code,
            None => {
                supervision.start_team()?;
                let code = supervision.await_server(&mut ready, &mut events)?;
                supervision.end_agents(code, &mut events)?
            }
        };
        Ok(Ended { code, summary: Summary::read(&summary) })
    }

    /// Connects to the hosts; nothing if the user has interrupted that.
    fn connect(
        &self,
        secret: &JoinSecret,
        interruptions: &dyn Fn() -> u32,
        events: &mut ChildEvents,
    ) -> Result<Option<RemoteTeam>, SupervisorError> {
        let Some(RemoteHosts { hosts, build }) = &self.hosts else { return Ok(Some(RemoteTeam::default())) };
        let agents = hosts.distribute(&self.team.agents(self.scenario))?;
        let mut team = RemoteTeam::open(hosts, build, self, secret)?;
        while !team.is_ready()? {
            if interruptions() > 0 {
                return Ok(None);
            }
            events.wait(None)?;
        }
        team.assign(self, &agents);
        Ok(Some(team))
    }

    fn server(&self, ready: &ReadyPipe, summary: &Path, secret: &JoinSecret) -> Result<Command, SupervisorError> {
        let mut command = self.command("sim_server", secret);
        command.arg("run");
        match &self.source {
            Source::File(file) => drop(command.arg(file)),
            Source::Text { name, toml } => {
                let file = self.logs.join(name);
                fs::write(&file, toml).map_err(SupervisorError::of(&file))?;
                // It is in that folder already.
                command.arg(file).args(["--paths-from", "."]);
            }
            Source::Resumed => {}
        }
        command.envs(self.server_env.iter().cloned());
        if self.server_flags.iter().any(|flag| flag == STAY) {
            processes::kill_with_this_process(&mut command);
        }
        if self.hosts.is_some() && !remote::reaches_hosts(std::env::var(RANGE).ok().as_deref()) {
            command.env(RANGE, SUBNET);
        }
        if !self.team.third_party.is_empty() {
            let ids: Vec<String> = self.team.third_party.iter().map(u32::to_string).collect();
            command.arg("--external").arg(ids.join(","));
        }
        command.args(&self.server_flags).arg("--log").arg(self.logs.join("server.log"));
        command.arg("--ready").arg(ready.path()).arg("--summary").arg(summary);
        if let Console::Quiet { stderr } = &self.console {
            let file = File::create(stderr).map_err(SupervisorError::of(stderr))?;
            diagnostics::as_read(command.stdout(Stdio::null()).stderr(file));
        }
        Ok(command)
    }

    pub(crate) fn log_of(&self, group: Group) -> PathBuf {
        self.logs.join(format!("agent_{}.log", group.first))
    }

    /// One of the binaries.
    fn command(&self, name: &str, secret: &JoinSecret) -> Command {
        let binaries = program::within(Path::new(""), &self.binaries);
        let mut command = processes::command(&binaries, name, self.domain, secret);
        if !self.folder.as_os_str().is_empty() {
            command.current_dir(&self.folder);
        }
        command
    }

    /// The arguments of an `agent_node` on a host.
    pub(crate) fn remote_arguments(&self, group: Group) -> Vec<String> {
        let mut arguments = vec!["--id".to_owned(), format!("{}-{}", group.first, group.last)];
        if let Some(parameters) = self.team.parameters(self.scenario) {
            arguments.extend(["--parameters".to_owned(), parameters.to_string()]);
        }
        if let Some(delay) = self.team.chaos_delay_ms {
            arguments.extend(["--chaos-delay-ms".to_owned(), delay.to_string()]);
        }
        arguments
    }

    fn start_agents(&self, group: Group, secret: &JoinSecret) -> Result<ChildGuard, SupervisorError> {
        let agents = &self.scenario.agents;
        let mut command = if agents.is_commanded(group.first) {
            let mut command = outside::command(agents, &self.folder, group);
            processes::enter(&mut command, self.domain);
            if agents.command_signs {
                secret.give_to(&mut command);
            }
            if agents.names_id() {
                return processes::start_agents(command, &self.log_of(group));
            }
            if let Some(parameters) = self.team.parameters {
                command.arg("--parameters").arg(parameters.to_string());
            }
            command
        } else {
            let mut command = self.command("agent_node", secret);
            if let Some(parameters) = self.team.parameters(self.scenario) {
                command.arg("--parameters").arg(parameters.to_string());
            }
            command
        };
        if let Some(delay) = self.team.chaos_delay_ms {
            command.arg("--chaos-delay-ms").arg(delay.to_string());
        }
        processes::start_agents(processes::with_ids(command, group), &self.log_of(group))
    }
}

/// Whose agents a restart concerns.
#[derive(PartialEq)]
enum PresentRun {
    /// The run with which the server was started, or one that repeats it.
    OfStart,
    /// A run that was started on the page.
    Requested,
}

/// A run under way.
struct Supervision<'a> {
    run: &'a Run<'a>,
    interruptions: &'a dyn Fn() -> u32,
    say: &'a dyn Fn(&str),
    secret: JoinSecret,
    remote: RemoteTeam,
    server: ChildGuard,
    /// Interruptions that the server was sent.
    forwarded: u32,
    agents: BTreeMap<Group, AgentProcess>,
    /// Agents of runs that were started on the page after this one.
    requested: RequestedAgents,
    present: PresentRun,
    /// Restarts of the process of each agent.
    restarts: BTreeMap<u32, u32>,
    /// The exit code of a run that ends because of its agents.
    refusal: Option<u8>,
}

impl Supervision<'_> {
    /// Sends the server what the user has asked for: the first signal ends the run with a result,
    /// the second one ends the server at once.
    fn forward_interruptions(&mut self) {
        while self.forwarded < (self.interruptions)() {
            self.forwarded += 1;
            send(&self.server, Signal::SIGTERM);
        }
    }

    fn is_interrupted(&self) -> bool {
        self.forwarded > 0
    }

    /// Waits for the server's handshake; the exit code of a server that ends before.
    fn await_ready(&mut self, ready: &mut ReadyPipe, events: &mut ChildEvents) -> Result<Option<u8>, SupervisorError> {
        loop {
            self.forward_interruptions();
            let ended = self.server.ended().map_err(|source| SupervisorError::io("sim_server", source))?;
            let ready_agents = ready.next_agents();
            if ready_agents.map_err(|source| SupervisorError::io("ready", source))?.is_some() {
                return Ok(None);
            }
            if let Some(status) = ended {
                let code = exit_code(status);
                // It has not got as far as to handle the signal.
                let is_unhandled = self.is_interrupted() && code == BY_SIGTERM;
                return Ok(Some(if is_unhandled { exit::BY_SIGNAL } else { code }));
            }
            events.wait(Some(std::os::fd::AsFd::as_fd(ready)))?;
        }
    }

    fn start_team(&mut self) -> Result<(), SupervisorError> {
        let groups = match self.run.hosts {
            Some(_) => self.remote.groups(),
            None => self.run.team.groups(self.run.scenario),
        };
        for group in groups {
            self.forward_interruptions();
            if self.is_interrupted() {
                break;
            }
            drop(fs::remove_file(self.run.log_of(group)));
            let process = self.start_agents(group)?;
            self.agents.insert(group, process);
        }
        Ok(())
    }

    fn start_agents(&mut self, group: Group) -> Result<AgentProcess, SupervisorError> {
        match self.run.hosts {
            Some(_) => self.remote.start(group, self.run).map(AgentProcess::Remote),
            None => self.run.start_agents(group, &self.secret).map(AgentProcess::Local),
        }
    }

    /// Looks after the agents until the server ends, and starts those of the runs after this one;
    /// the server's exit code.
    fn await_server(&mut self, ready: &mut ReadyPipe, events: &mut ChildEvents) -> Result<u8, SupervisorError> {
        loop {
            self.forward_interruptions();
            self.look_after_agents()?;
            self.requested.look_after();
            if let Some(status) = self.server.ended().map_err(|source| SupervisorError::io("sim_server", source))? {
                return Ok(exit_code(status));
            }
            while let Some(agents) = ready.next_agents().map_err(|source| SupervisorError::io("ready", source))? {
                self.start_later(agents)?;
            }
            events.wait(Some(std::os::fd::AsFd::as_fd(ready)))?;
        }
    }

    /// Starts agents while the server is at work.
    fn start_later(&mut self, agents: StartableAgents) -> Result<(), SupervisorError> {
        let run = self.run;
        let binaries = program::within(Path::new(""), &run.binaries);
        match agents {
            StartableAgents::OfStart => {
                self.present = PresentRun::OfStart;
                self.restarts.clear();
                self.start_team()?;
            }
            StartableAgents::OfScenario(file) => {
                self.present = PresentRun::Requested;
                self.requested.start_run(&binaries, &run.logs, &file, &self.secret)?;
            }
            StartableAgents::Restarted(ids) if self.present == PresentRun::Requested => {
                self.requested.start(&binaries, &run.logs, ids.into_iter().map(Group::of), &self.secret)?;
            }
            StartableAgents::Restarted(ids) => {
                let own = run.team.agents(run.scenario);
                for group in ids.into_iter().filter(|id| own.contains(id)).map(Group::of) {
                    let process = self.start_agents(group)?;
                    self.agents.insert(group, process);
                }
            }
        }
        Ok(())
    }

    fn look_after_agents(&mut self) -> Result<(), SupervisorError> {
        let mut ended = Vec::new();
        for (&group, process) in &mut self.agents {
            if let Some(code) = process.ended()? {
                ended.push((group, code));
            }
        }
        self.remote.lost_hosts().into_iter().for_each(|line| (self.say)(&line));
        for (group, code) in ended {
            self.agents.remove(&group);
            self.agents_ended(group, code)?;
        }
        Ok(())
    }

    /// Agents that cannot join end the run, unless others have taken their place; about
    /// agents that die the server decides.
    fn agents_ended(&mut self, group: Group, code: u8) -> Result<(), SupervisorError> {
        let is_awaited = self.run.scenario.faults.on_agent_loss == OnAgentLoss::Wait;
        let is_refused = code == AGENT_BAD_INPUT || (code == AGENT_REFUSED && !is_awaited);
        let log = self.run.log_of(group);
        if is_refused && self.refusal.is_none() {
            self.refusal = Some(code);
            (self.say)(fs::read_to_string(&log).unwrap_or_default().trim_end());
            send(&self.server, Signal::SIGTERM);
        } else if code != 0 && !self.is_interrupted() {
            let first = group.first;
            (self.say)(&format!("agent process {first} ended with exit code {code}; its log: {}", log.display()));
            if is_awaited && code != AGENT_REFUSED {
                self.restart(group)?;
            }
        }
        Ok(())
    }

    fn restart(&mut self, group: Group) -> Result<(), SupervisorError> {
        // An agent that has left and was started again has a process of its own.
        let parts = group.without(self.agents.keys());
        let mut most = 0;
        for agent in parts.iter().flat_map(|part| part.first..=part.last) {
            let restarts = self.restarts.entry(agent).or_default();
            *restarts += 1;
            most = most.max(*restarts);
        }
        if most <= RESTARTS_MAX {
            for part in parts {
                let process = self.start_agents(part)?;
                self.agents.insert(part, process);
            }
        } else if self.refusal.is_none() {
            let first = group.first;
            (self.say)(&format!("agent process {first} is given up after {RESTARTS_MAX} restarts"));
            self.refusal = Some(exit::AGENTS_LOST);
            send(&self.server, Signal::SIGTERM);
        }
        Ok(())
    }

    /// The server has sent the agents their shutdown message, unless it has failed. The exit code
    /// of the run.
    fn end_agents(self, code: u8, events: &mut ChildEvents) -> Result<u8, SupervisorError> {
        // Agents that are driven by standard messages are sent none.
        let is_driven = |group: &Group| self.run.scenario.agents.cmd_vel.contains(&group.first);
        let unnotified = self.agents.iter().filter(|(group, _)| code != 0 || is_driven(group));
        unnotified.for_each(|(_, agent)| agent.signal(Signal::SIGTERM));
        let requested = self.requested.processes;
        requested.iter().filter(|_| code != 0).for_each(|agent| agent.signal(Signal::SIGTERM));
        let agents: Vec<AgentProcess> = self.agents.into_values().chain(requested).collect();
        processes::await_end(agents, events)?;
        Ok(self.refusal.unwrap_or(code))
    }
}
