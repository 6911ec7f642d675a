//! Synthetic runs for tests.

use std::collections::BTreeMap;

use experiments::rows::{RunRecord, RunRow, Sample, WallRow};

/// A run of 60 s on a map of 50³ cells that ends after 20 s with 90 % explored.
pub(crate) fn run(controller: &str, seed: u64, agents: u32) -> RunRecord {
    let sample = |t_s, explored| Sample {
        t_s,
        explored,
        covered: explored / 10.0,
        believed_mean: explored / 2.0,
        distance_m: 2.0 * t_s,
        message_bytes: (1000.0 * t_s) as u64,
        pairs_in_contact: 0,
        agents: Vec::new(),
    };
    let row = RunRow {
        id: format!("{controller}-{seed}-{agents}"),
        build: "0.1.0".to_owned(),
        controller: controller.to_owned(),
        seed,
        size: [50, 50, 50],
        agents,
        axes: BTreeMap::new(),
        duration_s: 60.0,
        end_s: 20.0,
        reason: "explored".into(),
        // Each seed has a map of its own.
        free_cells: 1000 + seed,
        explored: 0.9,
        explored_m3: None,
        attainable: None,
        covered: 0.09,
        believed_mean: 0.45,
        believed_min: 0.4,
        t50_s: Some(10.0),
        t90_s: Some(20.0),
        t99_s: None,
        t99_9_s: None,
        t100_s: None,
        area_under_explored: 0.75,
        distance_m: 40.0,
        distance_max_m: 25.0,
        energy_j: None,
        energy_per_cell_j: None,
        ran_empty: None,
        t_home_s: None,
        position_error_m: None,
        map_off_by_1: None,
        map_off_by_2: None,
        map_off_by_more: None,
        redundancy: 0.5,
        redundancy_known: Some(0.3),
        redundancy_unknown: Some(0.2),
        redundancy_first_minute: None,
        exploring_s: 10.0,
        relocating_s: 5.0,
        carrying_s: 2.0,
        waiting_s: 1.0,
        imbalance: 0.1,
        contact_share: 0.25,
        messages: 10,
        message_bytes: 20_000,
        bytes_by_kind: BTreeMap::from([(1, 15_000), (2, 5_000)]),
        staleness: 0.5,
        decisions: 100,
        collisions: 0,
        search_failures: 1,
        refusals: 0,
        digest: "00ff".to_owned(),
        oracle: None,
        wall: WallRow {
            wall_s: 0.5,
            real_time_factor: 40.0,
            decision_p50_us: Some(20.0),
            decision_p95_us: Some(100.0),
            decision_p99_us: Some(400.0),
            machine: "a machine with 2 cores".to_owned(),
        },
    };
    RunRecord { row, series: vec![sample(0.0, 0.0), sample(10.0, 0.5), sample(20.0, 0.9)] }
}
