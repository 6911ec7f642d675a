//! What is kept of a run: one row of figures, and a series over sim time.
//!
//! Everything but [`WallRow`] is a function of the scenario, the seed and the build. A run is kept as one file,
//! `runs/<id>.json`, which holds a [`RunRecord`]; the tables of a plan are made from these files.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Sim time between two samples of a series, seconds.
pub const SAMPLE_PERIOD_S: f64 = 10.0;

/// What `runs/<id>.json` holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    /// The figures of the run.
    pub row: RunRow,
    /// How it went, every [`SAMPLE_PERIOD_S`] from the start and at the end.
    pub series: Vec<Sample>,
}

/// The figures of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRow {
    /// First 16 hexadecimal digits of the blake3 hash of scenario, seed and build.
    pub id: String,
    /// The build that made the run.
    pub build: String,
    /// What the agents ran.
    pub controller: String,
    /// Seed of the run.
    pub seed: u64,
    /// Cells of the map along x, y and z.
    pub size: [u32; 3],
    /// How many agents took part.
    pub agents: u32,
    /// Every axis of the plan: key and value as text.
    pub axes: BTreeMap<String, String>,
    /// Sim time after which the run ends at the latest, seconds.
    pub duration_s: f64,
    /// Sim time at which it ended, seconds.
    pub end_s: f64,
    /// Why it ended.
    pub reason: String,
    /// Free cells of the true map.
    pub free_cells: u64,
    /// Share of the free cells that the team has seen at the end.
    pub explored: f64,
    /// Share of the free cells that bodies of the team have passed through.
    pub covered: f64,
    /// Share of the free cells that are on an agent's map at the end: mean over the agents.
    pub believed_mean: f64,
    /// The same, of the agent with the least.
    pub believed_min: f64,
    /// When the team had seen 50 % of the free cells, seconds of sim time; `None`: never.
    pub t50_s: Option<f64>,
    /// The same, for 90 %.
    pub t90_s: Option<f64>,
    /// The same, for 99 %.
    pub t99_s: Option<f64>,
    /// The same, for 99.9 %.
    pub t99_9_s: Option<f64>,
    /// The same, for 100 %.
    pub t100_s: Option<f64>,
    /// Mean of the explored share over the whole duration, 0 to 1; after the end it stays as it was.
    pub area_under_explored: f64,
    /// Way of all agents, metres.
    pub distance_m: f64,
    /// Way of the agent that went farthest, metres.
    pub distance_max_m: f64,
    /// What the agents have seen themselves, added up, over what the team has seen, less 1.
    pub redundancy: f64,
    /// Standard deviation over mean of what the agents have seen themselves.
    pub imbalance: f64,
    /// Share of the pairs of agents that are in contact: mean over the samples; 0 for one agent.
    pub contact_share: f64,
    /// Parcels that arrived.
    pub parcels: u64,
    /// Bytes of the parcels that arrived.
    pub parcel_bytes: u64,
    /// The same, by kind of parcel.
    pub bytes_by_kind: BTreeMap<u8, u64>,
    /// How much of what the team has seen is not on an agent's map: mean share over agents and samples.
    pub staleness: f64,
    /// Times that agents were asked and their answers counted.
    pub decisions: u64,
    /// Collisions of bodies with walls and with each other.
    pub collisions: u64,
    /// Searches for a path that found none.
    pub search_failures: u64,
    /// Messages of agents that were refused.
    pub refusals: u64,
    /// Digest of the run.
    pub digest: String,
    /// What depends on the machine.
    pub wall: WallRow,
}

/// Figures of wall time, which differ between repetitions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WallRow {
    /// Wall time of the run, seconds.
    pub wall_s: f64,
    /// Sim time for each wall time.
    pub real_time_factor: f64,
    /// Half of the decisions took at most so long, microseconds.
    pub decision_p50_us: Option<f64>,
    /// 95 % of the decisions took at most so long, microseconds.
    pub decision_p95_us: Option<f64>,
    /// 99 % of the decisions took at most so long, microseconds.
    pub decision_p99_us: Option<f64>,
    /// The machine: its processor and how many cores it has.
    pub machine: String,
}

/// A run at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// Sim time, seconds.
    pub t_s: f64,
    /// See [`RunRow::explored`].
    pub explored: f64,
    /// See [`RunRow::covered`].
    pub covered: f64,
    /// See [`RunRow::believed_mean`].
    pub believed_mean: f64,
    /// See [`RunRow::distance_m`].
    pub distance_m: f64,
    /// See [`RunRow::parcel_bytes`].
    pub parcel_bytes: u64,
    /// Pairs of agents in contact.
    #[serde(default)]
    pub pairs_in_contact: u32,
    /// Agent 0, 1, and so on.
    #[serde(default)]
    pub agents: Vec<AgentSample>,
}

/// An agent at one time. Shares are of the free cells of the true map, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentSample {
    /// Seen by itself.
    pub explored: f64,
    /// Visited by itself.
    pub covered: f64,
    /// On its map, as it has said last.
    pub believed: f64,
    /// Its way, metres.
    pub distance_m: f64,
}
