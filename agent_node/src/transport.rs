//! The transport between agents and the server: a trait that ROS 2 and the in-memory transport
//! implement.
//!
//! Invariants: no method blocks on the server, except [`ServerTransport::receive`] for at most its
//! timeout; messages may get lost, and are resent when the other side repeats its own.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use agent::exploration_map::ExplorationMap;
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, JoinReply, Observation, Scenario};
use msgs::nav_msgs::OccupancyGrid;
use msgs::octomap_msgs::Octomap;
use msgs::parameters::DeclaredParameter;
pub use msgs::rcl_interfaces::Level;
use msgs::sensor_msgs::PointCloud2;
use msgs::visualization_msgs::Marker;
use protocol::signed::{JoinRequest, Signed};

/// A message from the server.
#[derive(Debug, Clone, PartialEq)]
pub enum Inbound {
    /// The scenario of a run, as far as agents may know it.
    Scenario(Scenario),
    /// The reply to a join of any process.
    JoinReply(JoinReply),
    /// A fragment of an observation for one of the agents of this process; unsigned over a private
    /// transport.
    Observation(Signed<Observation>),
}

/// A standard message that shows an agent's map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MapView {
    /// The map projected to the plane.
    Occupancy,
    /// A tree of OctoMap.
    Octomap,
    /// The centres of walls.
    Points,
}

/// The message of a [`MapView`].
#[derive(Debug, Clone, PartialEq)]
pub enum MapViewMessage {
    /// See [`MapView::Occupancy`].
    Occupancy(OccupancyGrid),
    /// See [`MapView::Octomap`].
    Octomap(Octomap),
    /// See [`MapView::Points`].
    Points(PointCloud2),
}

/// The transport of the agents of one process to their server.
pub trait ServerTransport {
    /// Sends a join; a private transport may leave out what authenticates it.
    fn send_join(&mut self, join: &Signed<JoinRequest>);
    /// Sends a command, the reply to an observation; a private transport may leave out the
    /// signature.
    fn send_command(&mut self, command: &Signed<Command>);
    /// This process, as the server knows it from the transport.
    fn source(&self) -> [u8; 16] {
        [0; 16]
    }
    /// The agents whose maps are observed, each with the number of subscriptions so far; `None` if
    /// there are none, as on transports without observers.
    fn observers(&mut self) -> Option<&BTreeMap<AgentId, u64>> {
        None
    }
    /// Publishes a marker of an agent's map to its observers.
    fn publish_map(&mut self, _agent: AgentId, _part: &Marker) {}
    /// The standard messages of agents' maps that are observed, each with the number of
    /// subscriptions so far; `None` if there are none.
    fn observed_views(&mut self) -> Option<&BTreeMap<(AgentId, MapView), u64>> {
        None
    }
    /// Publishes a standard message of an agent's map to its observers.
    fn publish_view(&mut self, _agent: AgentId, _message: &MapViewMessage) {}
    /// Logs a text for an agent.
    fn log(&mut self, _agent: AgentId, _level: Level, _text: &str) {}
    /// Called with the map of an agent whose run is over, for those that evaluate it.
    fn ended(&mut self, _agent: AgentId, _map: &ExplorationMap) {}
    /// Declares parameters of an agent's node.
    fn declare_parameters(&mut self, _agent: AgentId, _parameters: Vec<DeclaredParameter>) {}
    /// The time by which joins are repeated and a silent server is given up; a simulated network
    /// has its own.
    fn now(&self) -> Instant {
        system::wall_clock::now()
    }
    /// The next message, or `None` after the timeout.
    fn receive(&mut self, timeout: Duration) -> Option<Inbound>;
}

/// A borrowed transport is a transport.
impl<T: ServerTransport + ?Sized> ServerTransport for &mut T {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        (**self).send_join(join);
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        (**self).send_command(command);
    }

    fn source(&self) -> [u8; 16] {
        (**self).source()
    }

    fn observers(&mut self) -> Option<&BTreeMap<AgentId, u64>> {
        (**self).observers()
    }

    fn publish_map(&mut self, agent: AgentId, part: &Marker) {
        (**self).publish_map(agent, part);
    }

    fn observed_views(&mut self) -> Option<&BTreeMap<(AgentId, MapView), u64>> {
        (**self).observed_views()
    }

    fn publish_view(&mut self, agent: AgentId, message: &MapViewMessage) {
        (**self).publish_view(agent, message);
    }

    fn log(&mut self, agent: AgentId, level: Level, text: &str) {
        (**self).log(agent, level, text);
    }

    fn ended(&mut self, agent: AgentId, map: &ExplorationMap) {
        (**self).ended(agent, map);
    }

    fn declare_parameters(&mut self, agent: AgentId, parameters: Vec<DeclaredParameter>) {
        (**self).declare_parameters(agent, parameters);
    }

    fn now(&self) -> Instant {
        (**self).now()
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        (**self).receive(timeout)
    }
}
