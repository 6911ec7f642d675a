//! The scenario: everything that determines a run, as a TOML file that says it.
//!
//! Parsed once and checked; whoever holds a [`Scenario`] holds a legal one. Two tables stand apart: `[execution]` says how a run
//! is carried out (threads, pacing, time-outs) and can never change its result, so it is not part of a recording.
//!
//! This module reads no map files and knows no command line; flags arrive as [`Override`]s of keys.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::PathBuf;

use msgs::ids::Tick;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::mapgen::noise::NoiseSpec;
use crate::mapgen::spheres::SpheresSpec;
use crate::world::body::BodyModel;
use crate::world::spawn::SpawnSpec;

/// Agents a run may have at the most: the participants that DDS finds on one host (120) leave room for no more processes, and
/// several agents may share one.
pub const AGENTS_MAX: u32 = 1000;

/// A run. See docs/scenario.md for the keys.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Seed of everything random: the map (unless `map.seed` is given) and the agents.
    pub seed: u64,
    /// Sim time after which the run ends, seconds; a whole number of fixed updates.
    pub duration_s: f64,
    /// Whether the run ends once every free cell has been seen.
    #[serde(default = "yes")]
    pub stop_when_explored: bool,
    /// The terrain.
    pub map: MapSection,
    /// The team.
    pub agents: AgentsSection,
    /// Where the agents start.
    #[serde(default = "nearest_origin")]
    pub spawn: SpawnSpec,
    /// What bodies can do.
    #[serde(default)]
    pub body: BodySection,
    /// What LiDARs see.
    #[serde(default)]
    pub lidar: LidarSection,
    /// Who hears whom.
    #[serde(default)]
    pub communication: CommunicationSection,
    /// What a recording holds beside the protocol.
    #[serde(default)]
    pub recording: RecordingSection,
    /// What happens when an agent fails.
    #[serde(default)]
    pub faults: FaultsSection,
    /// How the run is carried out.
    #[serde(default)]
    pub execution: ExecutionSection,
}

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
    #[serde(default, skip_serializing_if = "Option::is_none")]
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
#[serde(untagged)]
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
    /// Settings of that controller.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub set: BTreeMap<String, toml::Value>,
}

/// `[body]`: the submarine of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BodySection {
    /// Radius of the sphere.
    pub radius_m: f64,
    /// Top speed.
    pub speed_max_m_s: f64,
    /// Speeding up.
    pub acceleration_m_s2: f64,
    /// Braking.
    pub deceleration_m_s2: f64,
    /// Top turn rate.
    pub turn_rate_max_rad_s: f64,
    /// Speeding up a turn.
    pub turn_acceleration_rad_s2: f64,
    /// Braking a turn.
    pub turn_deceleration_rad_s2: f64,
}

impl Default for BodySection {
    /// The reference's constants (100, 50 and 25 degrees for the turn).
    fn default() -> Self {
        Self {
            radius_m: 0.4,
            speed_max_m_s: 1.5,
            acceleration_m_s2: 0.5,
            deceleration_m_s2: 0.25,
            turn_rate_max_rad_s: TAU * 100.0 / 360.0,
            turn_acceleration_rad_s2: TAU * 50.0 / 360.0,
            turn_deceleration_rad_s2: TAU * 25.0 / 360.0,
        }
    }
}

impl From<BodySection> for BodyModel {
    fn from(section: BodySection) -> Self {
        Self {
            radius_m: section.radius_m,
            speed_max_m_s: section.speed_max_m_s,
            acceleration_m_s2: section.acceleration_m_s2,
            deceleration_m_s2: section.deceleration_m_s2,
            turn_rate_max_rad_s: section.turn_rate_max_rad_s,
            turn_acceleration_rad_s2: section.turn_acceleration_rad_s2,
            turn_deceleration_rad_s2: section.turn_deceleration_rad_s2,
        }
    }
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
        Self {
            range_m: f64::INFINITY,
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
        Self {
            poses_period_ticks: 10,
        }
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
        Self {
            on_agent_loss: OnAgentLoss::Abort,
        }
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
            rtf: Rtf::Max(MaxWord::Max),
            join_timeout_s: 60.0,
            decision_timeout_s: 10.0,
            record: None,
        }
    }
}

