//! The visualisation topics of a run.

use msgs::ids::AgentId;
use msgs::topics::{self, Topic};

/// A visualisation topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum VisualisationTopic {
    /// The poses of all bodies.
    Transforms,
    /// The static frames.
    StaticTransforms,
    /// Pose and velocity of an agent.
    Odometry(AgentId),
    /// The last scan of an agent, as a point cloud.
    Points(AgentId),
    /// The line of the last scan of an agent that is closest to the plane of its LiDAR.
    Scan(AgentId),
    /// The last scan of an agent, as a depth image.
    DepthImage(AgentId),
    /// The projection of that image.
    CameraInfo(AgentId),
    /// The battery of an agent.
    Battery(AgentId),
    /// The remaining waypoints of an agent.
    Path(AgentId),
    /// The visible walls of the map.
    Map,
    /// The free cells that no agent has seen.
    Unexplored,
    /// The contacts between agents and relays.
    Contacts,
    /// The status of the run and of each agent, as diagnostics.
    Info,
    /// The same where tools for diagnostics look for it.
    Diagnostics,
    /// The bodies with their sensors, as URDF.
    RobotDescription,
    /// The map projected to the plane.
    Occupancy,
    /// The centres of the visible walls of the map.
    MapPoints,
    /// The map as a tree of OctoMap.
    Octomap,
    /// What the team has seen of the map, as a tree of OctoMap.
    ExploredOctomap,
    /// What the team has seen of the map, projected to the plane.
    ExploredOccupancy,
    /// The centres of the walls that the team has seen.
    ExploredPoints,
    /// The clock, as it is recorded; live, the session publishes it.
    Clock,
    /// The digest of the run so far.
    Digest,
    /// The result of the run.
    Result,
}

/// What the bodies of a run have that others do not, and that has topics of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Equipment {
    /// Whether the LiDARs have rings.
    pub has_ring: bool,
    /// Whether they are depth cameras.
    pub has_camera: bool,
    /// Whether the bodies have batteries.
    pub has_batteries: bool,
}

impl VisualisationTopic {
    /// All topics of a run with this many agents that are published live.
    pub fn all(agents: u32, equipment: Equipment) -> impl Iterator<Item = Self> {
        let of_run = [
            Self::Transforms,
            Self::StaticTransforms,
            Self::Map,
            Self::Unexplored,
            Self::Contacts,
            Self::Info,
            Self::Diagnostics,
            Self::RobotDescription,
            Self::Occupancy,
            Self::MapPoints,
            Self::Octomap,
            Self::ExploredOctomap,
            Self::ExploredOccupancy,
            Self::ExploredPoints,
            Self::Digest,
            Self::Result,
        ];
        let Equipment { has_ring, has_camera, has_batteries } = equipment;
        let of_agent = move |agent| {
            let of_sensors = [
                (Self::Scan(agent), has_ring),
                (Self::DepthImage(agent), has_camera),
                (Self::CameraInfo(agent), has_camera),
                (Self::Battery(agent), has_batteries),
            ];
            let of_sensors = of_sensors.into_iter().filter_map(|(topic, is_there)| is_there.then_some(topic));
            [Self::Odometry(agent), Self::Points(agent), Self::Path(agent)].into_iter().chain(of_sensors)
        };
        of_run.into_iter().chain((0..agents).map(AgentId).flat_map(of_agent))
    }

    /// The agent whose last scan it shows, with the stamp of that scan.
    pub(super) fn scanned_by(self) -> Option<AgentId> {
        match self {
            Self::Points(agent) | Self::Scan(agent) | Self::DepthImage(agent) | Self::CameraInfo(agent) => Some(agent),
            _ => None,
        }
    }

    /// The topic of which each message comes with one of this topic with the same stamp, as long as
    /// both have subscribers.
    pub(super) fn companion(self) -> Option<Self> {
        if let Self::DepthImage(agent) = self { Some(Self::CameraInfo(agent)) } else { None }
    }

    /// The topic of which this one is the companion.
    pub(super) fn accompanies(self) -> Option<Self> {
        if let Self::CameraInfo(agent) = self { Some(Self::DepthImage(agent)) } else { None }
    }

    /// Whether its messages have the stamp of their tick, and poses are looked up for it. What
    /// shows a scan has the stamp of that.
    pub(super) fn needs_present_transforms(self) -> bool {
        match self {
            Self::Odometry(_)
            | Self::Path(_)
            | Self::Unexplored
            | Self::Contacts
            | Self::Info
            | Self::Diagnostics
            | Self::ExploredOctomap
            | Self::ExploredOccupancy
            | Self::ExploredPoints => true,
            Self::Transforms
            | Self::StaticTransforms
            | Self::Points(_)
            | Self::Scan(_)
            | Self::DepthImage(_)
            | Self::CameraInfo(_)
            | Self::Battery(_)
            | Self::Map
            | Self::RobotDescription
            | Self::Occupancy
            | Self::MapPoints
            | Self::Octomap
            | Self::Clock
            | Self::Digest
            | Self::Result => false,
        }
    }

    /// Whether it shows the walls, and is published again when the map has changed.
    pub(super) fn shows_map(self) -> bool {
        matches!(self, Self::Map | Self::Occupancy | Self::MapPoints | Self::Octomap)
    }

    /// Whether it is published once, because it does not change while the map does not.
    pub(super) fn is_static(self) -> bool {
        matches!(
            self,
            Self::StaticTransforms
                | Self::Map
                | Self::RobotDescription
                | Self::Occupancy
                | Self::MapPoints
                | Self::Octomap
        )
    }

    /// Whether it is published in chunks.
    pub(super) fn is_chunked(self) -> bool {
        matches!(self, Self::Map | Self::Unexplored)
    }

    /// Its name, type and QoS.
    #[must_use]
    pub fn topic(self) -> Topic {
        match self {
            Self::Transforms => topics::tf(),
            Self::StaticTransforms => topics::tf_static(),
            Self::Odometry(agent) => topics::odometry(agent),
            Self::Points(agent) => topics::points(agent),
            Self::Scan(agent) => topics::scan(agent),
            Self::DepthImage(agent) => topics::depth_image(agent),
            Self::CameraInfo(agent) => topics::camera_info(agent),
            Self::Battery(agent) => topics::battery(agent),
            Self::Path(agent) => topics::path(agent),
            Self::Map => topics::map(),
            Self::Unexplored => topics::unexplored(),
            Self::Contacts => topics::contacts(),
            Self::Info => topics::info(),
            Self::Diagnostics => topics::diagnostics(),
            Self::RobotDescription => topics::robot_description(),
            Self::Occupancy => topics::occupancy(),
            Self::MapPoints => topics::map_points(),
            Self::Octomap => topics::octomap(),
            Self::ExploredOctomap => topics::explored_octomap(),
            Self::ExploredOccupancy => topics::explored_occupancy(),
            Self::ExploredPoints => topics::explored_points(),
            Self::Clock => topics::clock(),
            Self::Digest => topics::digest(),
            Self::Result => topics::result(),
        }
    }
}
