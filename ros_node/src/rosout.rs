//! The log of the nodes of a process, on the topic `/rosout`: one publisher for all, because every
//! endpoint of a large team has to be discovered.

use super::{EndpointFactory, Node, Publisher, RosError};
use msgs::rcl_interfaces::{Level, Log};
use msgs::topics;
use system::wall_clock;

/// The log publisher of a process.
pub struct Rosout(Publisher<Log>);

impl Rosout {
    /// Creates the publisher, as one of this node.
    ///
    /// # Errors
    /// If the middleware fails to create it.
    pub fn new(endpoints: &mut EndpointFactory, node: &mut Node) -> Result<Self, RosError> {
        Ok(Self(endpoints.publisher(node, &topics::rosout())?))
    }

    /// Publishes a log message of the node of this name. `node` is the one that has the publisher.
    pub fn log(&mut self, node: &mut Node, name: &str, level: Level, text: &str) {
        self.0.publish(node, &Log::of_node(name, level, text, wall_clock::since_epoch().into()));
    }
}