/// Pace of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Rtf {
    /// As fast as possible.
    Max(MaxWord),
    /// Sim seconds for each second of wall time, at the most.
    Limit(f64),
}

/// The word `max`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaxWord {
    /// `max`.
    Max,
}

/// A key of the scenario that the command line sets: `agents.count = 5`.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// What the user typed, for error messages.
    pub origin: String,
    /// Dotted path of the key.
    pub key: String,
    /// The new value.
    pub value: toml::Value,
}

/// Why a scenario is not legal.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ScenarioError {
    /// The text is no TOML, or a key is missing, unknown, or of another type.
    #[error("{file}:{line}:{column}: {reason}")]
    Syntax {
        /// Name of the file.
        file: String,
        /// From 1.
        line: usize,
        /// From 1, in characters.
        column: usize,
        /// What is wrong.
        reason: String,
    },
    /// An override does not fit.
    #[error("{origin}: {reason}")]
    Override {
        /// What the user typed.
        origin: String,
        /// What is wrong.
        reason: String,
    },
    /// A value is out of range.
    #[error("{file}: {key} = {value}: {allowed}")]
    Value {
        /// Name of the file.
        file: String,
        /// Dotted path of the key.
        key: &'static str,
        /// The value.
        value: String,
        /// What is allowed.
        allowed: String,
    },
}

impl Scenario {
    /// Parses a scenario, sets the overridden keys, and checks the whole. `file` is the name for error messages.
    ///
    /// # Errors
    /// If the text or an override does not fit, or a value is out of range.
    pub fn parse(file: &str, text: &str, overrides: &[Override]) -> Result<Self, ScenarioError> {
        let syntax = |error: toml::de::Error| {
            let start = error.span().map_or(0, |span| span.start);
            let before = &text[..start.min(text.len())];
            let line_start = before.rfind('\n').map_or(0, |at| at + 1);
            ScenarioError::Syntax {
                file: file.to_owned(),
                line: before.matches('\n').count() + 1,
                column: before[line_start..].chars().count() + 1,
                reason: one_line(error.message()),
            }
        };
        let mut scenario: Self = toml::from_str(text).map_err(syntax)?;
        if !overrides.is_empty() {
            let mut table: toml::Table = toml::from_str(text).map_err(syntax)?;
            for change in overrides {
                let unfit = |reason: String| ScenarioError::Override {
                    origin: change.origin.clone(),
                    reason,
                };
                set_key(&mut table, &change.key, change.value.clone()).map_err(unfit)?;
                scenario = table
                    .clone()
                    .try_into()
                    .map_err(|error: toml::de::Error| unfit(one_line(error.message())))?;
            }
        }
        scenario.check(file)?;
        Ok(scenario)
    }

    /// The scenario as a recording holds it: all keys, without `[execution]`.
    #[must_use]
    pub fn identity(&self) -> String {
        let mut table =
            toml::Table::try_from(self).expect("a scenario has string keys and plain values");
        table.remove("execution");
        toml::to_string(&table).expect("a table can be written")
    }

