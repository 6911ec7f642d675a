//! Rays per second of the LiDAR, marking of seen cells included, on one core: 100^3 spheres map at
//! 20 % fill, 5124 rays, unlimited range. Run with `cargo bench -p simulation --bench lidar`.
//!
//! "known" is the common case of a run: everything has been seen before. "exploring" is the first
//! 200 scans of an agent at random poses. "first" is one scan by an agent that has seen nothing
//! yet.

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use mapgen::{MapSpec, SpheresSpec, generate};
use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use voxels::{Extent, Grid, Terrain};
use world::body::Pose;
use world::lidar::{Pattern, Scanner, SensorMemory};

const SEED: u64 = 1;
const POSES: usize = 200;

/// Random places in free space.
fn poses(terrain: &Grid<Terrain>) -> Vec<Pose> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let free: Vec<_> = terrain.iter().filter(|&(_, &terrain)| terrain == Terrain::Free).map(|(cell, _)| cell).collect();
    let cell_m = terrain.extent().cell_m();
    let pose = |_| {
        let cell = free[rng.random_range(0..free.len())];
        let corner = Vector3::new(f64::from(cell.x), f64::from(cell.y), f64::from(cell.z));
        let inside = Vector3::new(rng.random(), rng.random(), rng.random());
        Pose { position: Point3::from((corner + inside) * cell_m), yaw_rad: 0.0 }
    };
    (0..POSES).map(pose).collect()
}

fn lidar(criterion: &mut Criterion) {
    let extent = Extent::new([100; 3], 1.0).expect("a legal size");
    let spec = MapSpec::Spheres(SpheresSpec::default());
    let terrain = generate(&spec, extent, SEED).expect("a legal spec").terrain;
    let poses = poses(&terrain);
    let scanner = Scanner::new(Pattern::Lattice { rays: 5124 }, f64::INFINITY, TAU);
    let fresh = SensorMemory::new(&terrain);
    let (mut free, mut wall) = (Vec::new(), Vec::new());
    let mut scan = |memory: &mut SensorMemory, poses: &[Pose]| {
        free.clear();
        wall.clear();
        for pose in poses {
            scanner.scan(memory, pose, &mut free, &mut wall);
        }
        black_box((free.len(), wall.len()))
    };

    let mut group = criterion.benchmark_group("lidar");
    group.throughput(Throughput::Elements(u64::from(scanner.rays()) * POSES as u64));
    let mut known = fresh.clone();
    scan(&mut known, &poses);
    group.bench_function("known", |bencher| bencher.iter(|| scan(&mut known, &poses)));
    group.bench_function("exploring", |bencher| {
        bencher.iter_batched_ref(|| fresh.clone(), |memory| scan(memory, &poses), BatchSize::LargeInput);
    });
    group.throughput(Throughput::Elements(u64::from(scanner.rays())));
    let mut turn = 0;
    group.bench_function("first", |bencher| {
        bencher.iter_batched_ref(
            || {
                turn = (turn + 1) % POSES;
                (fresh.clone(), turn)
            },
            |(memory, turn)| scan(memory, &poses[*turn..=*turn]),
            BatchSize::SmallInput,
        );
    });
    group.finish();
}

criterion_group!(benches, lidar);
criterion_main!(benches);
