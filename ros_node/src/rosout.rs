//! What a node says to people, on the topic `/rosout`.

use std::time::{SystemTime, UNIX_EPOCH};

use ros2_client::Node;

use super::{Outlet, RosError, Workshop};
use msgs::builtin_interfaces::Time;
use msgs::rcl_interfaces::{Level, Log};
use msgs::topics;

/// The log of one node.
pub struct Rosout {
    outlet: Outlet<Log>,
    name: String,
}

impl Rosout {
    /// The log of the node of this name.
    ///
    /// # Errors
    /// If the middleware refuses the publisher.
    pub fn new(workshop: &mut Workshop, node: &mut Node, name: &str) -> Result<Self, RosError> {
        Ok(Self { outlet: workshop.outlet(node, &topics::rosout())?, name: name.to_owned() })
    }

    /// Says something.
    pub fn say(&mut self, node: &mut Node, level: Level, text: &str) {
        let (name, msg) = (self.name.clone(), text.to_owned());
        let log = Log { stamp: wall_time(), level: level as u8, name, msg, ..Log::default() };
        self.outlet.publish(node, &log);
    }
}

/// The time of the system: nodes of ROS put it on what they say even where they go by the clock of a simulation.
#[expect(clippy::disallowed_methods, reason = "no result hangs on what people are told")]
fn wall_time() -> Time {
    let passed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Time { sec: i32::try_from(passed.as_secs()).unwrap_or(i32::MAX), nanosec: passed.subsec_nanos() }
}
