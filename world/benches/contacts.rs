//! Wall time of the contacts of a team of 100 in one tick: 100^3 spheres map at 20 % fill, line of
//! sight, each agent asks for its contacts. Run with `cargo bench -p simulation --bench contacts`.
//!
//! "first" knows nothing of the pairs. "moving" has all agents walk to and fro by a tenth of a cell
//! each tick, "one moves" only one of them.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use mapgen::{MapSpec, SpheresSpec, generate};
use msgs::ids::AgentId;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use voxels::{Extent, Grid, OpenSpace, Terrain};
use world::comms::{ContactModel, ContactRules, ContactTable, Radio};

const SEED: u64 = 1;
const AGENTS: usize = 100;
const STEP_M: f64 = 0.1;
const MODEL: ContactModel = ContactModel::LineOfSightAndRange { range_m: f64::INFINITY };

/// Radios in the middle of random free cells.
fn radios(terrain: &Grid<Terrain>) -> Vec<Radio> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let free: Vec<_> = terrain.iter().filter(|&(_, &terrain)| terrain == Terrain::Free).map(|(cell, _)| cell).collect();
    let radio = |_| {
        let position = terrain.extent().centre(free[rng.random_range(0..free.len())]);
        Radio { position, is_on_air: true }
    };
    (0..AGENTS).map(radio).collect()
}

fn ask_all(table: &mut ContactTable, rules: ContactRules<'_>) -> usize {
    (0..AGENTS).map(|agent| table.of(AgentId::from_index(agent), rules).count()).sum()
}

fn contacts(criterion: &mut Criterion) {
    let extent = Extent::new([100; 3], 1.0).expect("a legal size");
    let spec = MapSpec::Spheres(SpheresSpec::default());
    let terrain = generate(&spec, extent, SEED).expect("a legal spec").terrain;
    let open_space = OpenSpace::of(&terrain);
    let rules = ContactRules { model: &MODEL, terrain: &terrain, open_space: &open_space };
    let radios = radios(&terrain);

    let mut group = criterion.benchmark_group("contacts");
    group.throughput(Throughput::Elements((AGENTS * (AGENTS - 1) / 2) as u64));
    group.bench_function("first", |bencher| {
        let fresh = || ContactTable::new(radios.clone(), Vec::new());
        bencher.iter_batched_ref(fresh, |table| black_box(ask_all(table, rules)), BatchSize::SmallInput);
    });
    for (name, moving) in [("moving", AGENTS), ("one moves", 1)] {
        let mut table = ContactTable::new(radios.clone(), Vec::new());
        let mut is_forth = false;
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                is_forth = !is_forth;
                let by_m = if is_forth { STEP_M } else { 0.0 };
                let walk = |(agent, radio): (usize, &Radio)| {
                    let mut radio = *radio;
                    radio.position.x += if agent < moving { by_m } else { 0.0 };
                    radio
                };
                table.update(radios.iter().enumerate().map(walk), Vec::new());
                black_box(ask_all(&mut table, rules))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, contacts);
criterion_main!(benches);