    /// The scenario with all keys.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a scenario has string keys and plain values")
    }

    /// The tick at which the run ends at the latest.
    #[must_use]
    pub fn duration_ticks(&self) -> Tick {
        Tick(libm::round(self.duration_s / Tick::TICK_S) as u64)
    }

    /// The seed of the map.
    #[must_use]
    pub fn map_seed(&self) -> u64 {
        self.map.seed.unwrap_or(self.seed)
    }

    fn check(&self, file: &str) -> Result<(), ScenarioError> {
        let checker = Checker { file };
        let ticks = self.duration_s / Tick::TICK_S;
        checker.require(
            "duration_s",
            self.duration_s,
            ticks >= 1.0 && ticks <= 1e10 && (ticks - libm::round(ticks)).abs() < 1e-6,
            "expected a multiple of 0.02 s, at least 0.02",
        )?;
        checker.positive("map.cell_m", self.map.cell_m)?;
        match (self.map.kind, self.map.size, &self.map.file) {
            (MapKind::File, None, Some(_)) | (MapKind::Spheres | MapKind::Noise, Some(_), None) => {}
            (MapKind::File, size, map_file) => {
                checker.require("map.file", format!("{map_file:?}"), map_file.is_some(), "a map of kind \"file\" needs a file")?;
                checker.require("map.size", format!("{size:?}"), false, "a map from a file has the size of the file: leave the key out")?;
            }
            (_, None, _) => checker.require("map.size", "nothing", false, "a generated map needs a size: a number or [x, y, z], in cells")?,
            (_, Some(_), map_file) => checker.require("map.file", format!("{map_file:?}"), false, "only a map of kind \"file\" has a file")?,
        }
        checker.require(
            "agents.count",
            self.agents.count,
            (1..=AGENTS_MAX).contains(&self.agents.count),
            &format!("expected 1 to {AGENTS_MAX}"),
        )?;
        let body = &self.body;
        for (key, value) in [
            ("body.radius_m", body.radius_m),
            ("body.speed_max_m_s", body.speed_max_m_s),
            ("body.acceleration_m_s2", body.acceleration_m_s2),
            ("body.deceleration_m_s2", body.deceleration_m_s2),
            ("body.turn_rate_max_rad_s", body.turn_rate_max_rad_s),
            ("body.turn_acceleration_rad_s2", body.turn_acceleration_rad_s2),
            ("body.turn_deceleration_rad_s2", body.turn_deceleration_rad_s2),
        ] {
            checker.positive(key, value)?;
        }
        checker.require(
            "lidar.rays",
            self.lidar.rays,
            (1..=1_000_000).contains(&self.lidar.rays),
            "expected 1 to 1000000",
        )?;
        checker.require(
            "lidar.shell_radius_cells",
            self.lidar.shell_radius_cells,
            (1..=200).contains(&self.lidar.shell_radius_cells),
            "expected 1 to 200",
        )?;
        checker.require(
            "lidar.range_m",
            self.lidar.range_m,
            self.lidar.range_m > 0.0,
            "expected a positive number, or inf",
        )?;
        checker.require(
            "lidar.fov_rad",
            self.lidar.fov_rad,
            self.lidar.fov_rad > 0.0 && self.lidar.fov_rad <= TAU,
            "expected more than 0 and at most 2 pi (6.283185307179586)",
        )?;
        checker.require(
            "lidar.period_ticks",
            self.lidar.period_ticks,
            self.lidar.period_ticks >= 1,
            "expected at least 1",
        )?;
        checker.require(
            "communication.range_m",
            self.communication.range_m,
            self.communication.range_m >= 0.0,
            "expected at least 0, or inf",
        )?;
        checker.require(
            "execution.threads",
            self.execution.threads,
            self.execution.threads <= 1024,
            "expected 0 to 1024",
        )?;
        checker.positive("execution.join_timeout_s", self.execution.join_timeout_s)?;
        checker.positive(
            "execution.decision_timeout_s",
            self.execution.decision_timeout_s,
        )?;
        if let Rtf::Limit(limit) = self.execution.rtf {
            checker.positive("execution.rtf", limit)?;
        }
        Ok(())
    }
}

struct Checker<'a> {
    file: &'a str,
}

impl Checker<'_> {
    fn require(
        &self,
        key: &'static str,
        value: impl ToString,
        holds: bool,
        allowed: &str,
    ) -> Result<(), ScenarioError> {
        if holds {
            return Ok(());
        }
        Err(ScenarioError::Value {
            file: self.file.to_owned(),
            key,
            value: value.to_string(),
            allowed: allowed.to_owned(),
        })
    }

    fn positive(&self, key: &'static str, value: f64) -> Result<(), ScenarioError> {
        self.require(
            key,
            value,
            value.is_finite() && value > 0.0 && value <= 1e6,
            "expected a number above 0 and at most 1e6",
        )
    }
}

