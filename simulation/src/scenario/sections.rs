//! The tables of a scenario as structs, with their defaults: the constants of the reference where
//! it has them.
//!
//! Ranges and meanings are declared in [`super::keys`]; this module checks nothing.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Deserializer, Serialize, de};

use super::keys::nearest;
use mapgen::{BuildingSpec, ImportOptions, MineSpec, NoiseSpec, SceneSpec, SpheresSpec};

/// `[map]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapSection {
    /// Which generator, or a file.
    pub kind: MapKind,
    /// Cells along each axis; one number for a cube. Not for `kind = "file"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<Size>,
    /// Edge length of a cell, metres. `None`, only with `kind = "file"`: the length stored in the
    /// file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell_m: Option<f64>,
    /// Seed of the map, if it is not that of the run.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "some_seed")]
    pub seed: Option<u64>,
    /// The map file of `kind = "file"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The folder that `file` and the paths of `import` start from; empty: the working directory.
    /// It is no key, and no part of the identity of a run: whoever reads a file sets it.
    #[serde(skip)]
    pub folder: PathBuf,
    /// Options of the importer.
    #[serde(default, skip_serializing_if = "ImportOptions::is_default")]
    pub import: ImportOptions,
    /// Parameters of `kind = "spheres"`.
    #[serde(default)]
    pub spheres: SpheresSpec,
    /// Parameters of `kind = "noise"`.
    #[serde(default)]
    pub noise: NoiseSpec,
    /// Parameters of `kind = "building"`; a checked scenario of that kind has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub building: Option<BuildingSpec>,
    /// Parameters of `kind = "mine"`; a checked scenario of that kind has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mine: Option<MineSpec>,
    /// Parameters of `kind = "scene"`; a checked scenario of that kind has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<SceneSpec>,
}

impl MapSection {
    /// Where the map file is.
    #[must_use]
    pub fn path(&self) -> Option<PathBuf> {
        self.file.as_ref().map(|file| self.folder.join(file))
    }
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
    /// Levels of drifts with crosscuts, stopes and a ramp.
    Mine,
    /// A place of the literature at true scale.
    Scene,
    /// A map file.
    File,
}

impl MapKind {
    /// Whether a word is nearly the name of a generator.
    #[must_use]
    pub fn is_misspelt_generator(word: &str) -> bool {
        let generators = [Self::Spheres, Self::Noise, Self::Building, Self::Mine, Self::Scene];
        let names = generators.map(toml::Value::try_from);
        nearest(word, names.iter().flatten().filter_map(toml::Value::as_str)).is_some()
    }
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
    /// Number of agents.
    pub count: u32,
    /// Controller of every agent that `mix` gives no other, and whose own command line names none.
    #[serde(default = "rbw")]
    pub controller: String,
    /// Ticks between two map updates that an agent sends to its contacts; 0: it only receives.
    #[serde(default = "share_period")]
    pub share_period_ticks: u32,
    /// Settings of that controller.
    #[serde(default)]
    pub set: BTreeMap<String, toml::Value>,
    /// Ids of the agents without a controller, externally controlled by velocity commands over ROS
    /// 2.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cmd_vel: Vec<u32>,
    /// Ids of the agents that are not in the world until a service lets them join.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reserve: Vec<u32>,
    /// Ids of the agents that are base stations.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub base_stations: Vec<u32>,
    /// The program that runs agents, and its arguments; empty: `agent_node`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub command: Vec<String>,
    /// Ids of the agents that `command` runs; empty: all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub command_ids: Vec<u32>,
    /// Whether `command` signs what it sends.
    #[serde(default = "super::yes", skip_serializing_if = "super::team::is_yes")]
    pub command_signs: bool,
    /// Agents with other controllers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mix: Vec<super::MixEntry>,
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
    /// Reaction to an agent that does not answer within `execution.decision_timeout_s`.
    pub on_agent_loss: OnAgentLoss,
}

/// Reaction to the loss of an agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnAgentLoss {
    /// The run ends with exit code 4.
    Abort,
    /// The body stops and the run continues without the agent.
    Drop,
    /// The clock is held until the agent answers, or another process has taken its place and
    /// received its observation log.
    Wait,
}

impl Default for FaultsSection {
    fn default() -> Self {
        Self { on_agent_loss: OnAgentLoss::Abort }
    }
}

/// `[execution]`: how a run is executed. None of it changes the result of a run in which no process
/// exceeds a timeout; `faults.on_agent_loss` decides what follows if one does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExecutionSection {
    /// Threads that cast scans; 0: one for each core.
    pub threads: u32,
    /// Whether agents are asked only when they are due. Otherwise they are asked at every tick.
    pub look_ahead: bool,
    /// Whether observations and commands go over Unix sockets between processes of one machine.
    pub unix_sockets: bool,
    /// Greatest real-time factor.
    pub rtf: Rtf,
    /// Whether the run starts paused, at tick 0, until a service call resumes it.
    pub paused: bool,
    /// Wall time to wait for all agents at the start, seconds.
    pub join_timeout_s: f64,
    /// Wall time to wait for a reply, seconds.
    pub decision_timeout_s: f64,
    /// File of the recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record: Option<PathBuf>,
}

impl Default for ExecutionSection {
    fn default() -> Self {
        Self {
            threads: 0,
            look_ahead: true,
            unix_sockets: false,
            rtf: Rtf::MAX,
            paused: false,
            join_timeout_s: 60.0,
            decision_timeout_s: 10.0,
            record: None,
        }
    }
}

/// Real-time factor of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected 0.001 to 1e6, or \"max\"")]
pub enum Rtf {
    /// As fast as possible.
    Max(MaxWord),
    /// At most so many sim seconds per second of wall time.
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

/// The integers of TOML that are not negative.
const SEEDS: &str = "expected a seed from 0 to 9223372036854775807";

/// A seed, with an error that names the range.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a seed from 0 to 9223372036854775807")]
enum Seed {
    Number(u64),
}

/// Reads a seed.
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
