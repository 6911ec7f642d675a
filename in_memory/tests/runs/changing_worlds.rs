//! Complete runs in which cells become wall or free: teams explore what opens, rest where something
//! has closed, and no body ends inside a wall.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::support::{fill, result, result_with, solid};
use in_memory::in_process::{AgentOptions, CompletedRun, run as run_scenario};
use msgs::ids::Tick;
use msgs::maes_msgs::{MapChange, Result as RunResult};
use recording::Recording;
use sim_server::session::NullObserver;
use sim_server::verify::verify;
use simulation::scenario::Scenario;
use voxels::{Grid, Terrain};

/// Controllers that go on once something has changed.
const PLANNERS: [&str; 6] = ["nearest-frontier", "dsvp", "dsvp-auction", "dsvp-team", "boustrophedon", "lvd"];

fn counter(result: &RunResult, name: &str) -> u64 {
    result.counters.iter().find(|counter| counter.name == name).map_or(0, |counter| counter.value)
}

/// Two rooms of 8 x 8 x 3 cells with a passage of 4 cells between them, and a chamber of 5 x 4 x 3
/// cells behind the far one. A wall of one cell is before the chamber, at x = 21.
fn rooms() -> Grid<Terrain> {
    let mut rooms = solid([28, 10, 5], 1.0);
    fill(&mut rooms, [1..9, 1..9, 1..4], Terrain::Free);
    fill(&mut rooms, [9..13, 4..6, 1..4], Terrain::Free);
    fill(&mut rooms, [13..21, 1..9, 1..4], Terrain::Free);
    fill(&mut rooms, [22..27, 3..7, 1..4], Terrain::Free);
    rooms
}

/// The map that runs start with has one component, so the chamber is walled in by an event.
const CLOSED: &str = "{ kind = \"wall\", at_s = 0.0, low = [21.0, 3.0, 0.0], high = [22.0, 7.0, 5.0] }";
const OPENED: &str = "{ kind = \"free\", at_s = 150.0, low = [21.0, 3.0, 0.0], high = [22.0, 7.0, 5.0] }";

fn with_door() -> Grid<Terrain> {
    let mut rooms = rooms();
    fill(&mut rooms, [21..22, 3..7, 1..4], Terrain::Free);
    rooms
}

fn run(controller: &str, events: &str, more: &str) -> RunResult {
    let keys = format!(
        "duration_s = 400.0\nagents = {{ count = 2, controller = \"{controller}\" }}\nevent = [{events}]\n{more}"
    );
    result(&with_door(), &keys)
}

#[test]
fn team_explores_what_opens_after_it_has_come_to_rest() {
    for controller in PLANNERS {
        let result = run(controller, &format!("{CLOSED}, {OPENED}"), "stop_when_explored = false");
        assert_eq!(counter(&result, "map_changes"), 2, "{controller}");
        assert_eq!(counter(&result, "free_cells"), 3 * (64 + 8 + 64 + 4 + 20), "{controller}");
        assert_eq!(result.explored, 1.0, "{controller}");
        let explored = counter(&result, "tick_explored_permille_1000");
        assert!((7500..15_000).contains(&explored), "{controller}: {explored}, and it was all of the world before");
    }
}

#[test]
fn run_ends_once_a_collapse_leaves_nothing_to_see() {
    // A part of the far room falls in as soon as a body is before the passage.
    let collapse = "{ kind = \"wall\", at_s = 0.0, within_m = 7.5, low = [15.0, 0.0, 0.0], high = [18.0, 10.0, 5.0] }";
    for controller in PLANNERS {
        let result = run(controller, &format!("{CLOSED}, {collapse}"), "");
        assert_eq!(counter(&result, "map_changes"), 2, "{controller}");
        assert_eq!(result.reason, "nothing more can be seen", "{controller}");
        assert!((0.5..1.0).contains(&result.explored) && result.tick < 20_000, "{controller}: {}", result.explored);
    }
}

