//! How agents meet the server: the small trait that ROS 2 and the in-memory transport implement.
//!
//! Invariants: no method blocks on the server, except [`Link::receive`] for at most its time-out; what is sent may get lost, and
//! is sent again when the other side asks again.

use std::collections::BTreeMap;
use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Scenario};
use msgs::parameters::Parameter;
pub use msgs::rcl_interfaces::Level;
use msgs::visualization_msgs::Marker;

/// A message from the server.
#[derive(Debug, Clone, PartialEq)]
pub enum Inbound {
    /// What may be known of the run.
    Scenario(Scenario),
    /// The answer to a join of some process.
    JoinReply(JoinReply),
    /// A part of an observation for one of the agents of this process.
    Observation(Observation),
}

/// The side of a transport that serves the agents of one process.
pub trait ServerTransport {
    /// Asks to take part.
    fn send_join(&mut self, join: &Join);
    /// Answers an observation.
    fn send_command(&mut self, command: &Command);
    /// The agents whose maps somebody looks at, each with how many people have ever come to do so; `None` if there are none. A
    /// transport that nobody else can use has no observers.
    fn observers(&mut self) -> Option<&BTreeMap<AgentId, u64>> {
        None
    }
    /// Shows them a part of it.
    fn publish_map(&mut self, _agent: AgentId, _part: &Marker) {}
    /// Tells people something of an agent.
    fn log(&mut self, _agent: AgentId, _level: Level, _text: &str) {}
    /// Tells people what an agent is, where they can ask.
    fn declare_parameters(&mut self, _agent: AgentId, _parameters: Vec<Parameter>) {}
    /// The next message, or `None` if none came in time.
    fn receive(&mut self, timeout: Duration) -> Option<Inbound>;
}
