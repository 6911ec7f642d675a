use std::collections::BTreeMap;
use std::f64::consts::TAU;

use proptest::prelude::*;
use protocol::body_model::{BodyKind, BodyModel};
use protocol::command::Command;
use protocol::observation::RequestKind;
use protocol::wake_condition::WakeCondition;
use voxels::{Extent, Grid, Terrain};

use super::*;
use crate::comms::{Comms, ContactModel};
use crate::lidar::{Pattern, Scanner};
use crate::{ScanSchedule, WorldParams};

const A: AgentId = AgentId(0);

fn params() -> EnergyParams {
    EnergyParams {
        capacity: Capacity::Energy(10.0),
        idle_w: 1.0,
        hover_w: 2.0,
        move_j_per_m: 3.0,
        charge_w: 50.0,
        bases: Some(vec![Point3::new(2.5, 2.5, 2.5)]),
        base_radius_m: 1.0,
        reserve: 0.1,
        returns_home: true,
    }
}

/// One body in a closed hall of 18 x 8 x 8 m.
fn world(energy: EnergyParams, kind: BodyKind, start: Point3<f64>) -> World {
    let extent = Extent::new([20, 10, 10], 1.0).unwrap();
    let mut terrain = Grid::new(extent, Terrain::Free);
    voxels::close_shell(&mut terrain, 1);
    let params = WorldParams {
        schedule: ScanSchedule::OnRequest { period_ticks: 1000 },
        energy: Some(energy),
        ..WorldParams::new(
            BodyModel::of(kind),
            Scanner::new(Pattern::Lattice { rays: 10 }, f64::INFINITY, TAU),
            Comms::perfect(ContactModel::Global),
        )
    };
    World::new(terrain, params, &[Pose { position: start, yaw_rad: 0.0 }])
}

fn command(world: &mut World, motion: Motion) {
    world.step([(A, Command::new(motion, WakeCondition::NEXT_TICK))].into());
}

fn left_j(world: &World) -> f64 {
    world.energy(A).unwrap().left_j
}

fn events(world: &mut World) -> EventMask {
    world.observe(A, RequestKind::Scheduled).events
}

#[test]
fn bodies_draw_power_and_energy_for_each_metre() {
    for (kind, power_w) in [(BodyKind::Submarine, 1.0), (BodyKind::Aerial, 3.0)] {
        let mut world = world(params(), kind, Point3::new(8.5, 5.5, 5.5));
        for _ in 0..50 {
            world.step(BTreeMap::new());
        }
        assert!((10.0 - left_j(&world) - power_w).abs() < 1e-9, "{kind:?} at rest");
        let before_j = left_j(&world);
        command(&mut world, Motion::Path(vec![Point3::new(8.9, 5.5, 5.5)]));
        for _ in 0..49 {
            world.step(BTreeMap::new());
        }
        let moved_m = world.distance_m()[0];
        assert!(moved_m > 0.1 && (before_j - left_j(&world) - power_w - 3.0 * moved_m).abs() < 1e-9, "{kind:?}");
    }
}

#[test]
fn endurance_is_the_time_at_rest() {
    let energy = EnergyParams { capacity: Capacity::Endurance(2.0), ..params() };
    for kind in [BodyKind::Submarine, BodyKind::Aerial] {
        let mut world = world(energy.clone(), kind, Point3::new(8.5, 5.5, 5.5));
        let ticks = (0..200).take_while(|_| {
            world.step(BTreeMap::new());
            left_j(&world) > 1e-9
        });
        assert_eq!(ticks.count(), 99, "{kind:?}");
    }
}

#[test]
fn empty_body_stops_and_refuses_motion() {
    let mut world = world(params(), BodyKind::Submarine, Point3::new(8.5, 5.5, 5.5));
    command(&mut world, Motion::straight(0.0, f64::INFINITY));
    while left_j(&world) > 0.0 {
        world.step(BTreeMap::new());
    }
    assert!(events(&mut world).intersects(EventMask::TASK_DONE));
    let (here, travelled_m) = (*world.body(A).pose(), world.distance_m()[0]);
    assert!(travelled_m > 1.0 && !world.body(A).is_active());
    assert_eq!(world.energy_totals().map(|totals| totals.ran_empty), Some(1));
    for _ in 0..10 {
        command(&mut world, Motion::straight(0.0, 1.0));
    }
    assert_eq!((*world.body(A).pose(), world.distance_m()[0]), (here, travelled_m));
    assert_eq!(events(&mut world), EventMask::empty(), "a motion is refused without an event");
    let used_j = world.energy_totals().unwrap().used_j;
    assert!((used_j - 10.0).abs() < 1e-9, "{used_j}");
}

