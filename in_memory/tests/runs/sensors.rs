//! Complete runs of bodies that do not see all around: controllers turn, and look at what is above
//! and below them from elsewhere, until all is explored.

use crate::support::{fill, result, result_with, solid};
use voxels::{Grid, Terrain};

/// Controllers that see all of a hall with depth cameras and with rings, and rest then.
const PLANNERS: [&str; 8] =
    ["nearest-frontier", "dsvp", "dsvp-auction", "dsvp-team", "hungarian", "rendezvous", "racer", "c2-explorer"];

/// Two halls of 12 x 10 x 6 cells with a passage between them.
fn halls() -> Grid<Terrain> {
    let mut halls = solid([34, 12, 8], 0.5);
    fill(&mut halls, [1..13, 1..11, 1..7], Terrain::Free);
    fill(&mut halls, [13..21, 4..8, 2..6], Terrain::Free);
    fill(&mut halls, [21..33, 1..11, 1..7], Terrain::Free);
    halls
}

fn keys(controller: &str, lidar: &str, kind: &str) -> String {
    format!(
        "duration_s = 900.0\nbody = {{ kind = \"{kind}\", radius_m = 0.2 }}\n{}\n\
         agents = {{ count = 2, controller = \"{controller}\" }}\n",
        if lidar.starts_with("lidars") { lidar.to_owned() } else { format!("lidar = {{ {lidar} }}") }
    )
}

/// A ring on each body, and a camera that looks up on the first one.
const BOTH: &str = "lidars = [\
    { name = \"top\", preset = \"vlp-16\", columns = 360, range_m = 20.0, mount_height_m = 0.1 }, \
    { name = \"eye\", agents = [0], preset = \"depth-camera\", mount_pitch_rad = 0.6 }]";

const CAMERA: &str = "preset = \"depth-camera\"";
const RING: &str = "preset = \"vlp-16\", columns = 360, range_m = 20.0, mount_height_m = 0.1";

#[test]
fn planners_explore_all_that_they_can_see() {
    let halls = halls();
    for controller in PLANNERS {
        for (lidar, kind) in [(CAMERA, "aerial"), (CAMERA, "submarine"), (RING, "aerial"), (BOTH, "aerial")] {
            let result = result(&halls, &keys(controller, lidar, kind));
            let text = format!("{controller}, {lidar}, {kind}: {}, {}", result.reason, result.explored);
            assert!(result.explored > 0.99 && result.reason != "duration", "{text}");
        }
    }
}

#[test]
fn look_ahead_and_threads_do_not_change_the_run() {
    let halls = halls();
    for (controller, lidar) in
        [("nearest-frontier", CAMERA), ("dsvp-team", RING), ("rbw", CAMERA), ("lvd", CAMERA), ("dsvp-team", BOTH)]
    {
        let keys = keys(controller, lidar, "aerial").replace("900.0", "60.0");
        let expected = result(&halls, &keys);
        for execution in ["look_ahead = false, threads = 1", "threads = 4"] {
            let other = result_with(&halls, &keys, &format!("execution = {{ {execution} }}"));
            assert_eq!(other.digest, expected.digest, "{controller}, {lidar}, {execution}");
        }
    }
}

#[test]
fn cameras_see_less_than_lidars() {
    let halls = halls();
    let explored = |lidar: &str| {
        let keys = keys("rbw", lidar, "aerial").replace("900.0", "0.02");
        result(&halls, &keys).explored
    };
    let (camera, ring, lattice) = (explored(CAMERA), explored(RING), explored("range_m = 20.0"));
    assert!(0.0 < camera && camera < ring && ring < lattice, "{camera}, {ring}, {lattice}");
    let both = explored(BOTH);
    assert!(ring < both && both < lattice, "{both}");
}