/// Sets a dotted key; tables on the way are made.
fn set_key(table: &mut toml::Table, key: &str, value: toml::Value) -> Result<(), String> {
    let (path, last) = match key.rsplit_once('.') {
        Some((path, last)) => (Some(path), last),
        None => (None, key),
    };
    let mut place = table;
    for part in path.into_iter().flat_map(|path| path.split('.')) {
        place = place
            .entry(part)
            .or_insert_with(|| toml::Value::Table(toml::Table::new()))
            .as_table_mut()
            .ok_or_else(|| format!("`{part}` in `{key}` is not a table"))?;
    }
    place.insert(last.to_owned(), value);
    Ok(())
}

fn one_line(text: &str) -> String {
    text.split('\n').map(str::trim).collect::<Vec<_>>().join("; ")
}

fn yes() -> bool {
    true
}

fn one() -> f64 {
    1.0
}

fn rbw() -> String {
    "rbw".to_owned()
}

fn nearest_origin() -> SpawnSpec {
    SpawnSpec::NearestOrigin { yaw_rad: 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "seed = 7\nduration_s = 60.0\n[map]\nkind = \"spheres\"\nsize = 50\n[agents]\ncount = 3\n";

    fn set(key: &str, value: impl Into<toml::Value>) -> Override {
        Override {
            origin: format!("--set {key}"),
            key: key.to_owned(),
            value: value.into(),
        }
    }

    #[test]
    fn what_is_left_out_is_the_reference() {
        let scenario = Scenario::parse("s.toml", SMALL, &[]).unwrap();
        assert_eq!(scenario.lidar.rays, 5124);
        assert_eq!(scenario.body.radius_m, 0.4);
        assert_eq!(scenario.duration_ticks(), Tick(3000));
        assert_eq!(scenario.map_seed(), 7);
    }

    #[test]
    fn the_identity_reads_back_and_leaves_the_execution_out() {
        let text = format!("{SMALL}[execution]\nthreads = 3\n");
        let one = Scenario::parse("s.toml", SMALL, &[]).unwrap();
        let other = Scenario::parse("s.toml", &text, &[]).unwrap();
        assert_ne!(one, other);
        assert_eq!(one.identity(), other.identity());
        assert_eq!(
            Scenario::parse("identity", &one.identity(), &[]).unwrap(),
            one
        );
        assert_eq!(
            Scenario::parse("all", &other.to_toml(), &[]).unwrap(),
            other
        );
    }

    #[test]
    fn overrides_set_keys() {
        let overrides = [
            set("agents.count", 5),
            set("map.size", 30),
            set("execution.rtf", 2.0),
            set("lidar.range_m", f64::INFINITY),
        ];
        let scenario = Scenario::parse("s.toml", SMALL, &overrides).unwrap();
        assert_eq!(scenario.agents.count, 5);
        assert_eq!(scenario.map.size, Some(Size::Cube(30)));
        assert_eq!(scenario.execution.rtf, Rtf::Limit(2.0));
    }

    #[track_caller]
    fn refuses(text: &str, overrides: &[Override], expected: &str) {
        let error = Scenario::parse("s.toml", text, overrides)
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{error}");
        assert!(!error.contains('\n'), "{error}");
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        refuses("seed = ", &[], "s.toml:1:");
        refuses(&SMALL.replace("count", "cuont"), &[], "s.toml:7:1: unknown field `cuont`");
        refuses(&SMALL.replace("seed = 7\n", ""), &[], "missing field `seed`");
        refuses(&SMALL.replace("60.0", "0.03"), &[], "s.toml: duration_s = 0.03: expected a multiple of 0.02 s");
        refuses(&SMALL.replace("size = 50", ""), &[], "map.size");
        refuses(SMALL, &[set("agents.count", 0)], "agents.count = 0: expected 1 to 1000");
        refuses(SMALL, &[set("agents.cuont", 1)], "--set agents.cuont: unknown field `cuont`");
        refuses(SMALL, &[set("seed.x", 1)], "--set seed.x: `seed` in `seed.x` is not a table");
        refuses(SMALL, &[set("execution.rtf", "fast")], "--set execution.rtf");
        refuses(SMALL, &[set("lidar.fov_rad", 7.0)], "lidar.fov_rad = 7");
        refuses(SMALL, &[set("lidar.range_m", f64::NAN)], "lidar.range_m = NaN");
        refuses(SMALL, &[set("map.file", "x.m3dm")], "map.file");
    }
}
