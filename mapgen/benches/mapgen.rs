//! Wall time of map generation, with the default parameters of each generator. The difference
//! between spheres and unsmoothed spheres is five passes of smoothing.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use mapgen::{BuildingSpec, MapSpec, NoiseSpec, SpheresSpec, generate};
use voxels::Extent;

fn mapgen(criterion: &mut Criterion) {
    let spheres = MapSpec::Spheres(SpheresSpec::default());
    let noise = MapSpec::Noise(NoiseSpec::default());
    let rough = MapSpec::Spheres(SpheresSpec { smoothing: 0, ..SpheresSpec::default() });
    let building = MapSpec::Building(BuildingSpec::default());
    let tower = MapSpec::Building(BuildingSpec { floors: 127, ..BuildingSpec::default() });
    for (name, spec, size) in [
        ("spheres 50^3", &spheres, [50; 3]),
        ("noise 50^3", &noise, [50; 3]),
        ("spheres unsmoothed 50^3", &rough, [50; 3]),
        ("spheres 100^3", &spheres, [100; 3]),
        ("noise 100^3", &noise, [100; 3]),
        ("spheres unsmoothed 100^3", &rough, [100; 3]),
        ("building 60x60x13", &building, [60, 60, 13]),
        ("spheres 512^3", &spheres, [512; 3]),
        ("noise 512^3", &noise, [512; 3]),
        ("building of 127 floors 512^3", &tower, [512; 3]),
    ] {
        let extent = Extent::new(size, 1.0).expect("a legal size");
        let mut group = criterion.benchmark_group("mapgen");
        if extent.volume() > 1 << 24 {
            group.sample_size(10);
        }
        group.bench_function(name, |bencher| {
            bencher.iter(|| generate(black_box(spec), extent, black_box(7)).expect("a legal spec"));
        });
    }
}

criterion_group!(benches, mapgen);
criterion_main!(benches);
