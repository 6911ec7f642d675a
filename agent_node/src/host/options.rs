//! What a process is started with, and why it ends with an error.

use std::time::Duration;

use msgs::ids::AgentId;
use protocol::limits::PROTOCOL;
use thiserror::Error;

use super::Credentials;
use crate::control_loop::AgentError;
use controllers::stopwatch::DecisionTimes;
use controllers::{ControllerError, Failure, Registry};

/// The options of a process.
#[derive(Debug, Clone)]
pub struct Options {
    /// The agents of this process.
    pub agents: Vec<AgentId>,
    /// The controllers that this process knows.
    pub registry: Registry,
    /// The controller, instead of the one of the scenario.
    pub controller: Option<String>,
    /// Settings `KEY=VALUE`, after those of the scenario, which apply to the scenario's controller
    /// only.
    pub settings: Vec<String>,
    /// A number unique to this process.
    pub instance: u64,
    /// How this process authenticates itself; `None` over a private transport.
    pub credentials: Option<Credentials>,
    /// Wall time without messages after which the server is taken to be gone.
    pub server_timeout: Duration,
    /// Longest random delay before each reply: a test of the lock-step.
    pub chaos_delay: Duration,
    /// Greatest rate of map updates while a map has subscribers, Hz of wall time.
    pub map_hz: f64,
    /// Where to log the wall time of decisions.
    pub decision_times: Option<DecisionTimes>,
}

impl Options {
    /// The controller of this process and its settings, given those that a scenario announces.
    pub(super) fn decides<'a>(&'a self, announced: &'a str, settings: &[String]) -> (&'a str, Vec<String>) {
        let name = self.controller.as_deref().unwrap_or(announced);
        let announced = if name == announced { settings } else { &[] };
        (name, [announced, &self.settings].concat())
    }

    /// Checks the controller and its settings, given those that a scenario will announce.
    ///
    /// # Errors
    /// If the name or a setting is unknown, or a value is out of range.
    pub fn check(&self, announced: &str, settings: &[String]) -> Result<(), ControllerError> {
        let (name, settings) = self.decides(announced, settings);
        self.registry.check(name, &settings)
    }
}

/// Why a host ends with an error.
#[derive(Debug, Error)]
pub enum RunError {
    /// The server refuses an agent.
    #[error("agent {agent} was refused by the server: {reason}")]
    Refused {
        /// The agent.
        agent: AgentId,
        /// The reason that the server gives.
        reason: String,
    },
    /// The server has withdrawn its acceptance, because a late observation has overtaken earlier
    /// ones: a new process can join.
    #[error("agent {agent} has lost its place in the observation log: {reason}")]
    Overtaken {
        /// The agent.
        agent: AgentId,
        /// The reason that the server gives.
        reason: String,
    },
    /// The server speaks another version of the protocol.
    #[error("the server speaks protocol {got}, this agent_node {PROTOCOL}; expected processes of one version")]
    WrongProtocol {
        /// The version of the server.
        got: u32,
    },
    /// The server is silent, or was never there, after replies without its proof.
    #[error(
        "agent {agent}: the server does not prove the join secret; it says: {reason}; expected the same \
         MAES_JOIN_SECRET or --join-secret-file on both sides"
    )]
    Unproven {
        /// The agent.
        agent: AgentId,
        /// What the reply says.
        reason: String,
    },
    /// The server is silent.
    #[error("the server of run {run:016x} has been silent for {seconds} s; it seems to be gone")]
    ServerSilent {
        /// Id of the run.
        run: u64,
        /// Duration of the silence, seconds of wall time.
        seconds: f64,
    },
    /// The server is silent, and another run has been announced.
    #[error("the server of run {run:016x} is silent and has not ended it, and run {other:016x} has been announced")]
    Superseded {
        /// Id of the joined run.
        run: u64,
        /// Id of the other run.
        other: u64,
    },
    /// The controller or a setting is unknown or illegal.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The controller of an agent has failed.
    #[error("agent {agent}: its controller has failed: {source}")]
    Failed {
        /// The agent.
        agent: AgentId,
        /// What the controller says.
        source: Failure,
    },
    /// The server violates the protocol, or the controller that is to take over cannot be built.
    #[error("agent {agent}: {source}")]
    Agent {
        /// The agent.
        agent: AgentId,
        /// Why.
        source: AgentError,
    },
}
