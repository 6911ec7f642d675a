//! Rays per second of `voxels::walk` and segments per second of `line_of_sight` in a cave of
//! spheres; run with `cargo bench -p voxels`.

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Point3, Vector3};
use voxels::{Cell, Extent, Grid, Terrain, is_wall_at, line_of_sight, walk};

const SIZE: u32 = 100;
const RAYS: usize = 5124;
const ORIGINS: usize = 64;

/// A fixed sequence of numbers in 0 to 1 (a Weyl sequence with a mixing step).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn point(&mut self, low: f64, high: f64) -> Point3<f64> {
        let mut along = || low + (high - low) * self.next();
        Point3::new(along(), along(), along())
    }
}

/// Spheres of 3 to 8 cells in rock until a fifth of the map is free.
fn cave(numbers: &mut Numbers) -> Grid<Terrain> {
    let extent = Extent::new([SIZE; 3], 1.0).expect("the size is legal");
    let mut terrain = Grid::new(extent, Terrain::Wall);
    let mut free = 0;
    while free * 5 < extent.volume() {
        let radius = 3.0 + (numbers.next() * 6.0).floor();
        let centre = numbers.point(radius + 2.0, f64::from(SIZE) - radius - 2.0);
        let reach = radius as i32 + 1;
        let middle = extent.cell_of(&centre);
        for z in -reach..=reach {
            for y in -reach..=reach {
                for x in -reach..=reach {
                    let cell = middle + Cell::new(x, y, z);
                    if (extent.centre(cell) - centre).norm_squared() <= radius * radius
                        && terrain.set(cell, Terrain::Free) == Some(Terrain::Wall)
                    {
                        free += 1;
                    }
                }
            }
        }
    }
    terrain
}

fn directions(numbers: &mut Numbers) -> Vec<Vector3<f64>> {
    (0..RAYS).map(|_| (numbers.point(-1.0, 1.0).coords).normalize()).collect()
}

fn traverse(criterion: &mut Criterion) {
    let mut numbers = Numbers(7);
    let terrain = cave(&mut numbers);
    let extent = terrain.extent();
    let directions = directions(&mut numbers);
    let mut origins = Vec::new();
    while origins.len() < ORIGINS {
        let point = numbers.point(0.0, f64::from(SIZE));
        if !is_wall_at(&terrain, extent.cell_of(&point)) {
            origins.push(point);
        }
    }

    let mut group = criterion.benchmark_group("traverse");
    let mut turn = 0;
    group.throughput(Throughput::Elements(RAYS as u64));
    group.bench_function("walk to the first wall", |bencher| {
        bencher.iter(|| {
            turn = (turn + 1) % ORIGINS;
            let mut cells = 0u64;
            for direction in &directions {
                let _ = walk(extent, &origins[turn], direction, f64::INFINITY, |cell, _| {
                    cells += 1;
                    if is_wall_at(&terrain, cell) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                });
            }
            black_box(cells)
        });
    });
    group.throughput(Throughput::Elements(ORIGINS as u64));
    group.bench_function("line of sight", |bencher| {
        bencher.iter(|| {
            turn = (turn + 1) % ORIGINS;
            let here = &origins[turn];
            origins.iter().filter(|there| line_of_sight(&terrain, here, there)).count()
        });
    });
    group.finish();
}

criterion_group!(benches, traverse);
criterion_main!(benches);
