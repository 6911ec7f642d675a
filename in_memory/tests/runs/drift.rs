//! Complete runs with localisation that drifts: every controller explores on a displaced map, and
//! the figures are those of the noise.

use crate::support::{fill, result, result_with, solid};
use msgs::counters::CounterName;
use msgs::maes_msgs::Result as RunResult;
use voxels::{Grid, Terrain};

/// A ring of passages of 3 x 3 cells with rooms at its corners.
fn ring() -> Grid<Terrain> {
    let mut ring = solid([44, 44, 7], 1.0);
    for at in [2, 34] {
        fill(&mut ring, [2..42, at + 2..at + 5, 2..5], Terrain::Free);
        fill(&mut ring, [at + 2..at + 5, 2..42, 2..5], Terrain::Free);
        for other in [2, 34] {
            fill(&mut ring, [at..at + 8, other..other + 8, 1..6], Terrain::Free);
        }
    }
    ring
}

/// Some cells after a round.
const NOISE: &str = "localisation = { position_noise_m = 0.15, position_bias = 0.03, heading_bias_rad_per_m = 0.001, \
                     closure_range_m = 3.0 }";

fn keys(controller: &str, more: &str) -> String {
    format!(
        "duration_s = 600.0\nlidar = {{ range_m = 9.0 }}\nagents = {{ count = 3, controller = \"{controller}\" }}\n{more}\n"
    )
}

fn count(result: &RunResult, name: CounterName) -> u64 {
    result.counter(name).unwrap_or_else(|| panic!("{name} in {:?}", result.counters))
}

#[test]
fn every_controller_explores_on_a_map_that_drifts() {
    let ring = ring();
    // What lvd-maes3d decides takes seconds of wall time on a map of this size.
    for controller in agent_node::controllers::NAMES.into_iter().filter(|&name| name != "lvd-maes3d") {
        let exact = result(&ring, &keys(controller, ""));
        let drifting = result(&ring, &keys(controller, NOISE));
        assert_eq!(exact.counter(CounterName::PositionError), None);
        assert!(
            drifting.explored > 0.8 * exact.explored,
            "{controller}: {} of {} in {} ticks ({})",
            drifting.explored,
            exact.explored,
            drifting.tick,
            drifting.reason
        );
        assert!(count(&drifting, CounterName::MapBlocks) > 0, "{controller}");
        assert!(count(&drifting, CounterName::PositionError) > 0, "{controller}");
    }
}

#[test]
fn look_ahead_and_threads_do_not_change_the_run() {
    let ring = ring();
    let keys = keys("dsvp-team", NOISE);
    let expected = result(&ring, &keys);
    for execution in ["look_ahead = false, threads = 1", "threads = 4"] {
        let other = result_with(&ring, &keys, &format!("execution = {{ {execution} }}"));
        assert_eq!(other.digest, expected.digest, "{execution}");
    }
}

#[test]
fn errors_grow_with_the_noise() {
    let ring = ring();
    let error_m = |scale: f64| {
        let noise =
            format!("localisation = {{ position_noise_m = {}, position_bias = {} }}", 0.05 * scale, 0.02 * scale);
        let result = result(&ring, &keys("rbw", &noise));
        let cells = count(&result, CounterName::MapCells);
        let off = [CounterName::MapCellsOffBy1, CounterName::MapCellsOffBy2, CounterName::MapCellsOffByMore];
        let off: u64 = off.into_iter().map(|name| count(&result, name)).sum();
        (count(&result, CounterName::PositionError) as f64 / 1e6, off as f64 / cells as f64)
    };
    let (small, large) = (error_m(0.5), error_m(4.0));
    assert!(small.0 < large.0 && small.1 < large.1, "{small:?} {large:?}");
}
