//! Complete runs with a base station: agents that report bring it the map, from far out of contact,
//! and the results say when it has it.

use crate::support::{fill, result, result_with, solid};
use msgs::counters::CounterName;
use msgs::maes_msgs::Result as RunResult;
use voxels::{Grid, Terrain};

/// A hall with the start, and three rooms of 10 x 10 x 4 cells behind bent passages, out of sight
/// of each other.
fn rooms() -> Grid<Terrain> {
    let mut rooms = solid([62, 22, 8], 1.0);
    for room in 0..4 {
        let x = 1 + 15 * room;
        fill(&mut rooms, [x..x + 10, 2..12, 2..6], Terrain::Free);
        if room < 3 {
            fill(&mut rooms, [x + 7..x + 10, 12..19, 2..5], Terrain::Free);
            fill(&mut rooms, [x + 7..x + 18, 16..19, 2..5], Terrain::Free);
            fill(&mut rooms, [x + 15..x + 18, 12..19, 2..5], Terrain::Free);
        }
    }
    rooms
}

fn keys(to_base: &str, more: &str) -> String {
    format!(
        "duration_s = 1500.0\nstop_when_known_at_base = true\nlidar = {{ range_m = 8.0 }}\n{more}\n[agents]\n\
         count = 3\nbase_stations = [0]\ncontroller = \"dsvp-team\"\nset = {{ to_base = \"{to_base}\", report_s = 60.0 }}\n"
    )
}

fn known_at_base(result: &RunResult) -> f64 {
    result.believed_by[0]
}

#[test]
fn agents_that_report_bring_the_base_the_map() {
    let rooms = rooms();
    for (to_base, more) in [("rendezvous", ""), ("relay-chain", "communication = { relays = { per_agent = 6 } }")] {
        let result = result(&rooms, &keys(to_base, more));
        assert_eq!((result.reason.as_str(), result.explored), ("the base has the map", 1.0), "{to_base}");
        assert_eq!((known_at_base(&result), result.distance_m[0]), (1.0, 0.0), "{to_base}");
        let has_map = result.counter(CounterName::TickKnownAtBase).unwrap();
        assert!(
            has_map > result.counter(CounterName::TickExplored { permille: 500 }).unwrap() && has_map <= result.tick
        );
        let relays = result.counter(CounterName::RelaysLeft).unwrap_or(0);
        assert_eq!(relays > 0, to_base == "relay-chain", "{relays} relays");
    }
}

#[test]
fn without_a_strategy_the_base_knows_less_on_the_way() {
    // Then agents bring it news at the end alone, as to any other agent.
    let until =
        |to_base: &str| keys(to_base, "").replace("1500.0", "120.0").replace("report_s = 60.0", "report_s = 20.0");
    let rooms = rooms();
    let (off, on) = (result(&rooms, &until("off")), result(&rooms, &until("rendezvous")));
    assert!(known_at_base(&on) > known_at_base(&off) + 0.1, "{} {}", known_at_base(&on), known_at_base(&off));
    assert_eq!(off.counter(CounterName::TickKnownAtBase), None);
}

#[test]
fn look_ahead_and_threads_do_not_change_the_run() {
    let (rooms, keys) = (rooms(), keys("rendezvous", ""));
    let expected = result(&rooms, &keys);
    for execution in ["look_ahead = false, threads = 1", "threads = 4"] {
        let other = result_with(&rooms, &keys, &format!("execution = {{ {execution} }}"));
        assert_eq!(other.digest, expected.digest, "{execution}");
    }
}
