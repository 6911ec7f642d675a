//! The visualisation topics of a run.

use msgs::ids::AgentId;
use msgs::sensor_name::SensorName;
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
    /// The last scan of a LiDAR, as a point cloud.
    Points(SensorId),
    /// The line of the last scan of a LiDAR that is closest to its plane.
    Scan(SensorId),
    /// The last scan of a depth camera, as an image.
    DepthImage(SensorId),
    /// The projection of that image.
    CameraInfo(SensorId),
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

/// One of the LiDARs of an agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct SensorId {
    /// The agent.
    pub agent: AgentId,
    /// Its place among those of the agent, from 0.
    pub number: u8,
    /// Its name; the only LiDAR of a body has none.
    pub name: Option<SensorName>,
}

impl SensorId {
    /// The only LiDAR of an agent.
    #[must_use]
    pub fn only(agent: AgentId) -> Self {
        Self { agent, number: 0, name: None }
    }
}

/// What the bodies of a run have that has topics of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Equipment {
    /// The LiDARs by agent.
    pub lidars: Vec<Vec<LidarTopics>>,
    /// Whether the bodies have batteries.
    pub has_batteries: bool,
}

/// Which topics a LiDAR has beside its points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LidarTopics {
    /// Its name; the only LiDAR of a body has none.
    pub name: Option<SensorName>,
    /// Whether it has rings.
    pub has_ring: bool,
    /// Whether it is a depth camera.
    pub has_camera: bool,
}

impl Equipment {
    /// Agents that have the same LiDAR each, and no batteries.
    #[must_use]
    pub fn of_each(agents: u32, lidar: LidarTopics) -> Self {
        Self { lidars: vec![vec![lidar]; agents as usize], has_batteries: false }
    }

    /// The LiDARs of an agent of the run.
    ///
    /// # Panics
    /// If the run has no such agent.
    pub fn sensors_of(&self, agent: AgentId) -> impl Iterator<Item = (SensorId, LidarTopics)> {
        let id = move |(number, lidar): (u8, &LidarTopics)| (SensorId { agent, number, name: lidar.name }, *lidar);
        (0..=u8::MAX).zip(&self.lidars[agent.index()]).map(id)
    }
}

impl VisualisationTopic {
    /// All topics of a run that are published live.
    pub fn all(equipment: &Equipment) -> impl Iterator<Item = Self> {
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
        let of_agent = |agent: AgentId| {
            let mut topics = vec![Self::Odometry(agent)];
            topics.extend(equipment.sensors_of(agent).map(|(sensor, _)| Self::Points(sensor)));
            topics.push(Self::Path(agent));
            for (sensor, LidarTopics { has_ring, has_camera, .. }) in equipment.sensors_of(agent) {
                topics.extend(has_ring.then_some(Self::Scan(sensor)));
                topics.extend([Self::DepthImage(sensor), Self::CameraInfo(sensor)].into_iter().filter(|_| has_camera));
            }
            topics.extend(equipment.has_batteries.then_some(Self::Battery(agent)));
            topics
        };
        of_run.into_iter().chain((0..equipment.lidars.len()).map(AgentId::from_index).flat_map(of_agent))
    }

    /// The agent whose last scan it shows, with the stamp of that scan.
    pub(super) fn scanned_by(self) -> Option<AgentId> {
        match self {
            Self::Points(sensor) | Self::Scan(sensor) | Self::DepthImage(sensor) | Self::CameraInfo(sensor) => {
                Some(sensor.agent)
            }
            _ => None,
        }
    }

    /// The topic of which each message comes with one of this topic with the same stamp, as long as
    /// both have subscribers.
    pub(super) fn companion(self) -> Option<Self> {
        if let Self::DepthImage(sensor) = self { Some(Self::CameraInfo(sensor)) } else { None }
    }

    /// The topic of which this one is the companion.
    pub(super) fn accompanies(self) -> Option<Self> {
        if let Self::CameraInfo(sensor) = self { Some(Self::DepthImage(sensor)) } else { None }
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
            Self::Points(SensorId { agent, name, .. }) => topics::points(agent, name),
            Self::Scan(SensorId { agent, name, .. }) => topics::scan(agent, name),
            Self::DepthImage(SensorId { agent, name, .. }) => topics::depth_image(agent, name),
            Self::CameraInfo(SensorId { agent, name, .. }) => topics::camera_info(agent, name),
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
