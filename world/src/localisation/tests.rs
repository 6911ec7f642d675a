use std::collections::BTreeMap;
use std::f64::consts::TAU;

use proptest::prelude::*;
use protocol::body_model::{BodyKind, BodyModel};
use protocol::command::Command;
use protocol::observation::{Observation, RequestKind};
use protocol::scan_request::ScanRequest;
use protocol::wake_condition::WakeCondition;
use voxels::{Cell, Grid};

use super::super::comms::{Comms, ContactModel};
use super::super::lidar::{Pattern, Scanner};
use super::super::map_change::CellBox;
use super::super::{ScanSchedule, WorldParams};
use super::*;
use crate::workers::Workers;

const A: AgentId = AgentId(0);
const B: AgentId = AgentId(1);

/// Odometry that measures all distances in a wrong scale, whose bias the seed draws.
fn biased(position_bias: f64) -> OdometryNoise {
    OdometryNoise { position_bias, seed: 1, ..OdometryNoise::default() }
}

fn params(odometry: OdometryNoise) -> WorldParams {
    WorldParams {
        schedule: ScanSchedule::OnRequest { period_ticks: 5 },
        odometry,
        ..WorldParams::new(
            BodyModel::of(BodyKind::Aerial),
            Scanner::new(Pattern::Lattice { rays: 1000 }, 12.0, TAU),
            Comms::perfect(ContactModel::LineOfSightAndRange { range_m: f64::INFINITY }),
        )
    }
}

/// A hall of 60 x 12 x 6 cells of 1 m with pillars.
fn hall() -> Grid<Terrain> {
    let mut hall = Grid::new(Extent::new([60, 12, 6], 1.0).unwrap(), Terrain::Free);
    voxels::close_shell(&mut hall, 1);
    for x in (6..55).step_by(7) {
        for z in 1..5 {
            hall.set(Cell::new(x, 6, z), Terrain::Wall);
        }
    }
    hall
}

fn at(x: f64, y: f64) -> Pose {
    Pose { position: Point3::new(x, y, 2.5), yaw_rad: 0.0 }
}

fn command(motion: Motion) -> Command {
    Command::new(motion, WakeCondition::NEXT_TICK)
}

/// Steps until the body is at rest; hands over the observation of each tick.
fn go(world: &mut World, agent: AgentId, motion: Motion, mut take: impl FnMut(&World, Observation)) {
    let workers = Workers::new(1).unwrap();
    world.sense(&workers);
    world.step([(agent, command(motion))].into());
    while world.body(agent).is_active() {
        world.sense(&workers);
        let observation = world.observe(agent, RequestKind::Scheduled);
        take(world, observation);
        world.step(BTreeMap::new());
    }
}

fn to(x: f64, y: f64) -> Motion {
    Motion::Path(vec![at(x, y).position])
}

fn offset(world: &World, agent: AgentId) -> Vector3<f64> {
    world.frames(agent).unwrap().map_offset_m
}

#[test]
fn exact_odometry_is_no_localisation() {
    let world = World::new(hall(), params(OdometryNoise::default()), &[at(2.5, 2.5)]);
    assert_eq!((world.frames(A), world.drift_totals()), (None, None));
}

#[test]
fn agent_is_where_it_believes_on_the_map_of_its_present_block() {
    let mut world = World::new(hall(), params(biased(0.05)), &[at(2.5, 2.5)]);
    let extent = world.terrain().extent();
    let mut map: BTreeMap<u32, Terrain> = BTreeMap::new();
    let mut blocks = 0;
    let mut last = Vector3::zeros();
    go(&mut world, A, to(40.5, 2.5), |world, observation| {
        let offset = offset(world, A);
        if offset != last {
            (last, blocks) = (offset, blocks + 1);
            assert_eq!(observation.scan_tick, Some(observation.tick), "a block begins with a scan");
            assert!(observation.events.contains(EventMask::REVISED));
        }
        let truth = world.body(A).pose().position;
        assert_eq!(observation.pose.position, truth + offset);
        map.extend(observation.seen.free.iter().map(|&cell| (cell, Terrain::Free)));
        map.extend(observation.seen.wall.iter().map(|&cell| (cell, Terrain::Wall)));
        // Around the body the map is the world.
        let cell = extent.cell_of(&truth);
        for near in cell.neighbours6() {
            let by = |along: f64| along as i32;
            let believed = Cell::new(near.x + by(offset.x), near.y + by(offset.y), near.z + by(offset.z));
            let Some(believed) = extent.index(believed) else { continue };
            assert_eq!(map.get(&(believed as u32)), world.terrain().get(near), "{near:?} at {truth:?}");
        }
    });
    assert!(blocks > 0 && last.x != 0.0, "38 m with a bias of some percent");
    let totals = world.drift_totals().unwrap();
    assert_eq!(totals.blocks, blocks);
    assert!(totals.position_error_m > 0.0 && totals.position_error_m <= last.norm());
    let errors = totals.map_errors;
    assert!(errors.right > 0 && errors.off_by_1 > 0, "{errors:?}");
    // What is counted as explored is the truth, and each cell once.
    let seen_by = world.coverage().explored_by()[0];
    assert!((seen_by - world.coverage().explored()).abs() < 1e-12 && seen_by <= 1.0);
}

