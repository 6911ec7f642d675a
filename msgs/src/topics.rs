//! The topics: what each is called, what type it carries and with which quality of service.
//!
//! Invariant: this is the only list; who publishes, subscribes or records a topic asks here. Plain
//! data: this module does not know the ROS client, and neither who publishes nor how often.
//!
//! Reliable topics may still lose samples to a reader that falls behind by more than the depth; in
//! the protocol an answer is missing then, and what was not answered is sent again.

mod qos;

use std::fmt;

use crate::diagnostic_msgs::DiagnosticArray;
use crate::geometry_msgs::TwistStamped;
use crate::ids::AgentId;
use crate::maes_msgs::{
    Command, Digest, Intervention, Join, JoinReply, MapChange, Observation, Progress, Result, Scenario, SignedCommand,
    SignedJoin, SignedObservation,
};
use crate::message::{Message, MessageType};
use crate::nav_msgs::{OccupancyGrid, Odometry, Path};
use crate::octomap_msgs::Octomap;
use crate::rcl_interfaces::{Log, ParameterEvent};
use crate::rosgraph_msgs::Clock;
use crate::sensor_msgs::{BatteryState, CameraInfo, Image, LaserScan, PointCloud2};
use crate::sensor_name::SensorName;
use crate::std_msgs;
use crate::tf2_msgs::TFMessage;
use crate::visualization_msgs::Marker;
pub use qos::{Durability, Qos, Reliability};

/// Samples kept on the topics of the protocol. One is in flight at a time; a large observation has
/// more parts, and a join is repeated until it is answered.
const PROTOCOL_DEPTH: u32 = 16;

/// Samples kept of the clock, as the clocks of other simulators do.
const CLOCK_DEPTH: u32 = 10;

/// Samples kept of the transforms, the value that tf2 uses.
const TF_DEPTH: u32 = 100;

/// Replies kept for agents that find the topic late. One for each agent of all but the largest
/// teams; whose reply is not among them joins again and gets another one.
const JOIN_REPLY_DEPTH: u32 = 256;

/// Samples kept of what is only looked at.
const VIEW_DEPTH: u32 = 10;

/// Samples kept of scans and images: the "sensor data" of ROS.
const SENSOR_DEPTH: u32 = 5;

/// Samples kept of the transforms that do not change: one holds those of [`TRANSFORMS_MAX`] frames,
/// and each of at most 1000 agents has up to three.
const TF_STATIC_DEPTH: u32 = 8;

/// Most transforms in one message, so that it fits into a sample.
pub const TRANSFORMS_MAX: usize = 400;

/// Samples kept of what comes in pieces.
const PIECES_DEPTH: u32 = 256;

/// Samples kept of what nodes say to people, as rcl does.
const LOG_DEPTH: u32 = 1000;

/// A topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, absolute.
    pub name: String,
    /// The type of its messages.
    pub message: MessageType,
    /// Its quality of service: what a publisher offers, and what a subscription requests unless it
    /// is [`unacknowledged`](Self::unacknowledged).
    pub qos: Qos,
}

impl Topic {
    /// The topic for a subscription that acknowledges nothing. For the observations and commands of
    /// the lock-step: the command acknowledges the observation, and what was lost is sent again
    /// until it is answered, so the acknowledgements of the middleware only cost time.
    #[must_use]
    pub fn unacknowledged(self) -> Self {
        Topic { qos: Qos { reliability: Reliability::BestEffort, ..self.qos }, ..self }
    }

    fn new<M: Message>(name: impl Into<String>, qos: Qos) -> Self {
        Topic { name: name.into(), message: M::TYPE, qos }
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} [{}]", self.name, self.message)
    }
}

/// The lock-step clock, every fixed update.
pub fn clock() -> Topic {
    Topic::new::<Clock>("/clock", Qos::reliable(CLOCK_DEPTH))
}

/// What agents may know of the run; also for those that start later.
pub fn scenario() -> Topic {
    Topic::new::<Scenario>("/sim/scenario", Qos::latched(1))
}

/// The answers to joins, for all agents.
pub fn join_reply() -> Topic {
    Topic::new::<JoinReply>("/sim/join_reply", Qos::latched(JOIN_REPLY_DEPTH))
}

/// The request of an agent to join, as it is recorded; sent as [`signed_join`].
pub fn join(agent: AgentId) -> Topic {
    Topic::new::<Join>(format!("/agent_{agent}/join"), Qos::reliable(PROTOCOL_DEPTH))
}

