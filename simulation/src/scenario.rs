//! The scenario: a TOML file with everything that determines a run.
//!
//! A [`Scenario`] is parsed once and checked, so every value of this type is legal. Two tables
//! stand apart: `[execution]` sets threads, real-time factor and timeouts, and `[views]` the
//! visualisation topics. Neither can change the result of a run, so neither is part of its
//! identity.
//!
//! The keys are declared in [`keys`]. This module reads no map files and knows no command line;
//! flags arrive as [`Override`]s of keys.

mod base_stations;
mod bodies;
mod changes;
mod diagnosis;
mod energy;
pub mod events;
mod filled_in;
pub mod keys;
mod lidar;
mod lidars;
mod localisation;
mod mix;
mod obstacles;
mod origin;
mod radio;
mod sections;
mod sensor;
pub mod team;
mod views;

use std::collections::{BTreeMap, BTreeSet};

use mapgen::import_options::OptionError;
use msgs::ids::{AgentId, Tick};
use protocol::body_model::{BodyKind, BodyModel};
use protocol::limits::BODIES_MAX;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use world::spawn::SpawnSpec;

use changes::{Change, Refusal};

pub use bodies::BodyEntry;
pub use diagnosis::unknown_key;
pub use energy::EnergySection;
pub use events::{EventAction, EventEntry, EventKind, ScheduledEvent};
pub use lidar::{GridKeys, LidarPattern, LidarSchedule, LidarSection};
pub use lidars::{LidarEntry, ScanTiming};
pub use localisation::LocalisationSection;
pub use mix::{ControllerChoice, MixEntry};
pub use obstacles::{ObstacleEntry, ObstacleKind};
pub use origin::{Origins, syntax_text};
pub use radio::{CommunicationModel, CommunicationSection, RelaySection};
pub use sections::*;
pub use sensor::SensorSection;
pub use views::{PointsField, RecordedView, ViewsSection};

/// Largest team. DDS discovers 120 participants on one host, and a process may hold several agents.
pub const AGENTS_MAX: u32 = 1000;

/// Longest text of a scenario, bytes; the most events there may be need less.
pub const SCENARIO_BYTES_MAX: usize = 1 << 20;

/// Most tables that the text of a scenario may have, counted by the characters that can begin one
/// (`{`, `[` and `.`): a table of few bytes takes more than a kilobyte of memory.
pub const TABLES_MAX: usize = 1 << 17;

/// Largest radius of a body, in cells: collision checks visit every cell that a motion may touch.
const BODY_CELLS_MAX: f64 = 16.0;

/// Smallest radius of a body, in cells: below it, rounding decides whether it touches a wall.
const BODY_CELLS_MIN: f64 = 1e-3;

/// What ends a run before its duration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopRule {
    /// Every free cell has been seen.
    Explored,
    /// A body has been in every free cell.
    Covered,
    /// The team has come back to its bases for good.
    Back,
    /// A base station knows all that the team can see.
    KnownAtBase,
    /// Nothing.
    Duration,
}

