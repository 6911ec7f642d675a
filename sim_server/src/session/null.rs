//! Null objects: a transport without agents for a run that is verified, and an observer of a run
//! that reports nothing.

use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::{JoinReply, Observation, Scenario};
use protocol::signed::Signed;
use world::World;

use super::RunObserver;
use transport::{AgentTransport, ControlInput, Incoming, Level, ObserverOutput};

/// Discards what is sent, and receives nothing.
#[derive(Debug, Clone, Copy)]
pub struct NullTransport;

impl AgentTransport for NullTransport {
    fn announce(&mut self, _scenario: &Scenario) {}
    fn reply_join(&mut self, _reply: &JoinReply) {}
    fn send(&mut self, _agent: AgentId, _fragment: Signed<Observation>) {}
    fn receive(&mut self, _timeout: Duration) -> Option<Incoming> {
        None
    }
}

impl ObserverOutput for NullTransport {}

impl ControlInput for NullTransport {}

/// Discards all reports.
#[derive(Debug, Clone, Copy)]
pub struct NullObserver;

impl RunObserver for NullObserver {
    fn waiting(&mut self, _missing: &[AgentId]) {}
    fn started(&mut self) {}
    fn progress(&mut self, _world: &World) {}
    fn note(&mut self, _level: Level, _text: &str) {}
}
