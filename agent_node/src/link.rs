//! How agents meet the server: the small trait that ROS 2 and the in-memory transport implement.
//!
//! Invariants: no method blocks on the server, except [`Link::receive`] for at most its time-out; what is sent may get lost, and
//! is sent again when the other side asks again.

use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Scenario};
use msgs::parameters::Parameter;

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
pub trait Link {
    /// Asks to take part.
    fn join(&mut self, join: &Join);
    /// Answers an observation.
    fn answer(&mut self, command: &Command);
    /// Tells people what an agent is, where they can ask.
    fn describe(&mut self, _agent: AgentId, _parameters: Vec<Parameter>) {}
    /// The next message, or `None` if none came in time.
    fn receive(&mut self, timeout: Duration) -> Option<Inbound>;
}