/// Everything that determines a run. The keys are described in docs/scenario.md.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Seed of all random streams, unless `map.seed` or `spawn.seed` is given.
    #[serde(deserialize_with = "sections::seed")]
    pub seed: u64,
    /// Sim time after which the run ends, seconds; a whole number of fixed updates.
    pub duration_s: f64,
    /// Whether the run ends once every free cell has been seen.
    #[serde(default = "yes")]
    pub stop_when_explored: bool,
    /// Whether the run ends once a body has been in every free cell; full exploration does not end
    /// it then.
    #[serde(default, skip_serializing_if = "is_no")]
    pub stop_when_covered: bool,
    /// Whether the run ends once the team has come back to its bases for good; full exploration and
    /// coverage do not end it then.
    #[serde(default, skip_serializing_if = "is_no")]
    pub stop_when_back: bool,
    /// Whether the run ends once a base station knows all that the team can see; full exploration
    /// and coverage do not end it then.
    #[serde(default, skip_serializing_if = "is_no")]
    pub stop_when_known_at_base: bool,
    /// The terrain.
    pub map: MapSection,
    /// The team.
    pub agents: AgentsSection,
    /// Where the agents start.
    #[serde(default = "nearest_origin")]
    pub spawn: SpawnSpec,
    /// The body of every agent without an entry in `bodies`.
    #[serde(default)]
    pub body: BodyModel,
    /// Other bodies of some agents.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<BodyEntry>,
    /// The LiDAR of every agent; `None` with `lidars`, and given once the scenario is parsed
    /// without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lidar: Option<LidarSection>,
    /// Several LiDARs, of all agents or of some; `None` with `lidar`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lidars: Option<Vec<LidarEntry>>,
    /// The radios.
    #[serde(default)]
    pub communication: CommunicationSection,
    /// Sensor noise.
    #[serde(default, skip_serializing_if = "radio::is_default")]
    pub sensor: SensorSection,
    /// Noise and biases of odometry.
    #[serde(default, skip_serializing_if = "radio::is_default")]
    pub localisation: LocalisationSection,
    /// Batteries and bases; `None`: bodies need no energy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub energy: Option<EnergySection>,
    /// Content of the recording beside the protocol.
    #[serde(default)]
    pub recording: RecordingSection,
    /// Reaction to the loss of an agent.
    #[serde(default)]
    pub faults: FaultsSection,
    /// What happens at set times.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub event: Vec<EventEntry>,
    /// Obstacles that move on given paths.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacle: Vec<ObstacleEntry>,
    /// Visualisation topics.
    #[serde(default)]
    pub views: ViewsSection,
    /// Threads, real-time factor and timeouts.
    #[serde(default)]
    pub execution: ExecutionSection,
}

/// A key that the command line sets, such as `agents.count = 5`, or removes.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// The flag as typed, for error messages.
    pub origin: String,
    /// Dotted path of the key.
    pub key: String,
    /// The new value; `None` removes the key.
    pub value: Option<toml::Value>,
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
    /// An override names no key, or its value has another type.
    #[error("{origin}: {reason}")]
    Override {
        /// The flag as typed.
        origin: String,
        /// What is wrong.
        reason: String,
    },
    /// A value is out of range, or contradicts another one.
    #[error("{origin}: {key} = {value}: {allowed}")]
    Value {
        /// What set the key: the flag as typed, or the file with the line.
        origin: String,
        /// Dotted path of the key.
        key: String,
        /// The value.
        value: String,
        /// What is allowed.
        allowed: String,
    },
}

impl Scenario {
    /// Parses a scenario, sets the overridden keys, and checks the whole. `file` is the name for
    /// error messages.
    ///
    /// # Errors
    /// If the text or an override does not fit, or a value is out of range.
    pub fn parse(file: &str, text: &str, overrides: &[Override]) -> Result<Self, ScenarioError> {
        check_size(file, text)?;
        let origins = Origins::new(file, text, overrides);
        let mut scenario: Self = toml::from_str(text).map_err(|error| origins.syntax(&error))?;
        if !overrides.is_empty() {
            let keys: toml::Table = toml::from_str(text).map_err(|error| origins.syntax(&error))?;
            let refused = |refusal| refused_override(overrides, refusal);
            scenario = changes::changed(&keys, &changes_of(overrides), &mut 0).map_err(refused)?;
        }
        scenario.complete_bodies();
        scenario.complete_lidars();
        if scenario.map.kind == MapKind::Building {
            scenario.map.building.get_or_insert_default();
        }
        if scenario.map.kind == MapKind::Mine {
            scenario.map.mine.get_or_insert_default();
        }
        if scenario.map.kind == MapKind::Scene {
            scenario.map.scene.get_or_insert_default();
        }
        if scenario.map.kind != MapKind::File {
            scenario.map.cell_m.get_or_insert(1.0);
        }
        scenario.check(&origins)?;
        Ok(scenario)
    }

