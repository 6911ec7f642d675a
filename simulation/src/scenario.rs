//! The scenario: everything that determines a run, as a TOML file that says it.
//!
//! Parsed once and checked; whoever holds a [`Scenario`] holds a legal one. Two tables stand apart: `[execution]` says how a run
//! is carried out (threads, pacing, time-outs) and `[views]` what is shown of it. They can never change its result, so they are
//! not part of its identity.
//!
//! This module reads no map files and knows no command line; flags arrive as [`Override`]s of keys.

mod bodies;
mod radio;
mod sections;
mod sensor;

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

use msgs::body_model::BodyModel;
use msgs::ids::{AgentId, Tick};
use msgs::limits::BODIES_MAX;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::world::spawn::SpawnSpec;

pub use bodies::BodyEntry;
pub use radio::{CommunicationModel, CommunicationSection, RelaySection};
pub use sections::*;
pub use sensor::SensorSection;

/// Agents a run may have at the most: the participants that DDS finds on one host (120) leave room for no more processes, and
/// several agents may share one.
pub const AGENTS_MAX: u32 = 1000;

/// Radius of a body in cells at the most: what a motion may touch is looked for cell by cell.
const BODY_CELLS_MAX: f64 = 16.0;

/// Radius of a body in cells at the least: below it, rounding decides whether it touches a wall.
const BODY_CELLS_MIN: f64 = 1e-3;

/// A run. See docs/scenario.md for the keys.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Seed of everything random: the map (unless `map.seed` is given) and the agents.
    #[serde(deserialize_with = "sections::seed")]
    pub seed: u64,
    /// Sim time after which the run ends, seconds; a whole number of fixed updates.
    pub duration_s: f64,
    /// Whether the run ends once every free cell has been seen.
    #[serde(default = "yes")]
    pub stop_when_explored: bool,
    /// Whether the run ends once a body has been in every free cell, and not before because all has been seen.
    #[serde(default, skip_serializing_if = "is_no")]
    pub stop_when_covered: bool,
    /// The terrain.
    pub map: MapSection,
    /// The team.
    pub agents: AgentsSection,
    /// Where the agents start.
    #[serde(default = "nearest_origin")]
    pub spawn: SpawnSpec,
    /// What bodies can do.
    #[serde(default)]
    pub body: BodyModel,
    /// What those of some agents can do instead.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<BodyEntry>,
    /// What LiDARs see.
    #[serde(default)]
    pub lidar: LidarSection,
    /// How agents communicate.
    #[serde(default)]
    pub communication: CommunicationSection,
    /// How agents err.
    #[serde(default, skip_serializing_if = "radio::is_default")]
    pub sensor: SensorSection,
    /// What a recording holds beside the protocol.
    #[serde(default)]
    pub recording: RecordingSection,
    /// What happens when an agent fails.
    #[serde(default)]
    pub faults: FaultsSection,
    /// What is shown of the run.
    #[serde(default)]
    pub views: ViewsSection,
    /// How the run is carried out.
    #[serde(default)]
    pub execution: ExecutionSection,
}

