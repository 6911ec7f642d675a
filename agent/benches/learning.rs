//! Wall time of learning a cave (the tunnels of a gyroid, 100^3 cells, about a fifth of them free),
//! outwards from its middle in observations of 500 cells; and the same with the abstract graph
//! updated after each. Run with `cargo bench -p agent_node --no-default-features --bench learning`.

use std::hint::black_box;

use agent::abstract_graph::AbstractGraph;
use agent::exploration_map::ExplorationMap;
use agent::path::{Graph, Moves, Neighbours};
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Point3;
use voxels::{Cell, Extent};

const SIDE: u32 = 100;
/// Wave length of the gyroid, cells, over 2 pi.
const SCALE: f64 = 4.0;
/// The cells below this value are free.
const LEVEL: f64 = -0.8;
const RADIUS_M: f64 = 0.4;
const CELLS_EACH: usize = 500;

/// New free cells and new walls, by index.
type Seen = (Vec<u32>, Vec<u32>);

fn is_free(cell: Cell) -> bool {
    let [(sin_x, cos_x), (sin_y, cos_y), (sin_z, cos_z)] =
        [cell.x, cell.y, cell.z].map(|at| libm::sincos(f64::from(at) / SCALE));
    sin_x * cos_y + sin_y * cos_z + sin_z * cos_x < LEVEL
}

fn learning(criterion: &mut Criterion) {
    let extent = Extent::new([SIDE; 3], 1.0).expect("a legal size");
    let middle = Point3::from([f64::from(SIDE) / 2.0; 3]);
    let mut cells: Vec<usize> = (0..extent.volume()).collect();
    let from_middle_m = |&cell: &usize| (extent.centre(extent.cell_at(cell)) - middle).norm();
    cells.sort_by(|one, other| from_middle_m(one).total_cmp(&from_middle_m(other)));
    let observation = |cells: &[usize]| -> Seen {
        cells.iter().map(|&cell| cell as u32).partition(|&cell| is_free(extent.cell_at(cell as usize)))
    };
    let observations: Vec<Seen> = cells.chunks(CELLS_EACH).map(observation).collect();
    let moves = Moves::new(RADIUS_M, extent.cell_m(), Neighbours::TwentySix);
    let fresh = || (ExplorationMap::new(extent), AbstractGraph::new(extent, RADIUS_M));

    let mut group = criterion.benchmark_group("learning");
    group.sample_size(20);
    group.throughput(Throughput::Elements(extent.volume() as u64));
    for (name, has_graph) in [("map", false), ("map and graph", true)] {
        let learn = |(map, graph): &mut (ExplorationMap, AbstractGraph)| {
            for (free, wall) in &observations {
                map.note_free(free);
                map.note_wall(wall);
                if has_graph {
                    graph.update(Graph::new(map, &moves));
                }
            }
            black_box(map.frontier_count())
        };
        group.bench_function(name, |bencher| bencher.iter_batched_ref(fresh, learn, BatchSize::LargeInput));
    }
    group.finish();
}

criterion_group!(benches, learning);
criterion_main!(benches);
