//! The agents of a run in memory, executed by the thread of the server and by helpers.
//!
//! An agent that is sent something is executed until it has replied to it: by a helper while the
//! server prepares what the next agent gets, or by the server's thread while it waits for a
//! message. So no thread is woken for a single agent, and each agent goes through the steps that it
//! goes through in a process of its own.
//!
//! Invariants: an agent is executed by one thread at a time; the number of threads changes no
//! result, because the server takes replies in any order; a failure of an agent stops the run.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use agent::exploration_map::ExplorationMap;
use agent_node::host::{AgentProcess, Options, RunError as AgentError};
use agent_node::transport::{Inbound, ServerTransport};
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, JoinReply, Observation, Progress, Scenario};
use protocol::signed::{JoinRequest, Signed};
use transport::{AgentTransport, ControlInput, Incoming, ObserverOutput};
use world::workers::{TaskQueue, Workers};

use super::{AgentsEnd, ServerEnd};
use crate::Course;

/// The server's end of a link whose other ends it executes itself.
pub struct Team<'a> {
    server: ServerEnd,
    /// By group.
    processes: Vec<State>,
    executions: TaskQueue<(usize, Process), (usize, Executed)>,
    failure: Option<AgentError>,
    /// Set when an agent fails.
    stop: &'a AtomicBool,
}

/// The process of a group of agents.
type Process = Box<AgentProcess<PolledEnd>>;

/// What has become of a process: `None` once its run is over.
type Executed = Result<Option<Process>, AgentError>;

enum State {
    Idle(Process),
    /// In the queue of executions.
    Executing {
        /// Whether it was sent something since, and may not have looked for it any more.
        is_outdated: bool,
    },
    /// Its run is over, or it has failed.
    Gone,
}

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
            State::Idle(Box::new(AgentProcess::new(end, options)))
        };
        let processes: Vec<_> = groups.into_iter().zip(ends).map(process).collect();
        let executions = TaskQueue::new(workers, |(group, process)| (group, until_idle(process)));
        Self { server, processes, executions, failure: None, stop }
    }

    /// The course of the run.
    ///
    /// # Errors
    /// Why an agent has failed.
    pub fn into_course(mut self) -> Result<Course, AgentError> {
        while self.finish_execution() {}
        self.failure.map_or_else(|| Ok(self.server.into_course()), Err)
    }

    /// Has the process of a group executed, because it was sent something.
    fn execute(&mut self, group: usize) {
        let state = &mut self.processes[group];
        *state = match std::mem::replace(state, State::Gone) {
            State::Idle(process) => {
                self.executions.push((group, process));
                State::Executing { is_outdated: false }
            }
            State::Executing { .. } => State::Executing { is_outdated: true },
            State::Gone => State::Gone,
        };
    }

    fn execute_groups_of(&mut self, agent: AgentId) {
        let groups: Vec<usize> = self.server.groups_of(agent).collect();
        groups.into_iter().for_each(|group| self.execute(group));
    }

    fn execute_all(&mut self) {
        (0..self.processes.len()).for_each(|group| self.execute(group));
    }

    /// Waits for the end of an execution; returns false if none is under way.
    fn finish_execution(&mut self) -> bool {
        let Some((group, executed)) = self.executions.finish_one() else { return false };
        let state = match executed {
            Ok(process) => process.map_or(State::Gone, State::Idle),
            Err(error) => {
                self.stop.store(true, Ordering::Relaxed);
                self.failure.get_or_insert(error);
                State::Gone
            }
        };
        let before = std::mem::replace(&mut self.processes[group], state);
        if matches!(before, State::Executing { is_outdated: true }) {
            self.execute(group);
        }
        true
    }
}

/// Executes a process until it waits for a message; `None` if its run is over.
fn until_idle(mut process: Process) -> Executed {
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
        self.execute_all();
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.server.reply_join(reply);
        self.execute_all();
    }

    fn send(&mut self, agent: AgentId, part: Signed<Observation>) {
        let is_complete = part.claimed().is_last();
        self.server.send(agent, part);
        if is_complete {
            self.execute_groups_of(agent);
        }
    }

    fn is_gone(&self, agent: AgentId) -> bool {
        self.server.groups_of(agent).all(|group| matches!(self.processes[group], State::Gone))
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        if let Some(incoming) = self.server.receive_now() {
            return Some(incoming);
        }
        if self.executions.is_empty() {
            // Nothing arrives before an agent is executed, which may have a join to repeat then.
            std::thread::park_timeout(timeout);
            self.execute_all();
        }
        // All of them: the caller counts the time between two messages towards its timeouts, but
        // not that of a long call.
        while self.finish_execution() {}
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
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        self.end.send_join(join);
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        self.end.send_command(command);
    }

    fn source(&self) -> [u8; 16] {
        self.end.source()
    }

    fn ended(&mut self, agent: AgentId, map: &ExplorationMap) {
        self.end.ended(agent, map);
    }

    fn receive(&mut self, _timeout: Duration) -> Option<Inbound> {
        let received = self.end.receive_now();
        self.is_drained = received.is_none();
        received
    }
}
