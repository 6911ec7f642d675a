//! A server that waits for runs that are started on its page, one after the other, and the agents
//! of each.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use simulation::scenario::Scenario;
use system::input_file::{self, TEXT_BYTES_MAX};
use system::program::StartableAgents;

use crate::SupervisorError;
use crate::binaries;
use crate::child::{Signal, exit_code};
use crate::domain::{self, DomainLock};
use crate::processes::{self, AgentProcess, ChildEvents, JoinSecret, send};
use crate::ready::ReadyPipe;
use crate::team::{Group, Team};

/// An idle server.
#[derive(Debug, Clone)]
pub struct IdleServer {
    /// The folder with `sim_server` and `agent_node`.
    pub binaries: PathBuf,
    /// Where the page is: `ADDR:PORT`.
    pub address: String,
    /// The folder of the page, if it is not beside the binaries.
    pub page: Option<PathBuf>,
    /// Further flags of `sim_server run`.
    pub server_flags: Vec<OsString>,
    /// Further environment variables of `sim_server`, for what other users must not see.
    pub server_env: Vec<(&'static str, String)>,
    /// The folder of the logs.
    pub logs: PathBuf,
}

impl IdleServer {
    /// Serves runs until the user interrupts it; the exit code of the server. `begun` is called
    /// once the server was started.
    ///
    /// # Errors
    /// If the server or an agent cannot be started.
    pub fn supervise(&self, interruptions: &dyn Fn() -> u32, begun: impl FnOnce()) -> Result<u8, SupervisorError> {
        let _lock = DomainLock::take(&domain::of_environment())?;
        fs::create_dir_all(&self.logs).map_err(SupervisorError::of(&self.logs))?;
        let mut events = ChildEvents::new()?;
        let mut ready = ReadyPipe::create(&self.logs)?;
        let secret = JoinSecret::of_environment()?;
        let mut command = processes::command(&self.binaries, "sim_server", None, &secret);
        command.args(["run", "--idle", "--view", &self.address]);
        if let Some(page) = &self.page {
            command.arg("--page").arg(page);
        }
        command.args(&self.server_flags).envs(self.server_env.iter().cloned());
        for part in binaries::program(&self.binaries, "agent_node") {
            command.arg("--check-agents").arg(part);
        }
        command.arg("--log").arg(self.logs.join("server.log")).arg("--ready").arg(ready.path());
        processes::kill_with_this_process(&mut command);
        let mut server = processes::start(command)?;
        begun();
        let mut agents = RequestedAgents::default();
        let mut forwarded = 0;
        let code = loop {
            while forwarded < interruptions() {
                forwarded += 1;
                send(&server, Signal::SIGTERM);
            }
            agents.look_after();
            if let Some(status) = server.ended().map_err(|source| SupervisorError::io("sim_server", source))? {
                break exit_code(status);
            }
            // For every run that begins the server says which scenario it is.
            while let Some(startable) = ready.next_agents().map_err(|source| SupervisorError::io("ready", source))? {
                let (binaries, logs) = (&self.binaries, &self.logs);
                match startable {
                    // It starts without a run.
                    StartableAgents::OfStart => {}
                    StartableAgents::OfScenario(file) => agents.start_run(binaries, logs, &file, &secret)?,
                    StartableAgents::Restarted(ids) => {
                        agents.start(binaries, logs, ids.into_iter().map(Group::of), &secret)?;
                    }
                }
            }
            events.wait(Some(std::os::fd::AsFd::as_fd(&ready)))?;
        };
        if code != 0 {
            agents.processes.iter().for_each(|agent| agent.signal(Signal::SIGTERM));
        }
        processes::await_end(agents.processes, &mut events)?;
        Ok(code)
    }
}

/// The agents of runs that are started on the page, one after the other.
#[derive(Default)]
pub(crate) struct RequestedAgents {
    /// The name of the latest run: its scenario file without the extension.
    run: String,
    pub(crate) processes: Vec<AgentProcess>,
}

impl RequestedAgents {
    /// Forgets processes that have ended.
    pub(crate) fn look_after(&mut self) {
        self.processes.retain_mut(|agent| matches!(agent.ended(), Ok(None)));
    }

    /// Starts the agents of a run, whose scenario the server has written to a file.
    pub(crate) fn start_run(
        &mut self,
        binaries: &Path,
        logs: &Path,
        file: &Path,
        secret: &JoinSecret,
    ) -> Result<(), SupervisorError> {
        self.run = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        // The server has read it before; if it is gone, so is the run.
        let Ok(text) = input_file::read_text(file, TEXT_BYTES_MAX) else { return Ok(()) };
        let Ok(scenario) = Scenario::parse(&file.display().to_string(), &text, &[]) else { return Ok(()) };
        self.start(binaries, logs, Team::default().groups(&scenario), secret)
    }

    /// Starts processes of the present run.
    pub(crate) fn start(
        &mut self,
        binaries: &Path,
        logs: &Path,
        groups: impl IntoIterator<Item = Group>,
        secret: &JoinSecret,
    ) -> Result<(), SupervisorError> {
        for group in groups {
            let log = logs.join(format!("{}_agent_{}.log", self.run, group.first));
            let command = processes::command(binaries, "agent_node", None, secret);
            let process = processes::start_agents(processes::with_ids(command, group), &log)?;
            self.processes.push(AgentProcess::Local(process));
        }
        Ok(())
    }
}
