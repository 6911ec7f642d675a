//! The record of a run: one row of metrics, and a time series over sim time.
//!
//! Everything except [`WallRow`] and [`RunMetadata`] is a function of scenario, seed and build. A
//! record is one file, `runs/<id>.json`; the tables of a plan are made from these files.

use std::collections::BTreeMap;

use msgs::ids::Tick;
use serde::{Deserialize, Serialize};
use simulation::end_reason::EndReason;

use crate::columns::row;

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

row! {
    /// The metrics of a run: a row of `runs.csv`, and its columns in their order. Shares are of the
    /// free cells of the true map, 0 to 1.
    RunRow {
        id: String = "The run: 16 hexadecimal digits of the blake3 hash of all that its result depends on.";
        build: String = "Version and commit of the program that ran it.";
        controller: String = "Controllers of the team with their settings; of a fork `rbw, then lvd`.";
        seed: u64 = "Seed of the scenario.";
        size as "size_x, size_y, size_z": [u32; 3] = "Cells of the map along x, y and z.";
        agents: u32 = "Size of the team.";
        axes as "axis.<key>": BTreeMap<String, String> =
            "Value of each axis of the plan; also `axis.variant` and `axis.map.file`.";
        duration_s: f64 = "Maximum sim time of the run, s.";
        end_s: f64 = "Sim time at which it ended, s.";
        reason: EndReason =
            "Why it ended: `explored`, `nothing more can be seen`, `the team stands still`, `duration`, \
             or another reason.";
        free_cells: u64 = "Free cells of the true map.";
        explored: f64 = "Share that the team has seen at the end.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        explored_m3: Option<f64> =
            "Volume that the team has seen at the end, m^3; missing in folders of earlier builds.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        explored_m2: Option<f64> =
            "Area of the walls around what the team has seen at the end, m^2: of the faces between \
             seen cells and wall.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        attainable: Option<f64> =
            "Share that the team can see from where its bodies can be; missing if one of them fits \
             into a cell, and on maps of more than 2^24 cells.";
        covered: f64 = "Share that bodies of the team have passed through at the end.";
        believed_mean: f64 = "Share that is on an agent's map, as of its last command: mean over the agents.";
        believed_min: f64 = "Share that is on an agent's map: minimum over the agents.";
        t50_s: Option<f64> = "Sim time to 50 % of the free cells, s; missing if the team has not seen them.";
        t90_s: Option<f64> = "Sim time to 90 % of the free cells, s.";
        t99_s: Option<f64> = "Sim time to 99 % of the free cells, s.";
        t99_9_s: Option<f64> = "Sim time to 99.9 % of the free cells, s.";
        t100_s: Option<f64> = "Sim time to all free cells, s.";
        area_under_explored: f64 =
            "Mean of the explored share over the whole duration, 0 to 1; constant after the end.";
        distance_m: f64 = "Path length, summed over the agents, m.";
        distance_max_m: f64 = "Maximum path length of an agent, m.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        energy_j: Option<f64> = "Energy that all bodies have drawn, J; missing if bodies need none.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        energy_per_cell_j: Option<f64> = "Energy per free cell that the team has seen, J.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ran_empty: Option<u64> = "How often a body has run out of energy; missing if bodies need none.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        t_home_s: Option<f64> =
            "Sim time to the first tick in which the whole team rests in its bases and has seen 99 % of \
             the free cells, s.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        known_at_base: Option<f64> =
            "Share on the map of a base station at the end; missing without base stations.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        t_base_99_s: Option<f64> =
            "Sim time since which a base station knows 99 % of the free cells, s.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        position_error_m: Option<f64> =
            "Root mean square of the distance between believed and true positions (ATE), over agents and \
             time, m; missing if localisation is exact.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        map_off_by_1: Option<f64> =
            "Share of the cells on the maps of agents, from their own sensors, that are off by 1 cell.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        map_off_by_2: Option<f64> = "Share that is off by 2 cells.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        map_off_by_more: Option<f64> = "Share that is off by more than 2 cells.";
        redundancy: f64 =
            "Cells seen by each agent itself, summed over the agents, divided by the cells seen by \
             the team, minus 1.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        redundancy_known: Option<f64> =
            "Part of the redundancy that agents had on their maps before they saw it; missing over \
             ROS 2, where the agents' maps are not read.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        redundancy_unknown: Option<f64> =
            "Part of the redundancy that only other agents had seen; missing over ROS 2.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        redundancy_first_minute: Option<f64> = "Redundancy after 60 s; missing if the run was shorter.";
        #[serde(default)]
        exploring_s: f64 =
            "Sim time in which agents were on the way to viewpoints nearby, summed over the agents, \
             s.";
        #[serde(default)]
        relocating_s: f64 =
            "Sim time in which agents were on the way to frontiers that are not nearby, summed, s.";
        #[serde(default)]
        carrying_s: f64 = "Sim time in which agents carried cells of their maps to other agents, summed, s.";
        #[serde(default)]
        waiting_s: f64 = "Sim time in which agents had no goal, or kept out of the way of others, summed, s.";
        imbalance: f64 = "Coefficient of variation of the cells that each agent has seen itself.";
        contact_share: f64 =
            "Share of the pairs of agents in contact: mean over the samples every 10 s; 0 for one \
             agent.";
        messages: u64 = "Agent-to-agent messages delivered.";
        message_bytes: u64 = "Payload of agent-to-agent messages delivered, bytes.";
        bytes_by_kind as "message_bytes_kind_<type>": BTreeMap<u8, u64> =
            "Payload of delivered messages of a type (recording.md), bytes.";
        staleness: f64 =
            "Share of the team's seen cells that an agent's map lacks: mean over agents and \
             samples.";
        decisions: u64 = "Committed replies of agents.";
        collisions: u64 = "Collisions of bodies with walls and with each other.";
        search_failures: u64 = "Path searches without a path.";
        refusals: u64 = "Messages of agents that the server has refused.";
        digest: String = "Proof of the run (determinism.md), hexadecimal.";
        #[serde(default, skip_serializing_if = "Option::is_none")]
        oracle as "oracle_t<share>_s, bound_t<share>_s": Option<OracleRow> =
            "Times of a team that has the map, of which the plan is flown (`oracle_`) and no team \
             is faster (`bound_`), s; missing columns if the plan does not ask for them.";
        wall as "wall_<figure>": WallRow = "Figures of wall time, which differ between repetitions.";
    }
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

row! {
    /// Figures of wall time, which differ between repetitions.
    WallRow {
        wall_s as "s": f64 = "Wall time of the run, s.";
        real_time_factor: f64 = "Sim time divided by wall time.";
        decision_p50_us: Option<f64> = "Median wall time of a decision, µs; missing over ROS 2.";
        decision_p95_us: Option<f64> = "95th percentile of the wall time of a decision, µs.";
        decision_p99_us: Option<f64> = "99th percentile of the wall time of a decision, µs.";
        machine: String = "Processor and cores.";
    }
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
    /// See [`RunRow::known_at_base`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub known_at_base: Option<f64>,
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
