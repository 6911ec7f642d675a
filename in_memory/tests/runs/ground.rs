//! Complete runs of ground bodies: every controller explores what they can see, and the run ends;
//! stairs lead one kind on and not the other.

use crate::support::{fill, result, solid};
use voxels::{Grid, Terrain};

/// Two rooms, the second one two steps higher, with a window between them above the stairs, and a
/// gallery along one wall that no ground body reaches.
fn rooms() -> Grid<Terrain> {
    let mut rooms = solid([26, 12, 10], 1.0);
    fill(&mut rooms, [1..11, 1..11, 1..7], Terrain::Free);
    fill(&mut rooms, [11..14, 5..8, 2..6], Terrain::Free);
    fill(&mut rooms, [14..25, 1..11, 3..8], Terrain::Free);
    fill(&mut rooms, [1..11, 1..3, 1..4], Terrain::Wall);
    rooms
}

fn keys(controller: &str, body: &str) -> String {
    format!(
        "duration_s = 600.0\nlidar = {{ range_m = 8.0 }}\nagents = {{ count = 2, controller = \"{controller}\" }}\n\
         spawn = {{ kind = \"list\", poses = [[3.5, 8.5, 4.5], [5.5, 5.5, 1.5]] }}\nbody = {{ kind = \"ground\", {body} }}\n"
    )
}

const LEGS: &str = "step_max_m = 1.0";
const WHEELS: &str = "step_max_m = 0.1, slope_max_rad = 0.0, drive = \"holonomic\"";

#[test]
fn every_controller_explores_what_ground_bodies_see() {
    let rooms = rooms();
    // What lvd-maes3d decides takes seconds of wall time on a map of this size.
    for controller in agent_node::controllers::NAMES.into_iter().filter(|&name| name != "lvd-maes3d") {
        let result = result(&rooms, &keys(controller, LEGS));
        assert!(result.distance_m.iter().sum::<f64>() > 10.0, "{controller}: {:?}", result.distance_m);
        // Those that do not look for a way up see one room for sure.
        let least = if ["rbw", "rbw-maes3d", "c2-explorer"].contains(&controller) { 0.5 } else { 0.99 };
        assert!(result.explored >= least, "{controller}: {} as {}", result.explored, result.reason);
    }
}

#[test]
fn wheels_stay_below_the_stairs() {
    let rooms = rooms();
    for controller in ["nearest-frontier", "dsvp", "dsvp-team"] {
        let [legs, wheels] = [LEGS, WHEELS].map(|body| result(&rooms, &keys(controller, body)));
        assert!(wheels.explored < legs.explored, "{controller}: {} and {}", wheels.explored, legs.explored);
        assert!(wheels.tick < 30_000, "{controller}: {} after {}", wheels.reason, wheels.tick);
    }
}

#[test]
fn ring_lidars_on_ground_bodies_do_not_go_to_and_fro() {
    let rooms = rooms();
    for controller in ["nearest-frontier", "dsvp", "dsvp-team", "hungarian", "rendezvous", "racer", "c2-explorer"] {
        let lidar = "lidar = { preset = \"vlp-16\", columns = 360, range_m = 20.0, mount_height_m = 0.1 }";
        let keys = keys(controller, LEGS).replace("lidar = { range_m = 8.0 }", lidar).replace("count = 2", "count = 1");
        let result = result(&rooms, &keys.replace(", [5.5, 5.5, 1.5]", ""));
        let distance_m = result.distance_m[0];
        assert!(distance_m < 200.0 && result.explored > 0.89, "{controller}: {distance_m} m, {}", result.explored);
    }
}

/// The least share that a body sees of a map in this many seconds.
fn explored(map: &str, body: &str, duration_s: f64) -> f64 {
    use in_memory::in_process::{AgentOptions, run};
    let text = format!(
        "seed = 1\nduration_s = {duration_s:?}\nmap = {{ {map} }}\nagents = {{ count = 1, controller = \"nearest-frontier\" }}\n\
         body = {{ kind = \"ground\", {body} }}\nexecution = {{ threads = 1 }}\n"
    );
    let scenario = simulation::scenario::Scenario::parse("the test's scenario", &text, &[]).expect("a legal scenario");
    let is_stopped = std::sync::atomic::AtomicBool::new(false);
    let completed = run(&scenario, &AgentOptions::default(), &mut sim_server::session::NullObserver, &is_stopped);
    completed.expect("the run has a result").outcome.result.explored
}

#[test]
fn stairs_of_a_building_are_for_legs_alone() {
    const BUILDING: &str = "kind = \"building\", size = [30, 30, 9], building = { floors = 2 }";
    let [legs, wheels] = [LEGS, WHEELS].map(|body| explored(BUILDING, body, 900.0));
    assert!(legs > 0.9 && wheels < 0.7, "{legs} and {wheels}");
}
