//! Complete runs with moving obstacles: teams explore around them, and recordings of such runs
//! verify and fork.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::support::{fill, result, result_with, solid};
use in_memory::in_process::{AgentOptions, CompletedRun, fork, run as run_scenario};
use msgs::ids::Tick;
use msgs::tf2_msgs::TFMessage;
use recording::Recording;
use sim_server::session::NullObserver;
use sim_server::setup;
use sim_server::verify::verify;
use simulation::scenario::Scenario;
use voxels::{Grid, Terrain};

/// Two rooms of 8 x 8 x 3 cells with a passage of 3 x 3 cells between them.
fn rooms() -> Grid<Terrain> {
    let mut rooms = solid([30, 10, 5], 1.0);
    fill(&mut rooms, [1..9, 1..9, 1..4], Terrain::Free);
    fill(&mut rooms, [9..21, 4..7, 1..4], Terrain::Free);
    fill(&mut rooms, [21..29, 1..9, 1..4], Terrain::Free);
    rooms
}

/// Goes to and fro through the passage, which it leaves half of.
const CART: &str = "obstacle = [{ kind = \"box\", size_m = [1.0, 1.0, 1.0], speed_m_s = 0.7, \
                    path = [[5.5, 4.6, 1.6], [24.5, 4.6, 1.6]] }]";

fn keys(controller: &str, obstacle: &str) -> String {
    format!(
        "duration_s = 400.0\nlidar = {{ range_m = 8.0 }}\nagents = {{ count = 2, controller = \"{controller}\" }}\n{obstacle}\n"
    )
}

#[test]
fn teams_explore_around_obstacles() {
    let rooms = rooms();
    for controller in ["nearest-frontier", "dsvp", "dsvp-auction", "dsvp-team", "lvd"] {
        let result = result(&rooms, &keys(controller, CART));
        assert_eq!((result.reason.as_str(), result.explored), ("explored", 1.0), "{controller}");
    }
}

#[test]
fn look_ahead_and_threads_do_not_change_the_run() {
    let rooms = rooms();
    for noise in ["", "sensor = { range_sigma_m = 0.05 }\n"] {
        let keys = keys("dsvp-team", CART).replace("lidar", &format!("{noise}lidar"));
        let expected = result(&rooms, &keys);
        for execution in ["look_ahead = false, threads = 1", "threads = 4"] {
            let other = result_with(&rooms, &keys, &format!("execution = {{ {execution} }}"));
            assert_eq!(other.digest, expected.digest, "{execution}");
        }
    }
}

/// A run of the scenario file `people.toml`, recorded in a file with the visualisation messages
/// that `views.record` names.
fn people(file: &Path, views: &str) -> Scenario {
    let text = include_str!("../../../launch_scripts/scenarios/people.toml");
    let record =
        format!("duration_s = 60.0\nexecution = {{ threads = 1, record = {file:?} }}\nviews = {{ record = {views} }}");
    Scenario::parse("people.toml", &text.replace("duration_s = 900.0", &record), &[]).expect("a legal scenario")
}

#[test]
fn recordings_hold_obstacles_verify_and_fork() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [parent, forked] = ["parent.mcap", "fork.mcap"].map(|name| folder.path().join(name));
    let (options, stop) = (AgentOptions::default(), AtomicBool::new(false));
    let digest = |completed: CompletedRun| completed.outcome.digest;
    let recorded = digest(run_scenario(&people(&parent, "[]"), &options, &mut NullObserver, &stop).expect("a run"));
    let recording = Recording::open(&parent).expect("a recording");
    let poses = recording.messages().filter(|message| message.channel.topic == "/tf");
    let poses: Vec<TFMessage> = poses.map(|message| message.decode().expect("transforms")).collect();
    let x = |pose: &TFMessage| {
        let found = pose.transforms.iter().find(|one| one.child_frame_id == "obstacle_0").expect("it is there");
        found.transform.translation.x
    };
    assert!((x(&poses[0]) - 24.5).abs() < 1e-9 && x(&poses[20]) > 25.0, "{} {}", x(&poses[0]), x(&poses[20]));
    assert_eq!(verify(&recording).expect("it verifies").digest, recorded);
    let scenario = people(&forked, "[]");
    for at in [0, 999, 1000, 1001] {
        let again = fork(&recording, Tick(at), &scenario, &options, &mut NullObserver, &stop);
        assert_eq!(digest(again.expect("a fork")), recorded, "forked at {at}");
        assert!(std::fs::read(&parent).unwrap() == std::fs::read(&forked).unwrap(), "forked at {at}");
    }
}

/// What is recorded for observers is no part of the run.
#[test]
fn recordings_with_views_verify() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("run.mcap");
    let (options, stop) = (AgentOptions::default(), AtomicBool::new(false));
    let completed = run_scenario(&people(&file, "[\"all\"]"), &options, &mut NullObserver, &stop).expect("a run");
    let verified = verify(&Recording::open(&file).expect("a recording")).expect("it verifies");
    assert_eq!(verified.digest, completed.outcome.digest);
    assert!(verified.left_out > 0);
}

#[test]
fn obstacles_without_room_are_refused() {
    let refused = |path: &str| {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("map.txt");
        std::fs::write(&file, format!("cell_m = 1\n{}", rooms().to_text())).unwrap();
        let keys = keys("rbw", CART).replace("[[5.5, 4.6, 1.6], [24.5, 4.6, 1.6]]", path);
        let text = format!("seed = 1\nmap = {{ kind = \"file\", file = {file:?} }}\n{keys}");
        setup::build(&Scenario::parse("s.toml", &text, &[]).unwrap()).unwrap_err().to_string()
    };
    let wall = refused("[[5.5, 4.6, 1.6], [24.5, 4.4, 1.6]]");
    assert!(wall.starts_with("obstacle[0].path: from [5.5, 4.6, 1.6] m to the next point it meets a wall"), "{wall}");
    let agent = refused("[[1.6, 1.6, 1.6], [5.5, 1.6, 1.6]]");
    assert!(agent.starts_with("obstacle[0].path: it begins at [1.6, 1.6, 1.6] m, where agent 0 starts"), "{agent}");
}
