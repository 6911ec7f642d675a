//! The tables of a scenario, with their defaults: the reference's constants where it has them.
//!
//! This module checks nothing: see [`super::Scenario::parse`].

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::PathBuf;

use serde::{Deserialize, Deserializer, Serialize, de};

use crate::mapgen::{NoiseSpec, SpheresSpec};

/// `[map]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapSection {
    /// Which generator, or a file.
    pub kind: MapKind,
    /// Cells along each axis; one number for a cube. Not for `kind = "file"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<Size>,
    /// Edge of a cell, metres.
    #[serde(default = "one")]
    pub cell_m: f64,
    /// Seed of the map, if it is not that of the run.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "some_seed")]
    pub seed: Option<u64>,
    /// The map file of `kind = "file"`, relative to where the server runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Parameters of `kind = "spheres"`.
    #[serde(default)]
    pub spheres: SpheresSpec,
    /// Parameters of `kind = "noise"`.
    #[serde(default)]
    pub noise: NoiseSpec,
}

/// Where the terrain comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MapKind {
    /// Random connected spheres.
    Spheres,
    /// Smoothed noise.
    Noise,
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

/// `[communication]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CommunicationSection {
    /// Greatest distance between two agents in contact; `inf`: as far as the line of sight (reference).
    pub range_m: f64,
}

impl Default for CommunicationSection {
    fn default() -> Self {
        Self { range_m: f64::INFINITY }
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

fn one() -> f64 {
    1.0
}

fn rbw() -> String {
    "rbw".to_owned()
}

/// Reference: 5.02 s between two exchanges of maps.
fn share_period() -> u32 {
    251
}