#[test]
fn waypoints_are_those_of_the_map_of_the_agent() {
    let mut world = World::new(hall(), params(biased(0.05)), &[at(2.5, 2.5)]);
    go(&mut world, A, to(40.5, 2.5), |_, _| {});
    let offset = offset(&world, A);
    assert_ne!(offset, Vector3::zeros());
    // Not far, so that the same block lasts.
    let goal = at(41.5, 3.5).position;
    go(&mut world, A, Motion::Path(vec![goal + offset]), |_, _| {});
    assert!((world.body(A).pose().position - goal).norm() < 1e-6);
}

#[test]
fn contacts_and_maps_of_others_are_in_the_own_map() {
    let mut world = World::new(hall(), params(biased(0.05)), &[at(2.5, 2.5), at(20.5, 4.5)]);
    go(&mut world, A, to(40.5, 2.5), |_, _| {});
    let own = offset(&world, A);
    let seen = world.observe(A, RequestKind::Scheduled);
    let there = world.body(B).pose().position;
    assert_eq!((seen.contacts[0].agent, seen.contacts[0].position), (B, there + own));
    assert_eq!(seen.map_frames, [MapFrame { agent: B, origin: Point3::from(own) }]);
    let by_other = world.observe(B, RequestKind::Scheduled);
    assert_eq!(by_other.contacts[0].position, world.body(A).pose().position);
    assert_eq!(by_other.map_frames, [MapFrame { agent: A, origin: Point3::from(-own) }]);
}

#[test]
fn door_that_closes_is_seen_on_the_map_of_a_later_block() {
    let workers = Workers::new(1).unwrap();
    let mut world = World::new(hall(), params(biased(0.05)), &[at(2.5, 2.5)]);
    go(&mut world, A, to(40.5, 2.5), |_, _| {});
    let (extent, offset) = (world.terrain().extent(), offset(&world, A));
    let door = Cell::new(43, 2, 2);
    let before = world.coverage().explored_count();
    world.change_map(CellBox { low: door, high: door }, Terrain::Wall);
    assert_eq!(world.coverage().explored_count(), before - 1);
    assert!((world.coverage().explored_by()[0] - world.coverage().explored()).abs() < 1e-12);
    world.step([(A, Command { lidar: ScanRequest::Once, ..command(Motion::Keep) })].into());
    world.sense(&workers);
    assert!(world.events(A, EventMask::empty()).contains(EventMask::REVISED));
    let believed = extent.centre(door) + offset;
    let believed = extent.index(extent.cell_of(&believed)).unwrap() as u32;
    let seen = world.observe(A, RequestKind::Scheduled).seen;
    assert!(seen.wall.contains(&believed) && !seen.free.contains(&believed));
}

#[test]
fn body_that_is_put_elsewhere_does_not_drift_by_that() {
    let mut world = World::new(hall(), params(biased(0.05)), &[at(2.5, 2.5)]);
    world.place(A, at(50.5, 2.5)).unwrap();
    world.step(BTreeMap::new());
    assert_eq!(offset(&world, A), Vector3::zeros());
    assert_eq!(world.frames(A).unwrap().odometry, at(50.5, 2.5));
}

/// A ring of passages of 3 x 3 cells around a solid block.
fn ring() -> Grid<Terrain> {
    let mut ring = Grid::new(Extent::new([24, 24, 5], 1.0).unwrap(), Terrain::Free);
    voxels::close_shell(&mut ring, 1);
    for (x, y, z) in (4..20).flat_map(|x| (4..20).flat_map(move |y| (1..4).map(move |z| (x, y, z)))) {
        ring.set(Cell::new(x, y, z), Terrain::Wall);
    }
    ring
}

