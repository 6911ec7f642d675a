//! The log of the nodes of a process, on the topic `/rosout`: one publisher for all, because every
//! endpoint of a large team has to be discovered.

use std::time::{SystemTime, UNIX_EPOCH};

use super::{EndpointFactory, Node, Publisher, RosError};
use msgs::builtin_interfaces::Time;
use msgs::rcl_interfaces::{Level, Log};
use msgs::topics;

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
        self.0.publish(node, &Log::of_node(name, level, text, wall_time()));
    }
}

/// System time: ROS nodes stamp log messages with it even when they use simulation time.
#[expect(clippy::disallowed_methods, reason = "no result depends on the stamp of a log message")]
fn wall_time() -> Time {
    let passed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Time { sec: i32::try_from(passed.as_secs()).unwrap_or(i32::MAX), nanosec: passed.subsec_nanos() }
}
