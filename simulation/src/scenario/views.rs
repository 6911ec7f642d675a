//! The table `[views]`: the visualisation topics, live and recorded. None of it changes a result.

use msgs::ids::AgentId;
use msgs::sensor_name::SensorName;
use serde::{Deserialize, Serialize};

use super::{Checker, LidarPattern, LidarSection, Scenario, ScenarioError};
use crate::visualisation::{Equipment, LidarTopics, VisualisationTopic};

/// `[views]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ViewsSection {
    /// Greatest rate of messages of one topic per second of wall time while it has subscribers.
    pub max_hz: f64,
    /// Ticks between two messages on `/tf`.
    pub tf_period_ticks: u32,
    /// Ticks between two odometry messages of an agent.
    pub odom_period_ticks: u32,
    /// Least ticks between two published scans of an agent.
    pub points_period_ticks: u32,
    /// What the points of scans have beside their coordinates.
    pub points_fields: Vec<PointsField>,
    /// Ticks between two checks whether the path of an agent has changed.
    pub path_period_ticks: u32,
    /// Ticks between two checks whether the unexplored cells have changed.
    pub unexplored_period_ticks: u32,
    /// Ticks between two messages on the contacts.
    pub contacts_period_ticks: u32,
    /// Ticks between two messages on the state of the run.
    pub info_period_ticks: u32,
    /// Topics that the recording holds as well.
    pub record: Vec<RecordedView>,
}

impl Default for ViewsSection {
    fn default() -> Self {
        Self {
            max_hz: 30.0,
            tf_period_ticks: 5,
            odom_period_ticks: 5,
            points_period_ticks: 1,
            points_fields: Vec::new(),
            path_period_ticks: 5,
            unexplored_period_ticks: 50,
            contacts_period_ticks: 50,
            info_period_ticks: 50,
            record: Vec::new(),
        }
    }
}

impl ViewsSection {
    /// Ticks between two messages of a view, or two checks for a change.
    #[must_use]
    pub fn period_ticks(&self, view: VisualisationTopic) -> u64 {
        let ticks = match view {
            VisualisationTopic::Transforms => self.tf_period_ticks,
            VisualisationTopic::Odometry(_) => self.odom_period_ticks,
            VisualisationTopic::Points(_)
            | VisualisationTopic::Scan(_)
            | VisualisationTopic::DepthImage(_)
            | VisualisationTopic::CameraInfo(_) => self.points_period_ticks,
            VisualisationTopic::Path(_) => self.path_period_ticks,
            VisualisationTopic::Unexplored
            | VisualisationTopic::ExploredOctomap
            | VisualisationTopic::ExploredOccupancy
            | VisualisationTopic::ExploredPoints => self.unexplored_period_ticks,
            VisualisationTopic::Contacts => self.contacts_period_ticks,
            VisualisationTopic::Info | VisualisationTopic::Diagnostics | VisualisationTopic::Battery(_) => {
                self.info_period_ticks
            }
            VisualisationTopic::StaticTransforms
            | VisualisationTopic::Map
            | VisualisationTopic::RobotDescription
            | VisualisationTopic::Occupancy
            | VisualisationTopic::MapPoints
            | VisualisationTopic::Octomap
            | VisualisationTopic::Clock
            | VisualisationTopic::Digest
            | VisualisationTopic::Result => 1,
        };
        u64::from(ticks.max(1))
    }

    /// Least wall time between two messages of one topic, nanoseconds.
    #[must_use]
    pub fn pause_ns(&self) -> u64 {
        (1e9 / self.max_hz) as u64
    }
}

/// A view that can be recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordedView {
    /// `/tf_static`.
    TfStatic,
    /// `/agent_<id>/odom`.
    Odom,
    /// `/agent_<id>/points`.
    Points,
    /// `/agent_<id>/scan`.
    Scan,
    /// `/agent_<id>/depth/image`.
    DepthImage,
    /// `/agent_<id>/depth/camera_info`.
    CameraInfo,
    /// `/agent_<id>/battery_state`.
    Battery,
    /// `/agent_<id>/path`.
    Path,
    /// `/sim/map`.
    Map,
    /// `/sim/unexplored`.
    Unexplored,
    /// `/sim/contacts`.
    Contacts,
    /// `/sim/info`.
    Info,
    /// `/diagnostics`.
    Diagnostics,
    /// `/robot_description`.
    RobotDescription,
    /// `/map`.
    Occupancy,
    /// `/sim/map_points`.
    MapPoints,
    /// `/sim/octomap`.
    Octomap,
    /// `/sim/explored_octomap`.
    ExploredOctomap,
    /// `/sim/explored_map`.
    ExploredOccupancy,
    /// `/sim/explored_points`.
    ExploredPoints,
    /// `/clock`.
    Clock,
    /// All of them.
    All,
}