#[test]
fn seeing_the_start_again_closes_the_loop_and_moves_the_blocks() {
    let round = [at(21.5, 2.5), at(21.5, 21.5), at(2.5, 21.5), at(2.5, 2.5)].map(|corner| corner.position);
    let after = |closures: Option<LoopClosures>| {
        let params =
            WorldParams { closures, ..params(OdometryNoise { heading_bias_rad_per_m: 0.004, ..biased(0.05) }) };
        let mut world = World::new(ring(), params, &[at(2.5, 2.5)]);
        let mut map: BTreeMap<u32, Terrain> = BTreeMap::new();
        go(&mut world, A, Motion::Path(round.to_vec()), |_, observation| {
            map.extend(observation.seen.free.iter().map(|&cell| (cell, Terrain::Free)));
            map.extend(observation.seen.wall.iter().map(|&cell| (cell, Terrain::Wall)));
        });
        let last = world.observe(A, RequestKind::Scheduled).seen;
        map.extend(last.free.iter().map(|&cell| (cell, Terrain::Free)));
        map.extend(last.wall.iter().map(|&cell| (cell, Terrain::Wall)));
        // The agent has been told what the world takes it to know.
        let told = map.len() as u64;
        assert_eq!(told, world.drift_totals().unwrap().map_errors.cells());
        (offset(&world, A), world.drift_totals().unwrap())
    };
    let (open, without) = after(None);
    assert!(open != Vector3::zeros() && without.closures == 0, "{open}");
    let (closed, with) = after(Some(LoopClosures { range_m: 2.0, gain_min_m: 20.0 }));
    assert_eq!((closed, with.closures), (Vector3::zeros(), 1));
    let right = |totals: &DriftTotals| totals.map_errors.right as f64 / totals.map_errors.cells() as f64;
    assert!(right(&with) > right(&without), "{with:?} {without:?}");
    assert!(with.position_error_m <= without.position_error_m);
}

#[test]
fn meeting_an_agent_that_knows_better_corrects_the_other() {
    let closures = Some(LoopClosures { range_m: 3.0, gain_min_m: 20.0 });
    let params = WorldParams { closures, ..params(biased(0.05)) };
    let mut world = World::new(hall(), params, &[at(2.5, 2.5), at(42.5, 3.5)]);
    go(&mut world, A, to(36.5, 2.5), |_, _| {});
    assert_ne!(offset(&world, A), Vector3::zeros());
    go(&mut world, A, to(41.0, 2.5), |_, _| {});
    assert_eq!((offset(&world, A), offset(&world, B)), (Vector3::zeros(), Vector3::zeros()));
    assert_eq!(world.drift_totals().unwrap().closures, 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn believed_positions_stay_in_the_map_and_cells_have_one_state(
        seed in 0_u64..1000,
        position_noise_m in 0.0..0.6,
        turn_noise_rad in 0.0..0.2,
        closure_range_m in prop::option::of(1.0..6.0),
        goals in prop::collection::vec((1.5..58.5, 1.5..10.5), 1..6),
    ) {
        let odometry = OdometryNoise { position_noise_m, turn_noise_rad, seed, ..OdometryNoise::default() };
        let closures = closure_range_m.map(|range_m| LoopClosures { range_m, gain_min_m: 10.0 });
        let mut drifting = World::new(hall(), WorldParams { closures, ..params(odometry) }, &[at(2.5, 2.5), at(2.5, 8.5)]);
        let extent = drifting.terrain().extent();
        let [low, high] = [1.0, 59.0].map(|along| along - 1e-9);
        for (x, y) in goals {
            go(&mut drifting, A, to(x, y), |world, observation| {
                let believed = observation.pose.position;
                let cell = extent.cell_of(&believed);
                assert!(extent.contains(cell) && (low..=high).contains(&believed.x), "{believed:?}");
                let (free, wall) = (&observation.seen.free, &observation.seen.wall);
                assert!(free.is_sorted() && wall.is_sorted() && !free.iter().any(|cell| wall.contains(cell)));
                assert!(observation.contacts.iter().all(|contact| extent.contains(extent.cell_of(&contact.position))));
                // Whatever is believed, the team has explored what its sensors have crossed.
                assert!(world.coverage().explored() <= 1.0);
            });
        }
        let errors = drifting.drift_totals().unwrap().map_errors;
        prop_assert!(errors.cells() > 0);
    }
}