/// What an agent learns, as it is recorded; sent as [`signed_observation`].
pub fn observation(agent: AgentId) -> Topic {
    Topic::new::<Observation>(format!("/agent_{agent}/observation"), Qos::reliable(PROTOCOL_DEPTH))
}

/// What an agent answers, as it is recorded; sent as [`signed_command`].
pub fn command(agent: AgentId) -> Topic {
    Topic::new::<Command>(format!("/agent_{agent}/command"), Qos::reliable(PROTOCOL_DEPTH))
}

/// The topic of [`join`] between processes.
pub fn signed_join(agent: AgentId) -> Topic {
    Topic { message: SignedJoin::TYPE, ..join(agent) }
}

/// The topic of [`observation`] between processes.
pub fn signed_observation(agent: AgentId) -> Topic {
    Topic { message: SignedObservation::TYPE, ..observation(agent) }
}

/// The topic of [`command`] between processes.
pub fn signed_command(agent: AgentId) -> Topic {
    Topic { message: SignedCommand::TYPE, ..command(agent) }
}

/// The velocity that an agent without a controller is to hold, in each tick: from a node that
/// speaks standard messages only.
pub fn cmd_vel(agent: AgentId) -> Topic {
    Topic::new::<TwistStamped>(format!("/agent_{agent}/cmd_vel"), Qos::reliable(PROTOCOL_DEPTH))
}

/// The poses of the agents, as transforms from `map` to `agent_<id>/base_link`.
pub fn tf() -> Topic {
    Topic::new::<TFMessage>("/tf", Qos::reliable(TF_DEPTH))
}

/// The transforms that do not change: where the LiDAR of each agent is on its body, its optical
/// frame if it is a camera, and the frame that its odometry starts from.
pub fn tf_static() -> Topic {
    Topic::new::<TFMessage>("/tf_static", Qos::latched(TF_STATIC_DEPTH))
}

/// Where an agent is and how it moves: the truth.
pub fn odometry(agent: AgentId) -> Topic {
    Topic::new::<Odometry>(format!("/agent_{agent}/odom"), Qos::reliable(VIEW_DEPTH))
}

/// Where the rays of the last scan of an agent's LiDAR, or of that with a name, met walls.
pub fn points(agent: AgentId, sensor: Option<SensorName>) -> Topic {
    Topic::new::<PointCloud2>(of_sensor(agent, sensor, "points"), Qos::sensor_data(SENSOR_DEPTH))
}

/// The distances that the line of a spinning LiDAR closest to its plane measures.
pub fn scan(agent: AgentId, sensor: Option<SensorName>) -> Topic {
    Topic::new::<LaserScan>(of_sensor(agent, sensor, "scan"), Qos::sensor_data(SENSOR_DEPTH))
}

/// The depths that the pixels of a depth camera measure.
pub fn depth_image(agent: AgentId, sensor: Option<SensorName>) -> Topic {
    Topic::new::<Image>(of_sensor(agent, sensor, "depth/image"), Qos::sensor_data(SENSOR_DEPTH))
}

/// How the pixels of [`depth_image`] are projected; one for each image, with its stamp.
pub fn camera_info(agent: AgentId, sensor: Option<SensorName>) -> Topic {
    Topic::new::<CameraInfo>(of_sensor(agent, sensor, "depth/camera_info"), Qos::sensor_data(SENSOR_DEPTH))
}

/// The name of a topic of a sensor. The only LiDAR of a body has no name.
fn of_sensor(agent: AgentId, sensor: Option<SensorName>, last: &str) -> String {
    match sensor {
        Some(name) => format!("/agent_{agent}/{name}/{last}"),
        None => format!("/agent_{agent}/{last}"),
    }
}

/// The charge of a body's battery.
pub fn battery(agent: AgentId) -> Topic {
    Topic::new::<BatteryState>(format!("/agent_{agent}/battery_state"), Qos::reliable(VIEW_DEPTH))
}

/// Where an agent's body is going.
pub fn path(agent: AgentId) -> Topic {
    Topic::new::<Path>(format!("/agent_{agent}/path"), Qos::latched(1))
}

/// What an agent believes of the map, in pieces.
pub fn belief(agent: AgentId) -> Topic {
    Topic::new::<Marker>(format!("/agent_{agent}/map"), Qos::latched(PIECES_DEPTH))
}

/// What an agent believes of the map, projected to the plane.
pub fn belief_occupancy(agent: AgentId) -> Topic {
    Topic::new::<OccupancyGrid>(format!("/agent_{agent}/occupancy"), Qos::latched(1))
}

