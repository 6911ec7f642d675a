//! Wall time of choosing start poses in a large cave.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use mapgen::{MapSpec, SpheresSpec, generate};
use protocol::body_model::BodyModel;
use voxels::Extent;
use world::spawn::{Site, SpawnSpec};

fn spawn(criterion: &mut Criterion) {
    let extent = Extent::new([512; 3], 1.0).expect("a legal size");
    let cave = generate(&MapSpec::Spheres(SpheresSpec::default()), extent, 7).expect("a legal spec");
    let site = Site { terrain: &cave.terrain, entrances: &[], seed: 7 };
    let scattered = |min_distance_m| SpawnSpec::Scattered { min_distance_m, seed: None, yaw_rad: 0.0 };
    let mut group = criterion.benchmark_group("spawn 512^3");
    group.sample_size(10);
    for (name, spec, agents) in [
        ("nearest_origin, 20 agents", SpawnSpec::NearestOrigin { yaw_rad: 0.0 }, 20),
        ("nearest_origin, 1000 agents", SpawnSpec::NearestOrigin { yaw_rad: 0.0 }, 1000),
        ("scattered, 1000 agents", scattered(5.0), 1000),
        ("scattered, 1000 agents that do not fit", scattered(100.0), 1000),
    ] {
        let team = vec![BodyModel::SUBMARINE; agents];
        group.bench_function(name, |bencher| bencher.iter(|| black_box(&spec).poses(&site, &team)));
    }
}

criterion_group!(benches, spawn);
criterion_main!(benches);
