use msgs::ids::AgentId;
use msgs::maes_msgs::Counter;
use protocol::stage::Stage;
use std::path::Path;

use super::*;
use crate::plan::Plan;

#[test]
fn metrics_match_hand_calculation() {
    let text = "seeds = [4]\n[scenario]\nduration_s = 40.0\n[scenario.map]\nkind = \"spheres\"\nsize = 24\n\
                [scenario.agents]\ncount = 2\n";
    let plan = Plan::parse("p.toml", text, Path::new(".")).unwrap();
    let at = |tick, explored, believed_by: [f64; 2], pairs_in_contact| Progress {
        tick,
        explored,
        explored_by: vec![explored, 0.25],
        covered_by: vec![0.0, 0.125],
        believed_by: believed_by.to_vec(),
        distance_m: vec![1.0, 2.0],
        pairs_in_contact,
        ..Progress::default()
    };
    let progress = [
        at(0, 0.0, [0.0, 0.0], 1),
        at(500, 0.5, [0.5, 0.25], 0),
        at(1000, 1.0, [1.0, 0.5], 1),
        at(1200, 1.0, [1.0, 0.75], 0),
    ];
    let mut stages = StageTimes::default();
    stages.enter(AgentId(1), Tick(200), Stage::Exploring);
    stages.enter(AgentId(1), Tick(700), Stage::Waiting);
    let counter = |name: &str, value| Counter { name: name.to_owned(), value };
    let result = RunResult {
        tick: 1200,
        reason: "explored".to_owned(),
        explored: 1.0,
        explored_by: vec![0.75, 0.5],
        believed_by: vec![1.0, 0.75],
        distance_m: vec![3.0, 5.0],
        counters: vec![
            counter("free_cells", 100),
            counter("tick_explored_permille_500", 501),
            counter("message_bytes_delivered_kind_1", 7),
            counter("refused_wrong_tick", 2),
            counter("refused_undecodable", 1),
        ],
        ..RunResult::default()
    };
    let decisions: Vec<Duration> = (1..=100).map(Duration::from_micros).collect();
    let wall = wall_row(Tick(1200), Duration::from_secs(2), &decisions, "here");
    assert_eq!((wall.decision_p50_us, wall.decision_p99_us, wall.real_time_factor), (Some(50.0), Some(99.0), 12.0));
    assert_eq!(wall_row(Tick(1), Duration::ZERO, &[], "here").decision_p50_us, None);
    let RunRecord { row, series } = record(
        &plan.runs[0],
        Trace {
            size: [24; 3],
            cell_m: 0.5,
            progress: &progress,
            result: &result,
            stages: &stages,
            seen_again: Some(20),
            explored_m2: Some(12.5),
            wall,
        },
    );
    assert_eq!((row.end_s, row.t50_s, row.t90_s), (24.0, Some(10.02), None));
    // 10 s at 0.25 on average, 10 s at 0.75, 4 s at 1, and 16 s of 40 that stay at 1.
    assert_eq!(row.area_under_explored, (2.5 + 7.5 + 4.0 + 16.0) / 40.0);
    assert_eq!((row.redundancy, row.imbalance), (0.25, 0.2));
    // 20 of the 100 free cells were seen again by those who knew them.
    let known = row.redundancy_known.unwrap();
    assert_eq!((known, row.redundancy_unknown), (0.2, Some(0.25 - known)));
    assert_eq!(row.redundancy_first_minute, None, "it ended before");
    let stages = [row.exploring_s, row.relocating_s, row.carrying_s, row.waiting_s];
    assert_eq!(stages, [10.0, 0.0, 0.0, 10.0]);
    assert_eq!((row.believed_mean, row.believed_min), (0.875, 0.75));
    // In contact at 0 and 20 s of the three regular samples; staleness 0, 1/2, 0 and 1/2 from the
    // first explored cell on.
    assert_eq!((row.contact_share, row.staleness), (2.0 / 3.0, 0.25));
    assert_eq!((row.distance_m, row.distance_max_m, row.refusals, row.free_cells), (8.0, 5.0, 3, 100));
    assert_eq!((row.explored_m2, row.explored_m3), (Some(12.5), Some(100.0 * row.explored / 8.0)));
    assert_eq!(row.bytes_by_kind, BTreeMap::from([(1, 7)]));
    assert_eq!(series.iter().map(|sample| sample.t_s).collect::<Vec<_>>(), [0.0, 10.0, 20.0, 24.0]);
    let second = AgentSample { explored: 0.25, covered: 0.125, believed: 0.5, distance_m: 2.0 };
    assert_eq!((series[2].agents.len(), series[2].agents[1], series[2].pairs_in_contact), (2, second, 1));
}