/// What an agent believes of the map, as a tree of OctoMap.
pub fn belief_octomap(agent: AgentId) -> Topic {
    Topic::new::<Octomap>(format!("/agent_{agent}/octomap"), Qos::latched(1))
}

/// The centres of the walls that an agent believes in.
pub fn belief_points(agent: AgentId) -> Topic {
    Topic::new::<PointCloud2>(format!("/agent_{agent}/map_points"), Qos::latched(1))
}

/// The walls, in pieces.
pub fn map() -> Topic {
    Topic::new::<Marker>("/sim/map", Qos::latched(PIECES_DEPTH))
}

/// The free cells that no agent has seen, in pieces.
pub fn unexplored() -> Topic {
    Topic::new::<Marker>("/sim/unexplored", Qos::latched(PIECES_DEPTH))
}

/// Lines between agents in contact.
pub fn contacts() -> Topic {
    Topic::new::<Marker>("/sim/contacts", Qos::latched(1))
}

/// How the run and each agent are doing, in words.
pub fn info() -> Topic {
    Topic::new::<DiagnosticArray>("/sim/info", Qos::reliable(VIEW_DEPTH))
}

/// The same as [`info`], where tools for diagnostics look for it.
pub fn diagnostics() -> Topic {
    Topic::new::<DiagnosticArray>("/diagnostics", Qos::reliable(VIEW_DEPTH))
}

/// The bodies with their sensors, as URDF.
pub fn robot_description() -> Topic {
    Topic::new::<std_msgs::String>("/robot_description", Qos::latched(1))
}

/// The map projected to the plane.
pub fn occupancy() -> Topic {
    Topic::new::<OccupancyGrid>("/map", Qos::latched(1))
}

/// The centres of the visible walls of the map.
pub fn map_points() -> Topic {
    Topic::new::<PointCloud2>("/sim/map_points", Qos::latched(1))
}

/// The map as a tree of OctoMap.
pub fn octomap() -> Topic {
    Topic::new::<Octomap>("/sim/octomap", Qos::latched(1))
}

/// What the team has seen of the map, as a tree of OctoMap.
pub fn explored_octomap() -> Topic {
    Topic::new::<Octomap>("/sim/explored_octomap", Qos::latched(1))
}

/// What the team has seen of the map, projected to the plane.
pub fn explored_occupancy() -> Topic {
    Topic::new::<OccupancyGrid>("/sim/explored_map", Qos::latched(1))
}

/// The centres of the walls that the team has seen.
pub fn explored_points() -> Topic {
    Topic::new::<PointCloud2>("/sim/explored_points", Qos::latched(1))
}

/// What nodes say to people.
pub fn rosout() -> Topic {
    Topic::new::<Log>("/rosout", Qos::latched(LOG_DEPTH))
}

/// How far the run has come; the last one also for those that look later.
pub fn progress() -> Topic {
    Topic::new::<Progress>("/sim/progress", Qos::latched(1))
}

/// The digest of the run, every second of sim time.
pub fn digest() -> Topic {
    Topic::new::<Digest>("/sim/digest", Qos::reliable(VIEW_DEPTH))
}

/// The outcome of the run; also for those that look later.
pub fn result() -> Topic {
    Topic::new::<Result>("/sim/result", Qos::latched(1))
}

/// What was done to the run from outside; in recordings only.
pub fn intervention() -> Topic {
    Topic::new::<Intervention>("/sim/intervention", Qos::reliable(VIEW_DEPTH))
}

/// Changes of the map during the run; in recordings only.
pub fn map_change() -> Topic {
    Topic::new::<MapChange>("/sim/map_change", Qos::reliable(VIEW_DEPTH))
}

/// What has changed at the parameters of nodes. A topic of ROS itself, and not one of a run.
pub fn parameter_events() -> Topic {
    Topic::new::<ParameterEvent>("/parameter_events", Qos::reliable(1000))
}

/// All topics of a run with this many agents: those of the simulation, then those of agent 0, 1,
/// and so on; first what the protocol needs, then what is only looked at.
///
/// ```
/// let topics = msgs::topics::all(2);
/// assert_eq!(topics[0].to_string(), "/clock [rosgraph_msgs/msg/Clock]");
/// assert_eq!(topics.last().unwrap().name, "/agent_1/map_points");
/// ```
pub fn all(agents: u32) -> Vec<Topic> {
    let mut topics = Vec::from(of_simulation());
    topics.extend((0..agents).map(AgentId).flat_map(of_agent));
    topics
}

