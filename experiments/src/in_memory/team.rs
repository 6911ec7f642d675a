//! The agents of a run in memory, executed by the thread of the server and by helpers.
//!
//! The server's wait for a message is where agents run: those that were sent something are executed
//! until they have replied to it, side by side if there are several. So no thread is woken for a
//! single agent, and each agent goes through the steps that it goes through in a process of its
//! own.
//!
//! Invariants: an agent is executed by one thread at a time; the number of threads changes no
//! result, because the server takes replies in any order; a failure of an agent stops the run.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use agent_node::host::{AgentProcess, Options, RunError as AgentError};
use agent_node::transport::{Inbound, ServerTransport};
use msgs::ids::AgentId;
use msgs::maes_msgs::{
    Command, Join, JoinReply, Observation, Progress, Scenario, SignedCommand, SignedJoin, SignedObservation,
};
use sim_server::transport::{AgentTransport, ControlInput, Incoming, ObserverOutput};
use simulation::workers::Workers;

use super::{AgentsEnd, ServerEnd};
use crate::measure::stages::StageTimes;

/// The server's end of a link whose other ends it executes itself.
pub struct Team<'a> {
    server: ServerEnd,
    /// By group, its process; `None` once its run is over or it has failed.
    processes: Vec<Option<Process>>,
    /// The groups to execute: all at the start, later those that were sent something.
    ready: BTreeSet<usize>,
    workers: Workers,
    failure: Option<AgentError>,
    /// Set when an agent fails.
    stop: &'a AtomicBool,
}

/// The process of a group of agents.
type Process = Box<AgentProcess<PolledEnd>>;

/// The end of a group that never waits.
struct PolledEnd {
    end: AgentsEnd,
    /// Whether the last attempt to receive found nothing.
    is_drained: bool,
}

impl<'a> Team<'a> {
    /// Connects a server with processes that have these options.
    pub fn new(groups: Vec<Options>, workers: Workers, stop: &'a AtomicBool) -> Self {
        let agents: Vec<Vec<AgentId>> = groups.iter().map(|options| options.agents.clone()).collect();
        let (server, ends) = super::link(&agents);
        let process = |(options, end)| {
            let end = PolledEnd { end, is_drained: false };
            Some(Box::new(AgentProcess::new(end, options)))
        };
        let processes: Vec<_> = groups.into_iter().zip(ends).map(process).collect();
        Self { server, ready: (0..processes.len()).collect(), processes, workers, failure: None, stop }
    }

    /// All progress messages that the server has published, and the stages that agents have named.
    ///
    /// # Errors
    /// Why an agent has failed.
    pub fn into_course(self) -> Result<(Vec<Progress>, StageTimes), AgentError> {
        self.failure.map_or_else(|| Ok(self.server.into_course()), Err)
    }

    /// Executes the groups that are ready until each waits for a message.
    fn execute(&mut self) {
        let mut executed = Vec::with_capacity(self.ready.len());
        let mut present = Vec::with_capacity(self.ready.len());
        for group in std::mem::take(&mut self.ready) {
            if let Some(process) = self.processes[group].take() {
                executed.push(group);
                present.push(process);
            }
        }
        for (group, outcome) in executed.into_iter().zip(self.workers.map(present, until_idle)) {
            match outcome {
                Ok(process) => self.processes[group] = process,
                Err(error) => {
                    self.stop.store(true, Ordering::Relaxed);
                    self.failure.get_or_insert(error);
                }
            }
        }
    }
}

/// Executes a process until it waits for a message; `None` if its run is over.
fn until_idle(mut process: Process) -> Result<Option<Process>, AgentError> {
    loop {
        if process.step()?.is_break() {
            return Ok(None);
        }
        if process.transport().is_none_or(|end| end.is_drained) {
            return Ok(Some(process));
        }
    }
}

impl AgentTransport for Team<'_> {
    fn announce(&mut self, scenario: &Scenario) {
        self.server.announce(scenario);
        self.ready.extend(0..self.processes.len());
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.server.reply_join(reply);
        self.ready.extend(0..self.processes.len());
    }

    fn send(&mut self, agent: AgentId, part: &Observation) {
        self.server.send(agent, part);
        self.ready.extend(self.server.groups_of(agent));
    }

    fn send_signed(&mut self, agent: AgentId, signed: SignedObservation) {
        self.server.send_signed(agent, signed);
        self.ready.extend(self.server.groups_of(agent));
    }

    fn is_gone(&self, agent: AgentId) -> bool {
        self.server.groups_of(agent).all(|group| self.processes[group].is_none())
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        if let Some(incoming) = self.server.receive_now() {
            return Some(incoming);
        }
        if self.ready.is_empty() {
            // Nothing arrives before an agent is executed, which may have a join to repeat then.
            std::thread::park_timeout(timeout);
            self.ready.extend(0..self.processes.len());
        }
        self.execute();
        self.server.receive_now()
    }
}

impl ObserverOutput for Team<'_> {
    fn progress(&mut self, progress: &Progress) {
        self.server.progress(progress);
    }
}

impl ControlInput for Team<'_> {}

impl ServerTransport for PolledEnd {
    fn send_join(&mut self, join: &Join) {
        self.end.send_join(join);
    }

    fn send_command(&mut self, command: &Command) {
        self.end.send_command(command);
    }

    fn send_signed_join(&mut self, signed: &SignedJoin) {
        self.end.send_signed_join(signed);
    }

    fn send_signed_command(&mut self, signed: &SignedCommand) {
        self.end.send_signed_command(signed);
    }

    fn source(&self) -> [u8; 16] {
        self.end.source()
    }

    fn receive(&mut self, _timeout: Duration) -> Option<Inbound> {
        let received = self.end.receive_now();
        self.is_drained = received.is_none();
        received
    }
}
