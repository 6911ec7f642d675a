//! The transport of a run: the agents' protocol, the output to observers, and the input of
//! [`control`] requests.
//!
//! [`AgentTransport`] is all that the lock-step needs; [`ObserverOutput`] and [`ControlInput`]
//! serve people and tools. One object implements the three ([`Transport`]), because a ROS 2 node
//! receives commands and service requests in one inbox. Implementations: ROS 2 (in `sim_server`),
//! Foxglove around another one (`foxglove_server`), and channels within a process (`in_memory`).
//!
//! Invariants: no method blocks on an agent, except [`AgentTransport::receive`] up to its timeout;
//! a message may get lost, be repeated or overtake another one, and the session resends what stays
//! unanswered; messages arrive unchanged.

pub mod control;

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{JoinReply, Observation, Progress, Scenario};
use msgs::nav_msgs::Odometry;
pub use msgs::rcl_interfaces::Level;
use msgs::sensor_msgs::PointCloud2;
use msgs::service::ANSWER_BYTES_MAX;
use msgs::visualization_msgs::Marker;
pub use protocol::lockstep::{Inbound, Incoming};
pub use protocol::signed::Signed;
use simulation::scenario::Rtf;
use simulation::visualisation::{SensorId, Subscribers, VisualisationMessage, VisualisationTopic};

use system::wall_clock;

use control::Request;

/// The server's side of the protocol with the agents.
pub trait AgentTransport {
    /// Publishes what agents may know of the scenario, to present and later subscribers.
    fn announce(&mut self, scenario: &Scenario);
    /// Publishes the reply to a join.
    fn reply_join(&mut self, reply: &JoinReply);
    /// Sends one fragment of an observation.
    fn send(&mut self, agent: AgentId, fragment: Signed<Observation>);
    /// Whether others than the agents can send on this transport, so that joins and commands must
    /// be authenticated.
    fn is_open(&self) -> bool {
        false
    }
    /// Whether the process of an agent has ended, so that nothing more of it can come. A network
    /// does not know that.
    fn is_gone(&self, _agent: AgentId) -> bool {
        false
    }
    /// The next message, or `None` after `timeout` without one.
    fn receive(&mut self, timeout: Duration) -> Option<Incoming>;
    /// Holds the standard sensor messages of an externally controlled agent for this tick, until
    /// its observation is sent.
    fn set_sensors(&mut self, _agent: AgentId, _odometry: Odometry, _points: Vec<(SensorId, PointCloud2)>) {}
    /// The time by which the session resends, times out and paces; a simulated network has its own.
    fn now(&self) -> Instant {
        wall_clock::now()
    }
    /// The run number of another server in the same network, if one was heard. A private transport
    /// has none.
    fn other_run(&self) -> Option<u64> {
        None
    }
}

/// Output to observers: visualisation tools and people. Nothing here waits or changes the run; a
/// transport without observers leaves the defaults, which discard.
pub trait ObserverOutput {
    /// Publishes the lock-step clock.
    fn clock(&mut self, _tick: Tick) {}
    /// Publishes the progress.
    fn progress(&mut self, _progress: &Progress) {}
    /// The visualisation topics that have subscribers, or `None` if none has.
    fn subscribers(&mut self) -> Option<&Subscribers> {
        None
    }
    /// Publishes a message of a visualisation topic.
    fn publish(&mut self, _view: VisualisationTopic, _picture: &VisualisationMessage) {}
    /// Publishes the limit of the real-time factor, at the start and after each change.
    fn real_time_factor(&mut self, _rtf: Rtf) {}
    /// Publishes a line of the log.
    fn log(&mut self, _level: Level, _text: &str) {}
    /// Whether the belief maps that agents publish can be relayed.
    fn relays_beliefs(&self) -> bool {
        false
    }
    /// Relays the belief maps of these agents from now on, and of no others.
    fn relay_beliefs(&mut self, _agents: &BTreeSet<AgentId>) {}
    /// The next relayed message of an agent.
    fn relayed_belief(&mut self) -> Option<(AgentId, Marker)> {
        None
    }
}

/// Input of control requests; a transport without them leaves the defaults.
pub trait ControlInput {
    /// The next request, if one has arrived. Never waits; a request that arrives while the session
    /// waits for messages ends that wait.
    fn request(&mut self) -> Option<Request> {
        None
    }
    /// Whether requests can arrive at all: without them, a paused run would stay paused.
    fn accepts_requests(&self) -> bool {
        false
    }
    /// The longest answer to a request that can be sent, bytes.
    fn answer_bytes_max(&self) -> usize {
        ANSWER_BYTES_MAX
    }
}

/// All ends of a transport.
pub trait Transport: AgentTransport + ObserverOutput + ControlInput {}

impl<T: AgentTransport + ObserverOutput + ControlInput + ?Sized> Transport for T {}