/// A key of the scenario that the command line sets, such as `agents.count = 5`, or takes out.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// What the user typed, for error messages.
    pub origin: String,
    /// Dotted path of the key.
    pub key: String,
    /// The new value; `None`: the key is left out.
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
        key: String,
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
                let unfit = |reason: String| ScenarioError::Override { origin: one_line(&change.origin), reason };
                change_key(&mut table, &change.key, change.value.clone()).map_err(unfit)?;
                scenario =
                    table.clone().try_into().map_err(|error: toml::de::Error| unfit(one_line(error.message())))?;
            }
        }
        scenario.complete_bodies();
        if scenario.map.kind == MapKind::Building {
            scenario.map.building.get_or_insert_default();
        }
        if scenario.map.kind != MapKind::File {
            scenario.map.cell_m.get_or_insert(1.0);
        }
        scenario.check(file)?;
        Ok(scenario)
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

    /// The scenario with all keys.
    ///
    /// # Panics
    /// Never: its keys are strings and its values plain.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a scenario has string keys and plain values")
    }

    /// The agents that are driven by standard messages.
    #[must_use]
    pub fn driven(&self) -> BTreeSet<AgentId> {
        self.agents.cmd_vel.iter().map(|&id| AgentId(id)).collect()
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

    /// Whether all values are legal. What hangs on the length of a cell is not looked at as long as that is left to a map file.
    ///
    /// # Errors
    /// [`ScenarioError::Value`]; `file` is the name of the scenario in it.
    pub fn check(&self, file: &str) -> Result<(), ScenarioError> {
        let checker = Checker { file };
        let ticks = self.duration_s / Tick::TICK_S;
        checker.require(
            "duration_s",
            self.duration_s,
            (1.0..=1e10).contains(&ticks) && (ticks - libm::round(ticks)).abs() < 1e-6,
            "expected a multiple of 0.02 s, at least 0.02",
        )?;
        if let Some(cell_m) = self.map.cell_m {
            checker.positive("map.cell_m", cell_m)?;
        }
        if let Err(error) = self.map.import.check() {
            checker.require("map.import", error, false, "see docs/maps.md")?;
        }
        match (self.map.kind, self.map.size, &self.map.file) {
            (MapKind::File, None, Some(_)) | (MapKind::Spheres | MapKind::Noise | MapKind::Building, Some(_), None) => {
            }
            (MapKind::File, size, map_file) => {
                checker.require(
                    "map.file",
                    "nothing",
                    map_file.is_some(),
                    "a map of kind \"file\" needs a file, for example cave.m3dm",
                )?;
                let size = size.map_or("nothing".to_owned(), |size| format!("{:?}", size.cells()));
                checker.require(
                    "map.size",
                    size,
                    false,
                    "a map from a file has the size of the file: leave this key out",
                )?;
            }
            (_, None, _) => checker.require(
                "map.size",
                "nothing",
                false,
                "a generated map needs a size: a number or [x, y, z], in cells",
            )?,
            (_, Some(_), map_file) => {
                let file = map_file.as_ref().map_or("nothing".to_owned(), |file| file.display().to_string());
                checker.require("map.file", file, false, "only a map of kind \"file\" has a file")?
            }
        }
        checker.require(
            "agents.count",
            self.agents.count,
            (1..=AGENTS_MAX).contains(&self.agents.count),
            &format!("expected 1 to {AGENTS_MAX}"),
        )?;
        let Self { agents: AgentsSection { count, cmd_vel, .. }, .. } = self;
        for (place, &id) in cmd_vel.iter().enumerate() {
            checker.require(
                "agents.cmd_vel",
                id,
                id < *count,
                &format!("expected ids of agents, 0 to {}", count - 1),
            )?;
            checker.require("agents.cmd_vel", id, !cmd_vel[..place].contains(&id), "expected each id once")?;
        }
        self.check_bodies(&checker)?;
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
        self.communication.check(&checker)?;
        self.sensor.check(&checker)?;
        checker.require(
            "execution.threads",
            self.execution.threads,
            self.execution.threads <= 1024,
            "expected 0 to 1024",
        )?;
        checker.positive("execution.join_timeout_s", self.execution.join_timeout_s)?;
        checker.positive("execution.decision_timeout_s", self.execution.decision_timeout_s)?;
        checker.require(
            "views.max_hz",
            self.views.max_hz,
            (0.1..=1000.0).contains(&self.views.max_hz),
            "expected 0.1 to 1000",
        )?;
        for (key, ticks) in self.views.periods() {
            checker.require(key, ticks, ticks >= 1, "expected at least 1")?;
        }
        if let Rtf::Limit(limit) = self.execution.rtf {
            checker.require("execution.rtf", limit, (1e-3..=1e6).contains(&limit), "expected 0.001 to 1e6, or max")?;
        }
        check_spawn(&checker, &self.spawn)
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

    fn check_body(&self, checker: &Checker<'_>, table: &str, body: &BodyModel) -> Result<(), ScenarioError> {
        for (key, value) in body.numbers() {
            checker.positive(&format!("{table}.{key}"), value)?;
        }
        // Of a map file whose cells are not known yet, this is looked at when they are.
        let Some(cell_m) = self.map.cell_m else { return Ok(()) };
        checker.require(
            &format!("{table}.radius_m"),
            body.radius_m,
            (BODY_CELLS_MIN..=BODY_CELLS_MAX).contains(&(body.radius_m / cell_m)),
            "expected at least a thousandth of a cell and at most the length of 16 cells",
        )?;
        checker.require(
            &format!("{table}.speed_max_m_s"),
            body.speed_max_m_s,
            body.speed_max_m_s * Tick::TICK_S <= cell_m,
            "expected at most one cell in a tick: the length of 50 cells in a second",
        )
    }
}

fn check_spawn(checker: &Checker<'_>, spawn: &SpawnSpec) -> Result<(), ScenarioError> {
    let yaw_rad = match spawn {
        SpawnSpec::NearestOrigin { yaw_rad } => *yaw_rad,
        SpawnSpec::Scattered { min_distance_m, yaw_rad, .. } => {
            let holds = (0.0..=1e6).contains(min_distance_m);
            checker.require("spawn.min_distance_m", min_distance_m, holds, "expected 0 to 1e6")?;
            *yaw_rad
        }
        SpawnSpec::Box { low, high, yaw_rad } => {
            let holds = low.iter().zip(high).all(|(low, high)| low.is_finite() && high.is_finite() && low <= high);
            let allowed = format!("expected finite numbers, none of them below spawn.low = {low:?}");
            checker.require("spawn.high", format!("{high:?}"), holds, &allowed)?;
            *yaw_rad
        }
        SpawnSpec::List { .. } | SpawnSpec::Entrances {} => return Ok(()),
    };
    checker.require("spawn.yaw_rad", yaw_rad, yaw_rad.abs() <= TAU, "expected -2 pi to 2 pi")
}

struct Checker<'a> {
    file: &'a str,
}

impl Checker<'_> {
    fn require(&self, key: &str, value: impl ToString, holds: bool, allowed: &str) -> Result<(), ScenarioError> {
        if holds {
            return Ok(());
        }
        Err(ScenarioError::Value {
            file: self.file.to_owned(),
            key: key.to_owned(),
            value: one_line(&value.to_string()),
            allowed: allowed.to_owned(),
        })
    }

    fn positive(&self, key: &str, value: f64) -> Result<(), ScenarioError> {
        self.require(
            key,
            value,
            value.is_finite() && value > 0.0 && value <= 1e6,
            "expected a number above 0 and at most 1e6",
        )
    }
}

/// Sets a dotted key, or takes it out; tables on the way are made.
fn change_key(table: &mut toml::Table, key: &str, value: Option<toml::Value>) -> Result<(), String> {
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
    match value {
        Some(value) => place.insert(last.to_owned(), value),
        None => place.remove(last),
    };
    Ok(())
}

/// A text as part of an error, which is one line whatever stands in a file.
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
