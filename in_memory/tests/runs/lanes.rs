//! Complete runs of teams that have to get past each other: none stands for ever while one of them
//! could go on.

use crate::support::{fill, result, solid};
use msgs::counters::CounterName;
use voxels::{Grid, Terrain};

/// A room of 27 cells, in which the team starts, and a lane as wide as one body.
fn room_before_a_lane() -> Grid<Terrain> {
    let mut rooms = solid([124, 5, 5], 1.0);
    fill(&mut rooms, [1..4, 1..4, 1..4], Terrain::Free);
    fill(&mut rooms, [4..120, 2..3, 2..3], Terrain::Free);
    rooms
}

/// That room with a hall at the end of a shorter lane.
fn room_before_a_hall() -> Grid<Terrain> {
    let mut rooms = solid([70, 22, 8], 1.0);
    fill(&mut rooms, [1..4, 8..11, 1..4], Terrain::Free);
    fill(&mut rooms, [4..40, 9..10, 2..3], Terrain::Free);
    fill(&mut rooms, [40..68, 1..21, 1..7], Terrain::Free);
    rooms
}

fn keys(seed: u64, controller: &str, agents: u32, body: &str) -> String {
    format!(
        "seed = {seed}\nduration_s = 900.0\nlidar = {{ range_m = 2.5 }}\n{body}\n\
         agents = {{ count = {agents}, controller = \"{controller}\" }}\n"
    )
}

#[test]
fn teams_get_out_of_a_room_that_they_fill() {
    let rooms = room_before_a_lane();
    for (controller, agents, seed) in ["nearest-frontier", "dsvp", "dsvp-team", "rendezvous"]
        .into_iter()
        .flat_map(|controller| (4..=6).flat_map(move |agents| (1..=3).map(move |seed| (controller, agents, seed))))
    {
        let result = result(&rooms, &keys(seed, controller, agents, "body = { kind = \"aerial\" }"));
        let collisions = result.counter(CounterName::Collisions).unwrap_or(0);
        let text = format!("{agents} {controller}, seed {seed}: {}, {collisions} collisions", result.reason);
        assert!(result.reason == "explored" && collisions < 400, "{text}");
    }
}

#[test]
fn teams_get_through_a_lane_to_a_hall() {
    let rooms = room_before_a_hall();
    for (controller, agents, seed) in [("dsvp", 6, 2), ("dsvp-team", 6, 1), ("rendezvous", 4, 1), ("rendezvous", 6, 2)]
    {
        let result = result(&rooms, &keys(seed, controller, agents, ""));
        let collisions = result.counter(CounterName::Collisions).unwrap_or(0);
        let text = format!("{agents} {controller}, seed {seed}: {}, {collisions} collisions", result.reason);
        assert!(result.reason == "explored" && collisions < 100, "{text}");
    }
}
