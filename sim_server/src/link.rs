//! How the server meets its agents: the small trait that ROS 2 and the in-memory transport implement.
//!
//! Invariants: no method blocks on an agent, except [`Link::receive`] for at most its time-out; what is sent may get lost, and
//! the run loop sends it again on silence; messages come out as they went in, in any order between agents.

use std::time::Duration;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Progress, Scenario};
use msgs::nav_msgs::Odometry;
pub use msgs::rcl_interfaces::Level;
use msgs::sensor_msgs::PointCloud2;

use crate::control::Request;
use simulation::lockstep::SourceId;
use simulation::scenario::Rtf;
use simulation::visualisation::{Subscribers, VisualisationMessage, VisualisationTopic};

/// A message from an agent process.
#[derive(Debug, Clone, PartialEq)]
pub enum Inbound {
    /// From the topic `join` of an agent.
    Join(Join),
    /// From the topic `command` of an agent.
    Command(Command),
    /// Bytes on one of these topics that are no such message.
    Undecodable {
        /// What is wrong with them.
        reason: String,
    },
}

/// A message and where it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct Incoming {
    /// Whose topic it came in on.
    pub topic_agent: AgentId,
    /// Which process sent it.
    pub source: SourceId,
    /// The message.
    pub message: Inbound,
}

/// The server's side of a transport.
pub trait Link {
    /// Tells all agents, present and future, what they may know of the scenario.
    fn announce(&mut self, scenario: &Scenario);
    /// Answers a join.
    fn reply_join(&mut self, reply: &JoinReply);
    /// Sends one part of an observation.
    fn send(&mut self, agent: AgentId, part: &Observation);
    /// Publishes the lock-step clock for onlookers.
    fn clock(&mut self, tick: Tick);
    /// Publishes the progress for onlookers.
    fn progress(&mut self, progress: &Progress);
    /// The next message, or `None` if none came in time.
    fn receive(&mut self, timeout: Duration) -> Option<Incoming>;
    /// Keeps what an agent that is driven by standard messages is told in this tick; it is sent with its observation.
    fn drive(&mut self, _agent: AgentId, _odometry: Odometry, _points: Option<PointCloud2>) {}
    /// What somebody listens to now, or `None` if that is nothing. A transport that nobody else can use has no onlookers.
    fn listeners(&mut self) -> Option<&Subscribers> {
        None
    }
    /// Shows something to those who listen.
    fn show(&mut self, _view: VisualisationTopic, _picture: &VisualisationMessage) {}
    /// Tells onlookers the pace, at the beginning and when somebody has set another one.
    fn pace(&mut self, _rtf: Rtf) {}
    /// Tells people something that was told on the terminal.
    fn log(&mut self, _level: Level, _text: &str) {}
    /// The next thing that somebody asks of the server, if there is one. It takes no time to find out; what comes in while
    /// messages are awaited ends the waiting. Nobody can ask anything over a transport of the agents alone.
    fn request(&mut self) -> Option<Request> {
        None
    }
    /// Whether there can be requests at all: without them, nobody could resume what is paused.
    fn takes_requests(&self) -> bool {
        false
    }
    /// The number of another run whose server has been heard while messages were awaited. A transport that nobody else can use
    /// has no other servers.
    fn other_run(&self) -> Option<u64> {
        None
    }
}