    /// The keys of a text after overrides, without those that are filled in: what is given of a
    /// scenario that [`Self::parse`] reads of both.
    ///
    /// # Errors
    /// If the text is no TOML, or an override cannot be made.
    pub fn given(file: &str, text: &str, overrides: &[Override]) -> Result<toml::Table, ScenarioError> {
        let keys = toml::from_str(text).map_err(|error| Origins::new(file, text, overrides).syntax(&error))?;
        let refused = |refusal| refused_override(overrides, refusal);
        changes::keys_after(&keys, &changes_of(overrides)).map_err(refused)
    }

    /// The scenario as a recording holds it: all keys, without `[views]` and `[execution]`.
    ///
    /// # Panics
    /// Never: its keys are strings and its values plain.
    #[must_use]
    pub fn identity(&self) -> String {
        let mut table = toml::Table::try_from(self).expect("a scenario has string keys and plain values");
        table.remove("execution");
        table.remove("views");
        toml::to_string(&table).expect("a table can be written")
    }

    /// The scenario with all keys, also those of later formats that have their defaults, which
    /// [`Self::to_toml`] leaves out.
    ///
    /// # Panics
    /// Never: its keys are strings and its values plain.
    #[must_use]
    pub fn to_complete(&self) -> toml::Table {
        let mut table = toml::Table::try_from(self).expect("a scenario has string keys and plain values");
        keys::complete(&mut table);
        table
    }

