//! The tables of a scenario, with their defaults: the reference's constants where it has them.
//!
//! This module checks nothing: see [`super::Scenario::parse`].

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::PathBuf;

use serde::{Deserialize, Deserializer, Serialize, de};

use crate::visualisation::VisualisationTopic;
use mapgen::{BuildingSpec, ImportOptions, NoiseSpec, SpheresSpec};

/// `[map]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapSection {
    /// Which generator, or a file.
    pub kind: MapKind,
    /// Cells along each axis; one number for a cube. Not for `kind = "file"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<Size>,
    /// Edge of a cell, metres. `None`, only with `kind = "file"`: as long as the file says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell_m: Option<f64>,
    /// Seed of the map, if it is not that of the run.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "some_seed")]
    pub seed: Option<u64>,
    /// The map file of `kind = "file"`, relative to where the server runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// How the map file is read.
    #[serde(default, skip_serializing_if = "ImportOptions::is_default")]
    pub import: ImportOptions,
    /// Parameters of `kind = "spheres"`.
    #[serde(default)]
    pub spheres: SpheresSpec,
    /// Parameters of `kind = "noise"`.
    #[serde(default)]
    pub noise: NoiseSpec,
    /// Parameters of `kind = "building"`, which has them in a checked scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub building: Option<BuildingSpec>,
}

/// Where the terrain comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MapKind {
    /// Random connected spheres.
    Spheres,
    /// Smoothed noise.
    Noise,
    /// Floors of hallways and rooms.
    Building,
    /// A map file.
    File,
}

/// Cells along each axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a number of cells from 1 to 1024, or three such as [100, 80, 30]")]
pub enum Size {
    /// A cube.
    Cube(u32),
    /// x, y, z.
    Box([u32; 3]),
}

impl Size {
    /// x, y, z.
    #[must_use]
    pub fn cells(self) -> [u32; 3] {
        match self {
            Self::Cube(edge) => [edge; 3],
            Self::Box(size) => size,
        }
    }
}

/// `[agents]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentsSection {
    /// How many take part.
    pub count: u32,
    /// What an agent runs if its own command line does not say.
    #[serde(default = "rbw")]
    pub controller: String,
    /// Ticks between two tellings of what is new on an agent's map to those in contact with it; 0: agents only listen.
    #[serde(default = "share_period")]
    pub share_period_ticks: u32,
    /// Settings of that controller.
    #[serde(default)]
    pub set: BTreeMap<String, toml::Value>,
    /// Ids of those that run no controller but are driven by standard messages, over ROS 2: a velocity for each tick.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cmd_vel: Vec<u32>,
}

/// `[lidar]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LidarSection {
    /// How rays are spread.
    pub pattern: LidarPattern,
    /// Rays of the lattice. Reference: 5124.
    pub rays: u32,
    /// Radius of the shell pattern, cells. Reference: 5.
    pub shell_radius_cells: u32,
    /// How far the lattice sees; `inf`: unlimited (reference).
    pub range_m: f64,
    /// Full opening angle of the cone about the heading. Reference: all directions.
    pub fov_rad: f64,
    /// Who decides when to scan.
    pub schedule: LidarSchedule,
    /// Ticks between scans until an agent asks otherwise. Reference: what each of ten agents gets.
    pub period_ticks: u32,
}

/// How rays are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LidarPattern {
    /// A Fibonacci lattice of `rays` rays.
    Lattice,
    /// One ray to every cell on the edge of a sphere of `shell_radius_cells` (the reference's older sensing).
    Shell,
}

/// Who decides when to scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LidarSchedule {
    /// Each agent; at the start every `period_ticks`.
    OnRequest,
    /// One agent in each tick, in turn, as in the reference.
    Maes3d,
}

impl Default for LidarSection {
    fn default() -> Self {
        Self {
            pattern: LidarPattern::Lattice,
            rays: 5124,
            shell_radius_cells: 5,
            range_m: f64::INFINITY,
            fov_rad: TAU,
            schedule: LidarSchedule::OnRequest,
            period_ticks: 10,
        }
    }
}

/// `[recording]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordingSection {
    /// Ticks between two recordings of the poses of all agents on `/tf`; 0: none.
    pub poses_period_ticks: u32,
}

impl Default for RecordingSection {
    fn default() -> Self {
        Self { poses_period_ticks: 10 }
    }
}

/// `[faults]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FaultsSection {
    /// When an agent does not answer within `execution.decision_timeout_s`.
    pub on_agent_loss: OnAgentLoss,
}

/// What happens when an agent is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnAgentLoss {
    /// The run ends with exit code 4.
    Abort,
    /// The body stops and the run goes on without the agent.
    Drop,
    /// The clock is held until the agent answers, or another process takes its place and has been told its past.
    Wait,
}

impl Default for FaultsSection {
    fn default() -> Self {
        Self { on_agent_loss: OnAgentLoss::Abort }
    }
}

