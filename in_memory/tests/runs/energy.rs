//! Complete runs of bodies with batteries: whatever the controller, no body runs empty while it
//! knows a way home, the team comes back, and the figures say so.

use crate::support::{fill, result, result_with, solid};
use msgs::counters::CounterName;
use msgs::maes_msgs::Result as RunResult;
use voxels::{Grid, Terrain};

/// Controllers that see all of the rooms, and rest then.
const PLANNERS: [&str; 8] =
    ["nearest-frontier", "dsvp", "dsvp-auction", "dsvp-team", "hungarian", "rendezvous", "racer", "c2-explorer"];

/// A hall with the start, and three rooms of 10 x 10 x 4 cells behind passages of 3 x 3.
fn rooms() -> Grid<Terrain> {
    let mut rooms = solid([62, 14, 8], 1.0);
    for room in 0..4 {
        let x = 1 + 15 * room;
        fill(&mut rooms, [x..x + 10, 2..12, 2..6], Terrain::Free);
        if room < 3 {
            fill(&mut rooms, [x + 10..x + 15, 6..9, 2..5], Terrain::Free);
        }
    }
    rooms
}

fn keys(controller: &str, more: &str) -> String {
    format!(
        "duration_s = 1200.0\nstop_when_back = true\nlidar = {{ range_m = 6.0 }}\n\
         agents = {{ count = 2, controller = \"{controller}\" }}\n{more}\n"
    )
}

/// Enough for the way to the end and back, and not for all of the rooms.
const SHORT: &str = "energy = { endurance_s = 100.0, idle_w = 2.0, hover_w = 1.0, charge_w = 20.0 }";

fn count(result: &RunResult, name: CounterName) -> u64 {
    result.counter(name).unwrap_or_else(|| panic!("{name} in {:?}", result.counters))
}

#[test]
fn no_body_runs_empty() {
    let rooms = rooms();
    // What lvd-maes3d decides takes seconds of wall time on a map of this size.
    for controller in agent_node::controllers::NAMES.into_iter().filter(|&name| name != "lvd-maes3d") {
        for body in ["submarine", "aerial"] {
            let keys = keys(controller, &format!("{SHORT}\nbody = {{ kind = \"{body}\" }}"));
            let result = result(&rooms, &keys.replace("1200.0", "400.0"));
            assert_eq!(count(&result, CounterName::RanEmpty), 0, "{controller}, {body}: {}", result.reason);
            assert!(count(&result, CounterName::EnergyUsed) > 50_000, "{controller}, {body}: it has left");
        }
    }
}

#[test]
fn teams_see_all_and_come_back() {
    let rooms = rooms();
    for controller in PLANNERS {
        let result = result(&rooms, &keys(controller, &SHORT.replace("100.0", "220.0")));
        assert_eq!((result.reason.as_str(), result.explored), ("all are back", 1.0), "{controller}");
        let (home, seen) = (
            count(&result, CounterName::TickHome),
            result.counter(CounterName::TickExplored { permille: 990 }).unwrap(),
        );
        assert!(seen < home && home <= result.tick, "{controller}: {seen}, {home}");
        assert_eq!(count(&result, CounterName::RanEmpty), 0, "{controller}");
    }
}

#[test]
fn without_charging_the_team_comes_back_once() {
    let keys = keys("dsvp", &SHORT.replace("20.0", "0.0"));
    let result = result(&rooms(), &keys);
    assert_eq!(result.reason, "all are back");
    assert!((0.3..1.0).contains(&result.explored), "{}", result.explored);
    assert_eq!((result.counter(CounterName::TickHome), count(&result, CounterName::RanEmpty)), (None, 0));
    let used_j = count(&result, CounterName::EnergyUsed) as f64 / 1e3;
    assert!((200.0..400.0).contains(&used_j), "{used_j} of two batteries of 200 J, with 40 J in reserve each");
}

#[test]
fn controllers_that_do_not_return_run_empty() {
    let keys = keys("dsvp", &SHORT.replace("endurance", "return_home = false, endurance"));
    let result = result(&rooms(), &keys);
    assert_eq!((count(&result, CounterName::RanEmpty), result.reason.as_str()), (2, "duration"));
    assert_eq!(count(&result, CounterName::EnergyUsed), 400_000);
}

#[test]
fn battery_too_small_to_leave_is_not_left_with() {
    let result = result(&rooms(), &keys("dsvp", "energy = { endurance_s = 10.0 }"));
    assert_eq!(result.reason, "all are back");
    assert_eq!(result.distance_m, [0.0, 0.0]);
}

#[test]
fn look_ahead_and_threads_do_not_change_the_run() {
    let rooms = rooms();
    let keys = keys("nearest-frontier", SHORT);
    let expected = result(&rooms, &keys);
    for execution in ["look_ahead = false, threads = 1", "threads = 4"] {
        let other = result_with(&rooms, &keys, &format!("execution = {{ {execution} }}"));
        assert_eq!(other.digest, expected.digest, "{execution}");
    }
}
