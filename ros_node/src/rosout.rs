//! The log of a node, on the topic `/rosout`.

use std::time::{SystemTime, UNIX_EPOCH};

use super::{EndpointFactory, Node, Publisher, RosError};
use msgs::builtin_interfaces::Time;
use msgs::printable;
use msgs::rcl_interfaces::{Level, Log};
use msgs::topics;

/// The log publisher of one node.
pub struct Rosout {
    publisher: Publisher<Log>,
    name: String,
}

impl Rosout {
    /// Creates the log of the node of this name.
    ///
    /// # Errors
    /// If the middleware fails to create the publisher.
    pub fn new(endpoints: &mut EndpointFactory, node: &mut Node, name: &str) -> Result<Self, RosError> {
        Ok(Self { publisher: endpoints.publisher(node, &topics::rosout())?, name: name.to_owned() })
    }

    /// Publishes a log message.
    pub fn log(&mut self, node: &mut Node, level: Level, text: &str) {
        // Tools print it on terminals.
        let (name, msg) = (self.name.clone(), printable::text(text).into_owned());
        let log = Log { stamp: wall_time(), level: level as u8, name, msg, ..Log::default() };
        self.publisher.publish(node, &log);
    }
}

/// System time: ROS nodes stamp log messages with it even when they use simulation time.
#[expect(clippy::disallowed_methods, reason = "no result depends on the stamp of a log message")]
fn wall_time() -> Time {
    let passed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Time { sec: i32::try_from(passed.as_secs()).unwrap_or(i32::MAX), nanosec: passed.subsec_nanos() }
}