/// `[execution]`: none of this changes a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExecutionSection {
    /// Threads that cast scans; 0: as many as there are cores.
    pub threads: u32,
    /// Whether agents are asked only when they are due. Otherwise they are asked at every tick.
    pub look_ahead: bool,
    /// Sim seconds for each second of wall time.
    pub rtf: Rtf,
    /// Whether the run begins paused, at tick 0, until somebody lets it go on through a service.
    pub paused: bool,
    /// How long to wait for all agents at the start, wall seconds.
    pub join_timeout_s: f64,
    /// How long to wait for a decision, wall seconds.
    pub decision_timeout_s: f64,
    /// Where the recording goes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record: Option<PathBuf>,
}

impl Default for ExecutionSection {
    fn default() -> Self {
        Self {
            threads: 0,
            look_ahead: true,
            rtf: Rtf::MAX,
            paused: false,
            join_timeout_s: 60.0,
            decision_timeout_s: 10.0,
            record: None,
        }
    }
}

/// `[views]`: what people look at. None of this changes a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ViewsSection {
    /// Messages of one topic in a second of wall time at the most, while somebody listens.
    pub max_hz: f64,
    /// Ticks between two messages on `/tf`.
    pub tf_period_ticks: u32,
    /// Ticks between two odometries of an agent.
    pub odom_period_ticks: u32,
    /// Ticks between two scans of an agent that are shown, at the least.
    pub points_period_ticks: u32,
    /// Ticks between two looks at where an agent is going.
    pub path_period_ticks: u32,
    /// Ticks between two looks at what nobody has seen.
    pub unexplored_period_ticks: u32,
    /// Ticks between two looks at who is in contact.
    pub contacts_period_ticks: u32,
    /// Ticks between two messages on how things are.
    pub info_period_ticks: u32,
    /// What is recorded, too.
    pub record: Vec<RecordedView>,
}

impl Default for ViewsSection {
    fn default() -> Self {
        Self {
            max_hz: 30.0,
            tf_period_ticks: 5,
            odom_period_ticks: 5,
            points_period_ticks: 1,
            path_period_ticks: 5,
            unexplored_period_ticks: 50,
            contacts_period_ticks: 50,
            info_period_ticks: 50,
            record: Vec::new(),
        }
    }
}

impl ViewsSection {
    /// The keys of the periods and their values, at least 1 in a checked scenario.
    pub(super) fn periods(&self) -> [(&'static str, u32); 7] {
        [
            ("views.tf_period_ticks", self.tf_period_ticks),
            ("views.odom_period_ticks", self.odom_period_ticks),
            ("views.points_period_ticks", self.points_period_ticks),
            ("views.path_period_ticks", self.path_period_ticks),
            ("views.unexplored_period_ticks", self.unexplored_period_ticks),
            ("views.contacts_period_ticks", self.contacts_period_ticks),
            ("views.info_period_ticks", self.info_period_ticks),
        ]
    }

    /// Ticks between two messages of a view, or two looks at what it shows.
    #[must_use]
    pub fn period_ticks(&self, view: VisualisationTopic) -> u64 {
        let ticks = match view {
            VisualisationTopic::Transforms => self.tf_period_ticks,
            VisualisationTopic::Odometry(_) => self.odom_period_ticks,
            VisualisationTopic::Points(_) => self.points_period_ticks,
            VisualisationTopic::Path(_) => self.path_period_ticks,
            VisualisationTopic::Unexplored => self.unexplored_period_ticks,
            VisualisationTopic::Contacts => self.contacts_period_ticks,
            VisualisationTopic::Info => self.info_period_ticks,
            VisualisationTopic::StaticTransforms
            | VisualisationTopic::Map
            | VisualisationTopic::Digest
            | VisualisationTopic::Result => 1,
        };
        u64::from(ticks.max(1))
    }

    /// Nanoseconds of wall time between two messages of one topic at the least.
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
}

/// Pace of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected 0.001 to 1e6, or \"max\"")]
pub enum Rtf {
    /// As fast as possible.
    Max(MaxWord),
    /// Sim seconds for each second of wall time, at the most.
    Limit(f64),
}

impl Rtf {
    /// As fast as possible.
    pub const MAX: Self = Self::Max(MaxWord::Max);
}

/// The word `max`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaxWord {
    /// `max`.
    Max,
}

/// What TOML has room for.
const SEEDS: &str = "expected a seed from 0 to 9223372036854775807";

/// A seed, or an error that says which there are.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a seed from 0 to 9223372036854775807")]
enum Seed {
    Number(u64),
}

/// Reads a seed; an error says which there are.
pub(super) fn seed<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let Seed::Number(seed) = Seed::deserialize(deserializer)?;
    if i64::try_from(seed).is_ok() { Ok(seed) } else { Err(de::Error::custom(SEEDS)) }
}

fn some_seed<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u64>, D::Error> {
    seed(deserializer).map(Some)
}

fn rbw() -> String {
    "rbw".to_owned()
}

/// Reference: 5.02 s between two exchanges of maps.
fn share_period() -> u32 {
    251
}
