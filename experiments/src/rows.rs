//! The record of a run: one row of metrics, and a time series over sim time.
//!
//! Everything except [`WallRow`] and [`RunMetadata`] is a function of scenario, seed and build. A
//! record is one file, `runs/<id>.json`; the tables of a plan are made from these files.

use std::collections::BTreeMap;

use msgs::ids::Tick;
use serde::{Deserialize, Serialize};
use simulation::end_reason::EndReason;

/// Sim time between two samples of a series, seconds.
pub const SAMPLE_PERIOD_S: f64 = 10.0;

/// The content of `runs/<id>.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredRun {
    pub row: RunRow,
    /// See [`RunRecord::series`].
    pub series: Vec<Sample>,
    /// Empty in folders of earlier builds.
    #[serde(default, skip_serializing_if = "RunMetadata::is_empty")]
    pub made: RunMetadata,
}

impl StoredRun {
    /// The record of a run with what is known about its execution.
    #[must_use]
    pub fn new(RunRecord { row, series }: RunRecord, made: RunMetadata) -> Self {
        Self { row, series, made }
    }

    /// The record, and what is known about its execution.
    #[must_use]
    pub fn split(self) -> (RunRecord, RunMetadata) {
        (RunRecord { row: self.row, series: self.series }, self.made)
    }
}

/// A run that has failed, the content of `failures/<id>.json`: what was planned, and why there is
/// no outcome.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailedRun {
    pub id: String,
    pub build: String,
    pub controller: String,
    pub seed: u64,
    /// Cells of the map along x, y and z; `None` for a map from a file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[u32; 3]>,
    pub agents: u32,
    pub axes: BTreeMap<String, String>,
    /// Maximum sim time of the run, s.
    pub duration_s: f64,
    /// One line.
    pub reason: String,
    pub made: RunMetadata,
}

impl FailedRun {
    /// The run as one among others: it has explored nothing until the end of the duration.
    #[must_use]
    pub fn into_stored(self) -> StoredRun {
        let Self { id, build, controller, seed, size, agents, axes, duration_s, reason, made } = self;
        let row = RunRow {
            id,
            build,
            controller,
            seed,
            size: size.unwrap_or_default(),
            agents,
            axes,
            duration_s,
            reason: EndReason::Failed(reason),
            ..RunRow::default()
        };
        StoredRun { row, series: Vec::new(), made }
    }
}

/// When and on which map a run was made.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunMetadata {
    /// The day on which it was executed, UTC, such as `2026-11-22`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date: Option<String>,
    /// See [`crate::plan::PlannedRun::map`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<String>,
}

impl RunMetadata {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// The metrics of a run, and their course.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    pub row: RunRow,
    /// Every [`SAMPLE_PERIOD_S`] from the start on, and at the end.
    pub series: Vec<Sample>,
}