/// The topic of this name, if runs have one.
///
/// ```
/// use msgs::{ids::AgentId, topics};
///
/// assert_eq!(topics::named("/agent_7/odom"), Some(topics::odometry(AgentId(7))));
/// assert_eq!(topics::named("/chatter"), None);
/// ```
pub fn named(name: &str) -> Option<Topic> {
    let topics = match split(name) {
        Some((agent, rest)) => {
            let sensor = rest.split_once('/').and_then(|(sensor, _)| sensor.parse().ok());
            Vec::from(of_agent(agent))
                .into_iter()
                .chain(sensor.map(|sensor| of_named_sensor(agent, sensor)).into_iter().flatten())
                .collect()
        }
        None => Vec::from(of_simulation()),
    };
    topics.into_iter().find(|topic| topic.name == name)
}

/// The topics of a sensor with a name, one of several of its body.
fn of_named_sensor(agent: AgentId, sensor: SensorName) -> [Topic; 4] {
    let sensor = Some(sensor);
    [points(agent, sensor), scan(agent, sensor), depth_image(agent, sensor), camera_info(agent, sensor)]
}

/// The agent and the rest of the name, of the name of a topic of an agent.
///
/// ```
/// use msgs::{ids::AgentId, topics};
///
/// assert_eq!(topics::split("/agent_7/odom"), Some((AgentId(7), "odom")));
/// assert_eq!(topics::split("/sim/map"), None);
/// ```
pub fn split(name: &str) -> Option<(AgentId, &str)> {
    let (agent, rest) = name.strip_prefix("/agent_")?.split_once('/')?;
    Some((AgentId(agent.parse().ok()?), rest))
}

fn of_simulation() -> [Topic; 23] {
    [
        clock(),
        scenario(),
        join_reply(),
        tf(),
        progress(),
        digest(),
        result(),
        intervention(),
        map_change(),
        tf_static(),
        map(),
        unexplored(),
        contacts(),
        info(),
        diagnostics(),
        robot_description(),
        occupancy(),
        map_points(),
        octomap(),
        explored_octomap(),
        explored_occupancy(),
        explored_points(),
        rosout(),
    ]
}

fn of_agent(agent: AgentId) -> [Topic; 15] {
    [
        join(agent),
        observation(agent),
        command(agent),
        cmd_vel(agent),
        odometry(agent),
        points(agent, None),
        scan(agent, None),
        depth_image(agent, None),
        camera_info(agent, None),
        battery(agent),
        path(agent),
        belief(agent),
        belief_occupancy(agent),
        belief_octomap(agent),
        belief_points(agent),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_absolute() {
        let mut names: Vec<String> = all(12).into_iter().map(|topic| topic.name).collect();
        assert!(names.iter().all(|name| name.starts_with('/') && !name.contains("//")));
        let count = of_simulation().len() + 12 * of_agent(AgentId(0)).len();
        assert_eq!(names.len(), count);
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    #[test]
    fn every_topic_is_found_by_its_name() {
        for topic in all(12) {
            assert_eq!(named(&topic.name), Some(topic));
        }
        for topic in of_named_sensor(AgentId(7), "depth".parse().unwrap()) {
            assert_eq!(named(&topic.name), Some(topic));
        }
        for wrong in [
            "",
            "/agent_1/Front/points",
            "/agent_1/front/odom",
            "/agent_x/odom",
            "/agent_1",
            "/agent_1/",
            "/agent_01/odom",
            "sim/map",
        ] {
            assert_eq!(named(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn qos_of_an_observation_as_rosbag2_writes_it() {
        let expected = "\
- history: 1
  depth: 16
  reliability: 1
  durability: 2
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
";
        assert_eq!(observation(AgentId(3)).qos.offered_qos_profiles(), expected);
    }

    #[test]
    fn subscriptions_of_the_lock_step_may_do_without_acknowledgements() {
        for topic in [signed_observation(AgentId(3)), signed_command(AgentId(3))] {
            assert_eq!(topic.qos.reliability, Reliability::Reliable, "{topic}: what tools may request");
            let unacknowledged = topic.clone().unacknowledged();
            assert_eq!(unacknowledged.qos.reliability, Reliability::BestEffort, "{topic}");
            assert_eq!((unacknowledged.name, unacknowledged.message), (topic.name, topic.message));
        }
    }

    #[test]
    fn latched_topics_say_so() {
        for topic in [scenario(), join_reply(), progress(), result(), map(), unexplored(), tf_static(), rosout()] {
            assert!(topic.qos.offered_qos_profiles().contains("  durability: 1\n"), "{topic}");
        }
    }
}
