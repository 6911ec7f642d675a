//! Wall time of a path search across a cave of spheres (100^3 cells, a fifth of them free, all
//! known), and of straightening its path; run with `cargo bench -p agent_node --no-default-features
//! --bench path`.

use std::hint::black_box;

use agent::exploration_map::{CellState, ExplorationMap};
use agent::path::{Goal, Graph, Moves, Neighbours, Path, Search, find, straighten};
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Point3;
use rand::RngExt;
use voxels::{Cell, Extent, Grid, Terrain, keep_largest_component};

const SIDE: u32 = 100;
const RADIUS_M: f64 = 0.4;

/// Spheres with radii of 3 to 8 cells in rock until a fifth of the map is free; only the largest
/// connected component is kept.
fn cave() -> ExplorationMap {
    let extent = Extent::new([SIDE; 3], 1.0).expect("a legal size");
    let mut rng = voxels::random_streams::stream(7, 0, "bench.cave");
    let mut terrain = Grid::new(extent, Terrain::Wall);
    let mut free = 0;
    while free * 5 < extent.volume() {
        let radius = f64::from(rng.random_range(3..=8));
        let mut along = || rng.random_range(radius + 2.0..f64::from(SIDE) - radius - 2.0);
        let centre = Point3::new(along(), along(), along());
        for (index, cell) in extent.cells().enumerate() {
            if (extent.centre(cell) - centre).norm_squared() <= radius * radius && terrain[index] == Terrain::Wall {
                terrain[index] = Terrain::Free;
                free += 1;
            }
        }
    }
    keep_largest_component(&mut terrain);
    let cells = |wanted: Terrain| -> Vec<u32> {
        (0..).zip(terrain.as_slice()).filter(|&(_, &is)| is == wanted).map(|(index, _)| index).collect()
    };
    let mut map = ExplorationMap::new(extent);
    map.note_free(&cells(Terrain::Free));
    map.note_wall(&cells(Terrain::Wall));
    map
}

fn path(criterion: &mut Criterion) {
    let map = cave();
    let extent = map.extent();
    let free = || extent.cells().filter(|&cell| map.state(cell) == CellState::Free);
    let sum = |cell: &Cell| cell.x + cell.y + cell.z;
    let start = free().min_by_key(sum).expect("a cave has free cells");
    let goal = free().max_by_key(sum).expect("a cave has free cells");
    let nowhere = |_| false;
    let mut found: Option<Path> = None;
    for (name, neighbours) in [("6", Neighbours::Six), ("26", Neighbours::TwentySix)] {
        let moves = Moves::new(RADIUS_M, extent.cell_m(), neighbours);
        let graph = Graph::new(&map, &moves);
        for (what, wanted) in [("across", Goal::Cell(goal)), ("everywhere", Goal::Where(&nowhere))] {
            let mut search = Search::new(graph, start, wanted);
            let path = search.run();
            let cells = path.as_ref().map_or(0, |path| path.cells.len());
            eprintln!("{name} neighbours, {what}: {} expansions, {cells} cells", search.expansions());
            found = path.or(found);
            criterion.bench_function(&format!("path {name} neighbours {what}"), |bencher| {
                bencher.iter(|| find(graph, black_box(start), wanted));
            });
        }
        let path = found.as_ref().expect("the cave hangs together");
        eprintln!("{name} neighbours, straightened: {} waypoints", straighten(path, &map, RADIUS_M).len());
        criterion.bench_function(&format!("path {name} neighbours straighten"), |bencher| {
            bencher.iter(|| straighten(black_box(path), &map, RADIUS_M));
        });
    }
}

criterion_group!(benches, path);
criterion_main!(benches);