    /// The scenario with the keys of the first format, and those of later ones that differ from
    /// their defaults: so an older scenario keeps its text.
    ///
    /// # Panics
    /// Never: its keys are strings and its values plain.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a scenario has string keys and plain values")
    }

    /// The externally controlled agents, which run no controller.
    #[must_use]
    pub fn teleoperated(&self) -> BTreeSet<AgentId> {
        self.agents.cmd_vel.iter().map(|&id| AgentId(id)).collect()
    }

    /// The agents whose processes do not sign what they send: the externally controlled ones, and
    /// those of a program that does not.
    #[must_use]
    pub fn third_party(&self) -> BTreeSet<AgentId> {
        let with_own_command = self.agents.with_own_command().filter(|_| !self.agents.command_signs);
        with_own_command.chain(self.agents.cmd_vel.iter().copied()).map(AgentId).collect()
    }

    /// What ends the run before its duration.
    #[must_use]
    pub fn stop_rule(&self) -> StopRule {
        match self {
            Self { stop_when_back: true, .. } => StopRule::Back,
            Self { stop_when_known_at_base: true, .. } => StopRule::KnownAtBase,
            Self { stop_when_covered: true, .. } => StopRule::Covered,
            Self { stop_when_explored: true, .. } => StopRule::Explored,
            _ => StopRule::Duration,
        }
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

    /// Checks all values. As long as the length of a cell is left to a map file, what depends on it
    /// is not checked.
    ///
    /// # Errors
    /// [`ScenarioError::Value`], with the origin of the value.
    ///
    /// # Panics
    /// Never: a scenario has string keys and plain values.
    pub fn check(&self, origins: &Origins<'_>) -> Result<(), ScenarioError> {
        let checker = Checker { origins };
        let values = toml::Table::try_from(self).expect("a scenario has string keys and plain values");
        if let Some((key, value, expected)) = keys::first_out_of_range(&values) {
            checker.require(&key, value, false, &expected)?;
        }
        let ticks = self.duration_s / Tick::TICK_S;
        checker.require(
            "duration_s",
            self.duration_s,
            (1.0..=1e10).contains(&ticks) && (ticks - libm::round(ticks)).abs() < 1e-6,
            "expected a multiple of 0.02 s, 0.02 to 2e8",
        )?;
        if let Err(OptionError { name, value, allowed }) = self.map.import.check() {
            checker.require(&format!("map.import.{name}"), value, false, &format!("expected {allowed}"))?;
        }
        self.check_map_source(&checker)?;
        self.agents.check(&checker)?;
        self.agents.check_mix(&checker)?;
        self.check_base_stations(&checker)?;
        self.check_bodies(&checker)?;
        self.check_lidars(&checker)?;
        self.communication.check(&checker)?;
        self.check_energy(&checker)?;
        self.check_views(&checker)?;
        self.check_obstacles(&checker)?;
        self.check_events(&checker)?;
        if let SpawnSpec::Box { low, high, .. } = &self.spawn {
            let holds = low.iter().zip(high).all(|(low, high)| low.is_finite() && high.is_finite() && low <= high);
            let allowed = format!("expected finite numbers, none of them below spawn.low = {low:?}");
            checker.require("spawn.high", format!("{high:?}"), holds, &allowed)?;
        }
        Ok(())
    }

    /// A generated map needs a size and no file; a map from a file, the contrary.
    fn check_map_source(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let needs = |key: &str, allowed: &str| {
            Err(checker.error_from("map.kind", key, "nothing", &format!("{allowed}, or another map.kind")))
        };
        match (self.map.kind, self.map.size, &self.map.file) {
            (MapKind::File, None, None) => {
                needs("map.file", "a map of kind \"file\" needs a file, for example cave.m3dm")
            }
            (MapKind::File, Some(size), _) => checker.require(
                "map.size",
                format!("{:?}", size.cells()),
                false,
                "a map from a file has the size of the file: leave this key out",
            ),
            (MapKind::Spheres | MapKind::Noise | MapKind::Building | MapKind::Mine | MapKind::Scene, None, _) => {
                needs("map.size", "a generated map needs a size: a number or [x, y, z], in cells")
            }
            (
                MapKind::Spheres | MapKind::Noise | MapKind::Building | MapKind::Mine | MapKind::Scene,
                Some(_),
                Some(file),
            ) => checker.require("map.file", file.display(), false, "only a map of kind \"file\" has a file"),
            _ => Ok(()),
        }
    }

    fn check_bodies(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        self.check_body(checker, "body", &self.body)?;
        checker.require(
            "bodies",
            format!("{} entries", self.bodies.len()),
            self.bodies.len() < BODIES_MAX,
            &format!("expected at most {}", BODIES_MAX - 1),
        )?;
        let last = self.agents.count - 1;
        let mut entry_of: BTreeMap<u32, usize> = BTreeMap::new();
        for (number, entry) in self.bodies.iter().enumerate() {
            let key = format!("bodies[{number}]");
            let agents = format!("{key}.agents");
            checker.require(&agents, "[]", !entry.agents.is_empty(), "expected at least one id of an agent")?;
            for &id in &entry.agents {
                checker.require(&agents, id, id <= last, &format!("expected ids of agents, 0 to {last}"))?;
                if let Some(other) = entry_of.insert(id, number) {
                    let allowed = format!("expected each agent once, and it is in bodies[{other}] already");
                    checker.require(&agents, id, false, &allowed)?;
                }
            }
            self.check_body(checker, &key, &entry.keys.over(&self.body))?;
        }
        Ok(())
    }

    /// What depends on the length of a cell; with a map file that is to say it, checked once it is
    /// known.
    fn check_body(&self, checker: &Checker<'_>, table: &str, body: &BodyModel) -> Result<(), ScenarioError> {
        let usual = BodyModel::default();
        for (key, value, is_usual) in [
            ("drive", format!("{:?}", body.drive).to_lowercase(), body.drive == usual.drive),
            ("step_max_m", body.step_max_m.to_string(), body.step_max_m == usual.step_max_m),
            ("slope_max_rad", body.slope_max_rad.to_string(), body.slope_max_rad == usual.slope_max_rad),
        ] {
            let allowed = "only a body of kind \"ground\" has this key";
            checker.require(&format!("{table}.{key}"), value, body.kind == BodyKind::Ground || is_usual, allowed)?;
        }
        let Some(cell_m) = self.map.cell_m else { return Ok(()) };
        checker.require(
            &format!("{table}.radius_m"),
            body.radius_m,
            (BODY_CELLS_MIN..=BODY_CELLS_MAX).contains(&(body.radius_m / cell_m)),
            &format!(
                "expected at least a thousandth of a cell and at most the length of 16 cells, here {} to {} m",
                BODY_CELLS_MIN * cell_m,
                BODY_CELLS_MAX * cell_m
            ),
        )?;
        checker.require(
            &format!("{table}.step_max_m"),
            body.step_max_m,
            body.step_max_m / cell_m <= BODY_CELLS_MAX,
            &format!("expected at most the height of 16 cells, here {} m", BODY_CELLS_MAX * cell_m),
        )?;
        checker.require(
            &format!("{table}.speed_max_m_s"),
            body.speed_max_m_s,
            body.speed_max_m_s * Tick::TICK_S <= cell_m,
            &format!("expected at most one cell in a tick: 50 cells in a second, here {} m/s", cell_m / Tick::TICK_S),
        )
    }
}

