//! Maps made of boxes, and the results of runs on them.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use in_memory::in_process::{AgentOptions, ThreadLayout, run};
use msgs::maes_msgs::Result as RunResult;
use sim_server::session::NullObserver;
use simulation::scenario::Scenario;
use voxels::{Cell, Extent, Grid, Terrain};

/// A solid map.
pub(crate) fn solid(size: [u32; 3], cell_m: f64) -> Grid<Terrain> {
    Grid::new(Extent::new(size, cell_m).expect("a legal size"), Terrain::Wall)
}

/// Sets a box of cells.
pub(crate) fn fill(terrain: &mut Grid<Terrain>, [x, y, z]: [Range<i32>; 3], to: Terrain) {
    for (x, y, z) in z.flat_map(|z| {
        y.clone().flat_map({
            let x = x.clone();
            move |y| x.clone().map(move |x| (x, y, z))
        })
    }) {
        terrain.set(Cell::new(x, y, z), to);
    }
}

/// The result of a scenario on a map; `keys` are lines of the scenario. The seed is 1 unless the
/// first of them has another one.
pub(crate) fn result(terrain: &Grid<Terrain>, keys: &str) -> RunResult {
    result_with(terrain, keys, "execution = { threads = 1 }")
}

/// [`result`] of a run that is executed as this line says.
pub(crate) fn result_with(terrain: &Grid<Terrain>, keys: &str, execution: &str) -> RunResult {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("map.txt");
    let text = format!("cell_m = {}\n{}", terrain.extent().cell_m(), terrain.to_text());
    std::fs::write(&file, text).expect("a map file");
    let seed = if keys.starts_with("seed = ") { "" } else { "seed = 1\n" };
    let scenario = format!("{seed}map = {{ kind = \"file\", file = {file:?} }}\n{execution}\n{keys}");
    let scenario = Scenario::parse("the test's scenario", &scenario, &[]).expect("a legal scenario");
    let options = AgentOptions { threads: ThreadLayout::Together, ..AgentOptions::default() };
    let completed = run(&scenario, &options, &mut NullObserver, &AtomicBool::new(false)).expect("the run has a result");
    let result = completed.outcome.result;
    let refused = result.counters.iter().filter(|one| one.is_refusal() && one.value > 0);
    assert_eq!(refused.count(), 0, "{:?}", result.counters);
    result
}
