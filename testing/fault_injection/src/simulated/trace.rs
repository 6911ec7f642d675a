//! The trace of a simulated run: what its server and its agent processes have received and sent, in
//! that order. `tests/lockstep_model` replays it in the model of the protocol.

use std::time::Duration;

use agent_node::transport::Inbound as ToAgents;
use msgs::ids::{AgentId, Tick};
use protocol::lockstep::Transmit;
use recording::Recording;
use simulation::scenario::{OnAgentLoss, Scenario};
use transport::{Inbound as ToServer, Incoming};

use super::adversary::Adversary;
use super::cluster::Cluster;
use super::network::Network;
use super::{compare, scenarios, undisturbed};

/// What happens in a simulated run.
#[derive(Debug, Clone)]
pub enum TraceEvent {
    /// A server process announces a run.
    ServerStarted {
        /// The number of the run.
        run: u64,
        /// The first tick that the recording lacks which it resumes, if it resumes one.
        resumes_at: Option<Tick>,
    },
    /// The server has waited for a message.
    ServerReceived {
        /// Virtual time since its start.
        at: Duration,
        /// `None`: none has come.
        incoming: Option<Incoming>,
    },
    /// The server sends a message.
    ServerSent(Transmit),
    /// The run is over, or the server was killed.
    ServerEnded,
    /// An agent process starts.
    ProcessStarted {
        /// Its number, which is its instance number and distinguishes it on the network.
        process: u32,
        /// Its agents.
        agents: Vec<AgentId>,
    },
    /// An agent process handles a message.
    ProcessReceived {
        /// Its number.
        process: u32,
        /// The message.
        message: ToAgents,
    },
    /// An agent process sends a message.
    ProcessSent {
        /// Its number.
        process: u32,
        /// The message.
        message: ToServer,
    },
    /// An agent process has ended, or was killed.
    ProcessEnded {
        /// Its number.
        process: u32,
    },
}

/// A run under faults.
#[derive(Debug)]
pub struct Trace {
    /// The scenario.
    pub scenario: Scenario,
    /// The recording of the run without faults.
    pub undisturbed: Recording,
    /// What has happened.
    pub events: Vec<TraceEvent>,
}

/// The trace of a seed, whose run equals the undisturbed one; `None` if its scenario does not wait
/// for lost agents. No disk is slow or fails: then virtual time passes only while the server waits
/// for messages.
///
/// # Errors
/// If the run is not as it must be.
pub fn of_seed(seed: u64) -> Result<Option<Trace>, String> {
    let scenario = scenarios::of_seed(seed).map_err(|error| error.to_string())?;
    if scenario.faults.on_agent_loss != OnAgentLoss::Wait {
        return Ok(None);
    }
    let adversary = Adversary::of_seed(seed, scenario.faults.on_agent_loss);
    let mut network = Network::new(seed, Adversary { slow_disk: 0.0, disk_failures: 0, ..adversary }, None, false);
    network.trace = Some(Vec::new());
    let mut cluster = Cluster::over(network, &scenario, 1 + usize::from(seed.is_multiple_of(3)));
    let found = cluster.run()?;
    let events = cluster.network.borrow_mut().trace.take().unwrap_or_default();
    drop(cluster);
    let undisturbed = undisturbed(&scenario)?;
    compare(&undisturbed, found)?;
    Ok(Some(Trace { scenario, undisturbed, events }))
}

impl Network {
    /// Adds an event to the trace, if one is kept.
    pub(super) fn note(&mut self, event: impl FnOnce() -> TraceEvent) {
        if let Some(trace) = &mut self.trace {
            trace.push(event());
        }
    }

    /// Adds that the server has waited for a message.
    pub(super) fn note_received(&mut self, incoming: Option<&Incoming>) {
        let at = self.clock - self.server_began;
        self.note(|| TraceEvent::ServerReceived { at, incoming: incoming.cloned() });
    }
}