impl RecordedView {
    /// Their names.
    pub const WORDS: &'static [&'static str] = &[
        "tf_static",
        "odom",
        "points",
        "scan",
        "depth_image",
        "camera_info",
        "battery",
        "path",
        "map",
        "unexplored",
        "contacts",
        "info",
        "diagnostics",
        "robot_description",
        "occupancy",
        "map_points",
        "octomap",
        "explored_octomap",
        "explored_occupancy",
        "explored_points",
        "clock",
        "all",
    ];
}

/// A field of the points of a scan beside x, y and z.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PointsField {
    /// `intensity`.
    Intensity,
    /// `ring`.
    Ring,
    /// `time`.
    Time,
}

impl PointsField {
    /// Their names.
    pub const WORDS: &'static [&'static str] = &["intensity", "ring", "time"];
}

impl Scenario {
    /// What the bodies have that not all have.
    #[must_use]
    pub fn equipment(&self) -> Equipment {
        let of_lidar = |(name, lidar): (Option<SensorName>, &LidarSection)| LidarTopics {
            name,
            has_ring: lidar.pattern == LidarPattern::Ring,
            has_camera: lidar.pattern == LidarPattern::Frustum,
        };
        let of_agent = |agent| self.lidars_of(AgentId(agent)).map(of_lidar).collect();
        Equipment { lidars: (0..self.agents.count).map(of_agent).collect(), has_batteries: self.energy.is_some() }
    }

    pub(super) fn check_views(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        const OF_RING: &str = "expected only with lidar.pattern = \"ring\"";
        const OF_FRUSTUM: &str = "expected only with lidar.pattern = \"frustum\"";
        let has = |pattern: LidarPattern| self.lidars().any(|(_, lidar)| lidar.pattern == pattern);
        let (has_ring, has_camera) = (has(LidarPattern::Ring), has(LidarPattern::Frustum));
        let has_batteries = self.energy.is_some();
        let has_ring_field = self.views.points_fields.contains(&PointsField::Ring);
        checker.require("views.points_fields", "\"ring\"", !has_ring_field || has_ring, OF_RING)?;
        let conditional = [
            (RecordedView::Scan, "\"scan\"", has_ring, OF_RING),
            (RecordedView::DepthImage, "\"depth_image\"", has_camera, OF_FRUSTUM),
            (RecordedView::CameraInfo, "\"camera_info\"", has_camera, OF_FRUSTUM),
            (RecordedView::Battery, "\"battery\"", has_batteries, "expected only with [energy]"),
        ];
        for (view, word, is_there, allowed) in conditional {
            checker.require("views.record", word, is_there || !self.views.record.contains(&view), allowed)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(tables: &str) -> Result<Scenario, String> {
        let text = "seed = 1\nduration_s = 1.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 2 }\n";
        Scenario::parse("s.toml", &format!("{text}{tables}\n"), &[]).map_err(|error| error.to_string())
    }

    #[test]
    fn sensors_that_no_body_has_are_refused() {
        let refused = |tables: &str| parse(tables).unwrap_err();
        let ring = refused("views = { points_fields = [\"time\", \"ring\"] }");
        assert_eq!(ring, "s.toml:5: views.points_fields = \"ring\": expected only with lidar.pattern = \"ring\"");
        assert!(refused("views = { points_fields = [\"rings\"] }").contains("did you mean \"ring\"?"));
        for (word, allowed) in [
            ("scan", "lidar.pattern = \"ring\""),
            ("depth_image", "lidar.pattern = \"frustum\""),
            ("camera_info", "lidar.pattern = \"frustum\""),
            ("battery", "[energy]"),
        ] {
            let refused = refused(&format!("views = {{ record = [\"{word}\"] }}"));
            assert!(
                refused.ends_with(&format!("views.record = \"{word}\": expected only with {allowed}")),
                "{refused}"
            );
        }
        let all = parse("views = { record = [\"all\"] }").unwrap();
        assert_eq!(all.equipment(), Equipment::of_each(2, LidarTopics::default()));
    }

    #[test]
    fn views_are_no_part_of_the_identity() {
        let lidar = "lidar = { preset = \"vlp-16\" }\n";
        let with = parse(&format!("{lidar}views = {{ points_fields = [\"ring\"], record = [\"scan\"] }}")).unwrap();
        assert_eq!(with.identity(), parse(lidar).unwrap().identity());
    }
}