/// The metrics of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRow {
    /// First 16 hexadecimal digits of the blake3 hash of scenario, seed and build.
    pub id: String,
    /// See [`crate::plan::BUILD`].
    pub build: String,
    pub controller: String,
    pub seed: u64,
    /// Cells of the map along x, y and z.
    pub size: [u32; 3],
    /// Size of the team.
    pub agents: u32,
    /// Key and value, as text, of every axis of the plan.
    pub axes: BTreeMap<String, String>,
    /// Maximum sim time of the run, s.
    pub duration_s: f64,
    /// Sim time at which it ended, s.
    pub end_s: f64,
    /// Why it ended, as in the result message.
    pub reason: EndReason,
    /// Free cells of the true map.
    pub free_cells: u64,
    /// Share of the free cells that the team has seen at the end.
    pub explored: f64,
    /// Volume of the free cells that the team has seen at the end, m^3; `None` in folders of
    /// earlier builds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explored_m3: Option<f64>,
    /// Share of the free cells that the team can see from where its bodies can be; `None` if one of
    /// them is not wider than a cell, and on large maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attainable: Option<f64>,
    /// Share of the free cells that bodies of the team have passed through.
    pub covered: f64,
    /// Share of the free cells on an agent's map at the end: mean over the agents.
    pub believed_mean: f64,
    /// Share of the free cells on an agent's map at the end: minimum over the agents.
    pub believed_min: f64,
    /// Sim time at which the team had seen 50 % of the free cells, s; `None` if it never had.
    pub t50_s: Option<f64>,
    /// Sim time at which the team had seen 90 % of the free cells, s.
    pub t90_s: Option<f64>,
    /// Sim time at which the team had seen 99 % of the free cells, s.
    pub t99_s: Option<f64>,
    /// Sim time at which the team had seen 99.9 % of the free cells, s.
    pub t99_9_s: Option<f64>,
    /// Sim time at which the team had seen all free cells, s.
    pub t100_s: Option<f64>,
    /// Mean of the explored share over the whole duration, 0 to 1; constant after the end.
    pub area_under_explored: f64,
    /// Path length, summed over the agents, m.
    pub distance_m: f64,
    /// Maximum path length of an agent, m.
    pub distance_max_m: f64,
    /// Cells seen by each agent itself, summed over the agents, divided by the cells seen by the
    /// team, minus 1.
    pub redundancy: f64,
    /// The part of it that agents had on their maps before they saw it; `None` if not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub redundancy_known: Option<f64>,
    /// The other part: what only others had seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub redundancy_unknown: Option<f64>,
    /// The redundancy after the first minute; `None` if the run was shorter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub redundancy_first_minute: Option<f64>,
    /// Sim time in which agents were on the way to viewpoints nearby, summed over the agents, s.
    /// See [`in_memory::stages`].
    #[serde(default)]
    pub exploring_s: f64,
    /// Sim time in which agents were on the way to frontiers that are not nearby, summed, s.
    #[serde(default)]
    pub relocating_s: f64,
    /// Sim time in which agents carried cells of their maps to other agents, summed, s.
    #[serde(default)]
    pub carrying_s: f64,
    /// Sim time in which agents had no goal, or kept out of the way of others, summed, s.
    #[serde(default)]
    pub waiting_s: f64,
    /// Coefficient of variation of the cells that each agent has seen itself.
    pub imbalance: f64,
    /// Share of the pairs of agents in contact: mean over the samples; 0 for one agent.
    pub contact_share: f64,
    /// Number of agent-to-agent messages delivered.
    pub messages: u64,
    /// Payload of the agent-to-agent messages delivered, bytes.
    pub message_bytes: u64,
    /// Payload of the agent-to-agent messages delivered by type of message, bytes.
    pub bytes_by_kind: BTreeMap<u8, u64>,
    /// Share of the cells seen by the team that an agent's map lacks: mean over agents and samples.
    pub staleness: f64,
    /// Number of committed replies of agents.
    pub decisions: u64,
    /// Number of collisions of bodies with walls and with each other.
    pub collisions: u64,
    /// Number of path searches without a path.
    pub search_failures: u64,
    /// Number of messages of agents that the server has refused.
    pub refusals: u64,
    pub digest: String,
    /// Present if the plan asks for it. Like the other metrics it is a function of the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub oracle: Option<OracleRow>,
    pub wall: WallRow,
}

/// A time of a row as the tick that it stands for: seconds have rounding errors, by which equal
/// times differ once they are subtracted or read again.
#[must_use]
pub fn ticks(time_s: f64) -> f64 {
    (time_s * 1e9 / Tick::TICK_NS as f64).round()
}

impl RunRow {
    /// Why the run has failed, which no record of a run has: the row then stands for a
    /// [`FailedRun`] among the others. It has explored nothing, and its other metrics have no
    /// meaning.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        match &self.reason {
            EndReason::Failed(reason) => Some(reason),
            _ => None,
        }
    }
}

/// Sim times at which the team had seen so many per cent of the free cells, s; `None` if it never
/// had.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Marks {
    pub t90_s: Option<f64>,
    pub t99_s: Option<f64>,
    pub t100_s: Option<f64>,
}

/// How fast a team with the map in hand could be. See [`crate::oracle`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OracleRow {
    /// No team is faster.
    pub bound: Marks,
    /// A plan that was flown.
    pub flown: Marks,
}

/// Figures of wall time, which differ between repetitions.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WallRow {
    /// Wall time of the run, s.
    pub wall_s: f64,
    /// Sim time divided by wall time.
    pub real_time_factor: f64,
    /// Median wall time of a decision, µs; `None` if not measured.
    pub decision_p50_us: Option<f64>,
    /// 95th percentile, µs.
    pub decision_p95_us: Option<f64>,
    /// 99th percentile, µs.
    pub decision_p99_us: Option<f64>,
    /// See [`crate::execute::machine`].
    pub machine: String,
}

/// The metrics of a run at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// Sim time, s.
    pub t_s: f64,
    /// See [`RunRow::explored`].
    pub explored: f64,
    /// See [`RunRow::covered`].
    pub covered: f64,
    /// See [`RunRow::believed_mean`].
    pub believed_mean: f64,
    /// See [`RunRow::distance_m`].
    pub distance_m: f64,
    /// See [`RunRow::message_bytes`].
    pub message_bytes: u64,
    /// Number of pairs of agents in contact.
    #[serde(default)]
    pub pairs_in_contact: u32,
    /// By agent id.
    #[serde(default)]
    pub agents: Vec<AgentSample>,
}

/// The metrics of an agent at one time. Shares are of the free cells of the true map, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentSample {
    /// Seen by the agent itself.
    pub explored: f64,
    /// Visited by the agent itself.
    pub covered: f64,
    /// On its map, as it has last reported.
    pub believed: f64,
    /// Path length, m.
    pub distance_m: f64,
}
