//! Complete runs of teams that never see all: they end by themselves, and say why.

use crate::support::{fill, result, solid};
use msgs::maes_msgs::Result as RunResult;
use voxels::{Grid, Terrain};

/// A room, a lane as wide as one body, and a hall behind it.
fn lane() -> Grid<Terrain> {
    let mut cave = solid([41, 16, 8], 1.0);
    fill(&mut cave, [1..14, 1..14, 1..7], Terrain::Free);
    fill(&mut cave, [14..24, 7..8, 3..4], Terrain::Free);
    fill(&mut cave, [24..40, 1..15, 1..7], Terrain::Free);
    cave
}

/// Three agents, of which the first breaks down in the lane before it has seen the hall.
fn in_the_lane(controller: &str, more: &str) -> RunResult {
    let keys = format!(
        "duration_s = 3600.0\nlidar = {{ range_m = 4.0 }}\nagents = {{ count = 3, controller = \"{controller}\" }}\n\
         spawn = {{ kind = \"list\", poses = [[17.5, 7.5, 3.5], [4.5, 4.5, 3.5], [4.5, 10.5, 3.5]] }}\n\
         [[event]]\nat_s = 0.1\nkind = \"break_down\"\nagent = 0\n{more}"
    );
    result(&lane(), &keys)
}

#[test]
fn team_before_a_blocked_lane_ends_as_one_that_stands_still() {
    for controller in ["nearest-frontier", "dsvp-team"] {
        let result = in_the_lane(controller, "");
        assert_eq!(result.reason, "the team stands still", "{controller}: {}", result.explored);
        assert!(result.explored < 0.9 && result.tick > 15_000, "{controller}: {}, {}", result.explored, result.tick);
    }
}

#[test]
fn obstacle_at_rest_is_no_reason_to_go_on() {
    // It goes into the lane and stays there, or comes back.
    let with = |repeat: &str| {
        let keys = format!(
            "duration_s = 1500.0\nlidar = {{ range_m = 4.0 }}\nagents = {{ count = 2, controller = \"dsvp-auction\" }}\n\
             spawn = {{ kind = \"list\", poses = [[4.5, 4.5, 3.5], [4.5, 10.5, 3.5]] }}\n\
             obstacle = [{{ kind = \"sphere\", radius_m = 0.45, path = [[21.5, 7.5, 3.5], [20.5, 7.5, 3.5]], \
             speed_m_s = 1.0, repeat = \"{repeat}\" }}]\n"
        );
        result(&lane(), &keys)
    };
    assert_eq!(with("once").reason, "the team stands still");
    assert_eq!(with("to_and_fro").reason, "duration");
}

#[test]
fn event_ahead_is_waited_for() {
    let freed = "[[event]]\nat_s = 1200.0\nkind = \"leave\"\nagent = 0\n";
    let result = in_the_lane("dsvp-team", freed);
    assert_eq!((result.explored, result.reason.as_str()), (1.0, "explored"));
    assert!(result.tick > 60_000, "{}", result.tick);
}

/// A room, and a hidden pocket behind a passage of one cell that turns.
fn pocket() -> Grid<Terrain> {
    let mut room = solid([20, 20, 12], 0.2);
    fill(&mut room, [1..12, 1..12, 1..11], Terrain::Free);
    fill(&mut room, [12..14, 5..6, 5..6], Terrain::Free);
    fill(&mut room, [13..14, 5..16, 5..6], Terrain::Free);
    fill(&mut room, [10..16, 15..19, 4..8], Terrain::Free);
    room
}

#[test]
fn controller_that_takes_over_is_not_at_rest_before_it_says_so() {
    // The team rests by then, and the one that takes over never does.
    let keys = "duration_s = 1200.0\nbody = { kind = \"aerial\", radius_m = 0.3 }\nlidar = { range_m = 4.5 }\n\
                agents = { count = 2, controller = \"dsvp\" }\n[[event]]\nat_s = 30.0\nkind = \"set\"\n\
                set = { \"agents.controller\" = \"rbw\" }\n";
    let run = result(&pocket(), keys);
    assert_eq!(run.reason, "nothing more can be seen", "{}", run.explored);
    assert!(run.tick > 3000, "{}", run.tick);
}

#[test]
fn walks_end_once_nothing_more_can_be_seen() {
    let keys = "duration_s = 1200.0\nbody = { kind = \"aerial\", radius_m = 0.3 }\nlidar = { range_m = 4.5 }\n\
                agents = { count = 2, controller = \"rbw\" }\n";
    let result = result(&pocket(), keys);
    assert_eq!(result.reason, "nothing more can be seen", "{}", result.explored);
    assert!(result.explored < 1.0);
}
