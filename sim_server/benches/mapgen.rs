//! How long maps take to make, with the default parameters of each generator; the difference between spheres and
//! unsmoothed spheres is five passes of smoothing.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use sim_server::mapgen::{MapSpec, NoiseSpec, SpheresSpec, generate};
use voxels::Extent;

fn mapgen(criterion: &mut Criterion) {
    let spheres = MapSpec::Spheres(SpheresSpec::default());
    let noise = MapSpec::Noise(NoiseSpec::default());
    let rough = MapSpec::Spheres(SpheresSpec { smoothing: 0, ..SpheresSpec::default() });
    for side in [50, 100] {
        let extent = Extent::new([side; 3], 1.0).expect("a legal size");
        for (name, spec) in [("spheres", &spheres), ("noise", &noise), ("spheres unsmoothed", &rough)] {
            criterion.bench_function(&format!("mapgen {name} {side}^3"), |bencher| {
                bencher.iter(|| generate(black_box(spec), extent, black_box(7)).expect("a legal spec"));
            });
        }
    }
}

criterion_group!(benches, mapgen);
criterion_main!(benches);