#[test]
fn bodies_charge_at_rest_in_a_base() {
    let energy = EnergyParams { capacity: Capacity::Energy(10.0), idle_w: 600.0, charge_w: 0.0, ..params() };
    let mut world = world(energy, BodyKind::Submarine, Point3::new(2.9, 2.5, 2.5));
    world.step(BTreeMap::new());
    assert!(world.is_home(A) && left_j(&world) == 10.0, "nothing is drawn at rest in a base");
    command(&mut world, Motion::Turn { angle_rad: 1.0 });
    assert_eq!((left_j(&world), world.body(A).is_active()), (0.0, false), "and all of it in a tick of a turn");
    world.batteries.as_mut().unwrap().batteries[0].energy.model.charge_w = 50.0;
    assert!(events(&mut world).intersects(EventMask::TASK_DONE));
    world.step(BTreeMap::new());
    assert_eq!(left_j(&world), 1.0);
    assert!(events(&mut world).intersects(EventMask::TASK_DONE), "it can move again");
    for _ in 0..20 {
        world.step(BTreeMap::new());
    }
    assert_eq!(left_j(&world), 10.0, "never more than the capacity");
}

#[test]
fn start_of_each_agent_is_its_base_unless_bases_are_given() {
    let energy = EnergyParams { bases: None, ..params() };
    let world = world(energy, BodyKind::Submarine, Point3::new(8.5, 5.5, 5.5));
    let bases = &world.energy(A).unwrap().model.bases;
    assert_eq!(&**bases, [Base { position: Point3::new(8.5, 5.5, 5.5), radius_m: 1.0 }]);
    assert!(world.is_home(A));
}

fn motion() -> impl Strategy<Value = Motion> {
    let waypoint = (1.6..18.4, 1.6..8.4, 1.6..8.4).prop_map(|(x, y, z)| Point3::new(x, y, z));
    prop_oneof![
        Just(Motion::Keep),
        Just(Motion::Stop),
        Just(Motion::Path(vec![Point3::new(2.5, 2.5, 2.5)])),
        prop::collection::vec(waypoint, 1..3).prop_map(Motion::Path),
        (-1.0..1.0).prop_map(|angle_rad| Motion::Turn { angle_rad }),
        (-3.0..3.0, -1.0..1.0).prop_map(|(x, yaw_rate_rad_s)| Motion::Velocity {
            linear_in_body_m_s: Vector3::new(x, 0.0, 0.0),
            yaw_rate_rad_s,
            path: Vec::new(),
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn energy_rises_only_at_rest_in_a_base_and_without_it_nothing_moves(
        is_aerial in any::<bool>(),
        capacity_j in 1.0..40.0,
        motions in prop::collection::vec((motion(), 1..150_u32), 1..20),
    ) {
        let energy = EnergyParams { capacity: Capacity::Energy(capacity_j), ..params() };
        let kind = if is_aerial { BodyKind::Aerial } else { BodyKind::Submarine };
        let mut world = world(energy, kind, Point3::new(2.5, 2.5, 2.5));
        for (motion, ticks) in motions {
            for tick in 0..ticks {
                let (before_j, here) = (left_j(&world), *world.body(A).pose());
                match tick {
                    0 => command(&mut world, motion.clone()),
                    _ => world.step(BTreeMap::new()),
                }
                let after_j = left_j(&world);
                prop_assert!((0.0..=capacity_j).contains(&after_j));
                if after_j > before_j {
                    // A body that ends a task within a millimetre of its target is put there.
                    let moved_m = (world.body(A).pose().position - here.position).norm();
                    prop_assert!(world.is_home(A) && moved_m < 0.002);
                } else if !world.is_home(A) {
                    prop_assert!(after_j < before_j || after_j == 0.0, "it draws power");
                }
                if before_j == 0.0 {
                    prop_assert_eq!(*world.body(A).pose(), here);
                }
            }
        }
    }
}