fn changes_of(overrides: &[Override]) -> Vec<Change<'_>> {
    overrides.iter().map(|change| (change.key.as_str(), change.value.as_ref())).collect()
}

fn refused_override(overrides: &[Override], refusal: Refusal) -> ScenarioError {
    match refusal {
        Refusal::Key(number, reason) => ScenarioError::Override { origin: one_line(&overrides[number].origin), reason },
        Refusal::Scenario(number, keys, error) => Origins::unfit(&overrides[number], &keys, &error),
    }
}

/// Refuses a text that would take more time or memory than a scenario is worth.
fn check_size(file: &str, text: &str) -> Result<(), ScenarioError> {
    let refused = |reason: String| ScenarioError::Syntax { file: file.to_owned(), line: 1, column: 1, reason };
    if text.len() > SCENARIO_BYTES_MAX {
        let length = text.len();
        return Err(refused(format!("{length} bytes: expected a scenario of at most {SCENARIO_BYTES_MAX} bytes")));
    }
    let tables = text.bytes().filter(|byte| b"{[.".contains(byte)).count();
    if tables > TABLES_MAX {
        let expected = format!("expected a scenario with at most {TABLES_MAX} tables, lists and dotted keys");
        return Err(refused(format!("{tables} of the characters {{ [ and . that begin them: {expected}")));
    }
    Ok(())
}

struct Checker<'a> {
    origins: &'a Origins<'a>,
}

impl Checker<'_> {
    fn require(&self, key: &str, value: impl ToString, holds: bool, allowed: &str) -> Result<(), ScenarioError> {
        if holds { Ok(()) } else { Err(self.error_from(key, key, value, allowed)) }
    }

    /// The error of a key whose value the value of another key, `cause`, forbids.
    fn error_from(&self, cause: &str, key: &str, value: impl ToString, allowed: &str) -> ScenarioError {
        ScenarioError::Value {
            origin: self.origins.of(cause),
            key: key.to_owned(),
            value: one_line(&value.to_string()),
            allowed: allowed.to_owned(),
        }
    }
}

/// A text without line breaks, for errors, which are one line whatever a file holds.
#[must_use]
pub fn one_line(text: &str) -> String {
    text.split('\n').map(str::trim).collect::<Vec<_>>().join("; ")
}

fn yes() -> bool {
    true
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands out references")]
fn is_no(value: &bool) -> bool {
    !value
}

fn nearest_origin() -> SpawnSpec {
    SpawnSpec::NearestOrigin { yaw_rad: 0.0 }
}

#[cfg(test)]
mod tests;
