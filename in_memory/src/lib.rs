//! A run in one process: channels between a server and its agents, and a run over them.
//!
//! [`link`] makes the channels, [`in_process`] runs a scenario over them, [`stages`] counts what
//! the agents are busy with.
//!
//! The session loops of server and agents run over it unchanged: on a thread for the server and one
//! for each group of agents, so that messages of different agents arrive in any order here as well,
//! or as a [`Team`], which needs no thread but that of the server. No message is lost. It is
//! private to the process, so that nothing needs to be signed; but it carries signatures.

pub mod in_process;
#[cfg(unix)]
pub mod own_program;
pub mod stages;
mod team;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use agent::exploration_map::ExplorationMap;
use agent_node::transport::Inbound as ToAgents;
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, JoinReply, Observation, Progress, Scenario};
use protocol::lockstep::SourceId;
use protocol::signed::{JoinRequest, Signed};
use transport::{AgentTransport, ControlInput, Inbound as ToServer, Incoming, ObserverOutput};

use crate::stages::StageTimes;
pub use team::Team;

/// The server's end of the transport.
pub struct ServerEnd {
    inbox: Receiver<Incoming>,
    groups: Vec<Sender<ToAgents>>,
    /// The groups that subscribe to the topics of an agent, by index.
    groups_of: BTreeMap<AgentId, Vec<usize>>,
    course: Course,
    ended: Arc<Ended>,
}

/// The course of a run: what its evaluation needs beside the result.
#[derive(Debug, Clone, Default)]
pub struct Course {
    /// Progress from the start on, every ten seconds of sim time, and at the end.
    pub progress: Vec<Progress>,
    /// The stages that its agents have named.
    pub stages: StageTimes,
    /// Cells that agents found free with their own sensors and had on their maps before, summed
    /// over the agents; `None` if some of them are in other processes, where their maps are not
    /// read.
    pub seen_again: Option<u64>,
}

/// What the agents of this process have found at their end.
#[derive(Debug, Default)]
struct Ended {
    agents: AtomicU64,
    seen_again: AtomicU64,
}

/// The end of one group of agents, which corresponds to one agent process.
pub struct AgentsEnd {
    inbox: Receiver<ToAgents>,
    server: Sender<Incoming>,
    source: SourceId,
    ended: Arc<Ended>,
}

/// Connects a server with groups of agents. An agent may be in several groups, as it may run in
/// several processes.
#[must_use]
pub fn link(groups: &[Vec<AgentId>]) -> (ServerEnd, Vec<AgentsEnd>) {
    let (to_server, server_inbox) = channel();
    let mut senders = Vec::new();
    let mut ends = Vec::new();
    let ended = Arc::new(Ended::default());
    let mut groups_of: BTreeMap<AgentId, Vec<usize>> = BTreeMap::new();
    for (number, agents) in groups.iter().enumerate() {
        let (to_agents, inbox) = channel();
        senders.push(to_agents);
        agents.iter().for_each(|&agent| groups_of.entry(agent).or_default().push(number));
        let source = SourceId((number as u128).to_le_bytes());
        ends.push(AgentsEnd { inbox, server: to_server.clone(), source, ended: Arc::clone(&ended) });
    }
    (ServerEnd { inbox: server_inbox, groups: senders, groups_of, course: Course::default(), ended }, ends)
}

impl ServerEnd {
    /// The course of the run, complete once all agents have ended.
    #[must_use]
    pub fn into_course(self) -> Course {
        let has_all = self.ended.agents.load(Ordering::Relaxed) == self.groups_of.len() as u64;
        let seen_again = has_all.then(|| self.ended.seen_again.load(Ordering::Relaxed));
        Course { seen_again, ..self.course }
    }

    fn send_to_all(&self, message: &ToAgents) {
        for group in &self.groups {
            // A send fails only if the group has ended.
            let _ = group.send(message.clone());
        }
    }

    /// Sends to all groups of an agent, of which there is mostly one: so mostly nothing is cloned.
    fn send_to_groups_of(&self, agent: AgentId, message: ToAgents) {
        let mut groups = self.groups_of(agent);
        let Some(first) = groups.next() else { return };
        for group in groups {
            let _ = self.groups[group].send(message.clone());
        }
        let _ = self.groups[first].send(message);
    }

    fn groups_of(&self, agent: AgentId) -> impl Iterator<Item = usize> {
        self.groups_of.get(&agent).into_iter().flatten().copied()
    }

    /// The next message, if one has arrived.
    fn receive_now(&mut self) -> Option<Incoming> {
        self.inbox.try_recv().ok().inspect(|incoming| note(&mut self.course.stages, incoming))
    }
}

/// Takes the stage of a message, if it is a command.
fn note(stages: &mut StageTimes, incoming: &Incoming) {
    if let ToServer::Command(command) = &incoming.message {
        stages.note(command.claimed());
    }
}

impl AgentTransport for ServerEnd {
    fn announce(&mut self, scenario: &Scenario) {
        self.send_to_all(&ToAgents::Scenario(scenario.clone()));
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.send_to_all(&ToAgents::JoinReply(reply.clone()));
    }

    fn send(&mut self, agent: AgentId, part: Signed<Observation>) {
        self.send_to_groups_of(agent, ToAgents::Observation(part));
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        self.inbox.recv_timeout(timeout).ok().inspect(|incoming| note(&mut self.course.stages, incoming))
    }
}

impl ObserverOutput for ServerEnd {
    fn progress(&mut self, progress: &Progress) {
        self.course.progress.push(progress.clone());
    }
}

impl ControlInput for ServerEnd {}

impl AgentsEnd {
    /// The next message, if one has arrived.
    fn receive_now(&self) -> Option<ToAgents> {
        self.inbox.try_recv().ok()
    }

    fn send(&self, agent: u32, message: ToServer) {
        send(&self.server, self.source, agent, message);
    }
}

/// Sends a message of an agent to the server.
fn send(server: &Sender<Incoming>, source: SourceId, agent: u32, message: ToServer) {
    // A send fails only if the server has ended.
    let _ = server.send(Incoming { topic_agent: AgentId(agent), source, message });
}

impl agent_node::transport::ServerTransport for AgentsEnd {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        self.send(join.claimed().join.agent, ToServer::Join(join.clone()));
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        self.send(command.claimed().agent, ToServer::Command(command.clone()));
    }

    fn source(&self) -> [u8; 16] {
        self.source.0
    }

    fn ended(&mut self, _agent: AgentId, map: &ExplorationMap) {
        self.ended.seen_again.fetch_add(map.seen_again(), Ordering::Relaxed);
        self.ended.agents.fetch_add(1, Ordering::Relaxed);
    }

    fn receive(&mut self, timeout: Duration) -> Option<ToAgents> {
        self.inbox.recv_timeout(timeout).ok()
    }
}