#[test]
fn runs_with_changes_are_repeatable() {
    let shut =
        "{ kind = \"wall\", at_s = 3.0, within_m = 3.0, agent = 1, low = [10.0, 3.0, 0.0], high = [11.0, 7.0, 5.0] }";
    let open = "{ kind = \"free\", at_s = 30.0, low = [10.0, 3.0, 0.0], high = [11.0, 7.0, 5.0] }";
    for controller in ["nearest-frontier", "dsvp-team", "rbw", "lvd-maes3d"] {
        let events = format!("{CLOSED}, {shut}, {open}, {OPENED}");
        let digests: Vec<[u8; 32]> = [
            "execution = { threads = 1 }",
            "execution = { threads = 3 }",
            "execution = { threads = 1, look_ahead = false }",
        ]
        .into_iter()
        .map(|execution| {
            let keys = format!(
                "duration_s = 180.0\nagents = {{ count = 3, controller = \"{controller}\" }}\nevent = [{events}]\n\
                 stop_when_explored = false\n"
            );
            result_with(&with_door(), &keys, execution).digest
        })
        .collect();
        assert!(digests.iter().all(|digest| *digest == digests[0]), "{controller}");
    }
}

#[test]
fn map_is_as_good_as_one_that_was_so_from_the_start() {
    // What is closed before the first scan and opened never is the same world as one without it.
    let keys = "duration_s = 300.0\nagents = { count = 2, controller = \"dsvp\" }\n";
    let closed = run("dsvp", CLOSED, "");
    let mut walled = rooms();
    fill(&mut walled, [22..27, 3..7, 1..4], Terrain::Wall);
    let never = result(&walled, keys);
    assert_eq!(counter(&never, "free_cells") + 60, counter(&closed, "free_cells"), "the chamber counts as free");
    assert_eq!(never.explored, 1.0);
    assert!((closed.explored - 408.0 / 468.0).abs() < 1e-9, "{}", closed.explored);
    assert_eq!(closed.reason, "nothing more can be seen");
}

/// A run of the scenario file `doors.toml`, recorded in a file.
fn doors(file: &Path) -> Scenario {
    let text = include_str!("../../../launch_scripts/scenarios/doors.toml");
    let record = format!("duration_s = 120.0\nexecution = {{ threads = 1, record = {file:?} }}");
    Scenario::parse("doors.toml", &text.replace("duration_s = 600.0", &record), &[]).expect("a legal scenario")
}

#[test]
fn recordings_hold_each_change_verify_and_fork() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [parent, fork] = ["parent.mcap", "fork.mcap"].map(|name| folder.path().join(name));
    let (options, stop) = (AgentOptions::default(), AtomicBool::new(false));
    let digest = |completed: CompletedRun| completed.outcome.digest;
    let recorded = digest(run_scenario(&doors(&parent), &options, &mut NullObserver, &stop).expect("a run"));
    let recording = Recording::open(&parent).expect("a recording");
    let changes: Vec<MapChange> = recording
        .messages()
        .filter(|message| message.channel.topic == "/sim/map_change")
        .map(|message| message.decode().expect("a change of the map"))
        .collect();
    assert_eq!(changes.iter().map(|change| change.kind).collect::<Vec<_>>(), [1, 1, 0]);
    assert_eq!((changes[0].tick, changes[2].tick), (0, 3000));
    assert_eq!((changes[1].low, changes[1].high), ([24, 4, 1], [24, 5, 3]));
    let verified = verify(&recording).expect("it verifies");
    assert_eq!(verified.digest, recorded);
    // A fork re-executes the past as a resumed run does, before and after each change.
    let scenario = doors(&fork);
    for at in [0, changes[1].tick, changes[1].tick + 1, 2999, 3000, 3001, 5000] {
        let forked = in_memory::in_process::fork(&recording, Tick(at), &scenario, &options, &mut NullObserver, &stop);
        assert_eq!(digest(forked.expect("a fork")), recorded, "forked at {at}");
        assert!(std::fs::read(&parent).unwrap() == std::fs::read(&fork).unwrap(), "forked at {at}");
    }
}
