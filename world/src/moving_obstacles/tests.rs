use std::collections::BTreeMap;
use std::f64::consts::TAU;

use proptest::prelude::*;
use protocol::body_model::BodyModel;
use protocol::command::Command;
use protocol::observation::RequestKind;
use protocol::wake_condition::WakeCondition;
use voxels::{Cell, Extent};

use super::*;
use crate::WorldParams;
use crate::body::{Motion, Pose};
use crate::comms::{Comms, ContactModel};
use crate::lidar::{Measured, Pattern, RayReturn, Scanner};
use crate::map_change::CellBox;
use crate::workers::Workers;

const A: AgentId = AgentId(0);

fn params(obstacles: Vec<ObstacleModel>) -> WorldParams {
    WorldParams {
        obstacles,
        ..WorldParams::new(
            BodyModel::default(),
            Scanner::new(Pattern::Lattice { rays: 500 }, f64::INFINITY, TAU),
            Comms::perfect(ContactModel::Global),
        )
    }
}

fn hall(inner: [u32; 3]) -> Grid<Terrain> {
    let extent = Extent::new(inner.map(|cells| cells + 2), 1.0).unwrap();
    let mut terrain = Grid::new(extent, Terrain::Free);
    voxels::close_shell(&mut terrain, 1);
    terrain
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose { position: Point3::new(x, y, z), yaw_rad: 0.0 }
}

fn obstacle(shape: Shape, path: &[[f64; 3]], repeat: Repeat) -> ObstacleModel {
    let path = path.iter().copied().map(Point3::from).collect();
    ObstacleModel { shape, path, speed_m_s: 1.0, repeat, start: Tick::ZERO }
}

const BALL: Shape = Shape::Sphere { radius_m: 0.4 };

fn run(world: &mut World, workers: &Workers, ticks: u64) {
    for _ in 0..ticks {
        world.sense(workers);
        world.step(BTreeMap::new());
    }
}

/// How far the body of a world is from overlapping an obstacle, or obstacles from a wall.
fn assert_apart(world: &World) {
    for obstacle in world.moving_obstacles() {
        assert!(!obstacle.is_in_wall(world.terrain()), "{obstacle:?}");
        for agent in world.agents().filter(|&agent| world.presence(agent).is_in_world()) {
            let body = world.body(agent);
            let sphere = Sphere { centre: body.pose().position, radius_m: body.model().radius_m };
            assert!(!obstacle.overlaps(&sphere), "{obstacle:?}, agent {agent} at {:?}", sphere.centre);
        }
    }
}

#[test]
fn paths_are_followed_as_they_say() {
    let workers = Workers::new(1).unwrap();
    let path = [[1.5, 1.5, 1.5], [3.5, 1.5, 1.5], [3.5, 2.5, 1.5]];
    let after = |repeat, seconds: u64| {
        let mut world = World::new(hall([8, 8, 3]), params(vec![obstacle(BALL, &path, repeat)]), &[at(7.5, 7.5, 1.5)]);
        run(&mut world, &workers, 50 * seconds);
        let centre = world.moving_obstacles()[0].centre;
        [centre.x, centre.y].map(|along| (along * 1e6).round() / 1e6)
    };
    for repeat in [Repeat::Once, Repeat::Loop, Repeat::ToAndFro] {
        assert_eq!(after(repeat, 1), [2.5, 1.5]);
        assert_eq!(after(repeat, 3), [3.5, 2.5]);
    }
    assert_eq!(after(Repeat::Once, 9), [3.5, 2.5]);
    assert_eq!(after(Repeat::ToAndFro, 5), [2.5, 1.5]);
    assert_eq!(after(Repeat::ToAndFro, 7), [2.5, 1.5]);
    // The closing leg is sqrt(5) m long.
    let closing = after(Repeat::Loop, 4);
    assert!((closing[0] - (3.5 - 2.0 / 5_f64.sqrt())).abs() < 1e-5, "{closing:?}");
    let late = ObstacleModel { start: Tick(100), ..obstacle(BALL, &path, Repeat::Once) };
    let mut world = World::new(hall([8, 8, 3]), params(vec![late]), &[at(7.5, 7.5, 1.5)]);
    run(&mut world, &workers, 100);
    assert_eq!(world.moving_obstacles()[0].centre.x, 1.5);
    run(&mut world, &workers, 50);
    assert!((world.moving_obstacles()[0].centre.x - 2.5).abs() < 1e-9);
}

#[test]
fn obstacles_give_way_and_bodies_collide_with_them() {
    let workers = Workers::new(1).unwrap();
    let crossing = obstacle(BALL, &[[1.5, 1.5, 1.5], [7.5, 1.5, 1.5]], Repeat::Once);
    let mut world = World::new(hall([8, 3, 3]), params(vec![crossing]), &[at(4.5, 1.5, 1.5)]);
    run(&mut world, &workers, 500);
    let x = world.moving_obstacles()[0].centre.x;
    assert!((3.65..3.7 + 1e-9).contains(&x), "it waits before the body, at {x}");
    assert_apart(&world);
    // The body runs into it, as into another body.
    let back = Motion::Path(vec![Point3::new(2.5, 1.5, 1.5)]);
    world.step([(A, Command::new(back, WakeCondition::NEXT_TICK))].into());
    run(&mut world, &workers, 400);
    let collision = world.body(A).collision().unwrap();
    assert!(collision.with_agent);
    // Once it is out of the way, the obstacle continues.
    let aside = Motion::Path(vec![Point3::new(4.5, 3.4, 1.5)]);
    world.step([(A, Command::new(aside, WakeCondition::NEXT_TICK))].into());
    run(&mut world, &workers, 800);
    assert_eq!(world.moving_obstacles()[0].centre.x, 7.5);
}

#[test]
fn obstacles_that_go_to_and_fro_turn_back_before_what_stays_in_their_way() {
    let workers = Workers::new(1).unwrap();
    for repeat in [Repeat::ToAndFro, Repeat::Loop] {
        let crossing = obstacle(BALL, &[[1.5, 1.5, 1.5], [7.5, 1.5, 1.5]], repeat);
        let mut world = World::new(hall([8, 3, 3]), params(vec![crossing]), &[at(4.5, 1.5, 1.5)]);
        let x_after = |world: &mut World, ticks| {
            run(world, &workers, ticks);
            world.moving_obstacles()[0].centre.x
        };
        // It reaches the body after 110 ticks, waits for 100, and is back after 110 more.
        assert!((x_after(&mut world, 205) - 3.7).abs() < 0.03, "{repeat:?}");
        assert!((x_after(&mut world, 60) - 2.6).abs() < 0.1, "{repeat:?}");
        assert!((x_after(&mut world, 110) - 2.6).abs() < 0.2, "{repeat:?}: and it comes again");
    }
}

#[test]
fn rays_end_at_obstacles_and_maps_have_only_what_is_seen() {
    let workers = Workers::new(1).unwrap();
    let cube = Shape::Box { half_m: Vector3::repeat(0.49) };
    let standing =
        ObstacleModel { start: Tick(1000), ..obstacle(cube, &[[3.5, 1.5, 1.5], [3.5, 1.6, 1.5]], Repeat::Once) };
    let mut world = World::new(hall([8, 1, 1]), params(vec![standing]), &[at(1.5, 1.5, 1.5)]);
    world.sense(&workers);
    let seen = world.observe(A, RequestKind::Scheduled).seen;
    let index = |x| world.terrain().extent().index(Cell::new(x, 1, 1)).unwrap() as u32;
    assert!(seen.free.contains(&index(2)) && !seen.free.contains(&index(4)), "{seen:?}");
    assert!(!seen.wall.contains(&index(3)), "it is no wall");
    let returns = world.returns(A, 0, &Scanner::new(Pattern::Lattice { rays: 500 }, f64::INFINITY, TAU));
    let is_on_it = |one: &RayReturn| match one.measured {
        Measured::Surface { point, .. } => (point.x - 3.01).abs() < 1e-9,
        _ => false,
    };
    assert!(returns.iter().any(is_on_it), "points have it");
}

#[test]
fn obstacles_wait_before_walls_that_have_come_up() {
    let workers = Workers::new(1).unwrap();
    let crossing = obstacle(BALL, &[[1.5, 1.5, 1.5], [7.5, 1.5, 1.5]], Repeat::Once);
    let mut world = World::new(hall([8, 3, 3]), params(vec![crossing]), &[at(1.5, 3.5, 1.5)]);
    let column = |x| CellBox { low: Cell::new(x, 1, 1), high: Cell::new(x, 3, 3) };
    assert!(world.is_anything_in(column(1)) && !world.is_anything_in(column(5)));
    world.sense(&workers);
    world.change_map(column(5), Terrain::Wall);
    run(&mut world, &workers, 400);
    let x = world.moving_obstacles()[0].centre.x;
    assert!((4.55..4.61).contains(&x), "{x}");
    assert!(world.is_anything_in(column(4)), "a wall does not come up around it");
    world.change_map(column(5), Terrain::Free);
    run(&mut world, &workers, 100);
    assert!(world.moving_obstacles()[0].centre.x > 6.5);
}

#[test]
fn misplaced_obstacles_are_refused() {
    let terrain = hall([8, 3, 3]);
    let body = Sphere { centre: Point3::new(1.5, 1.5, 1.5), radius_m: 0.4 };
    let placed = |path: &[[f64; 3]], repeat| obstacle(BALL, path, repeat).check_place(&terrain, &[body]);
    assert_eq!(placed(&[[4.5, 1.5, 1.5], [7.5, 1.5, 1.5]], Repeat::Once), Ok(()));
    let out = [[4.5, 1.5, 1.5], [7.5, 1.5, 1.5], [7.5, 0.9, 1.5]];
    assert_eq!(placed(&out, Repeat::Once), Err(Misplaced::InWall { point: 1 }));
    assert_eq!(placed(&[[2.2, 1.5, 1.5], [7.5, 1.5, 1.5]], Repeat::Once), Err(Misplaced::OnAgent(A)));
}

fn shape() -> impl Strategy<Value = Shape> {
    let half = prop::array::uniform3(0.1..0.9_f64);
    prop_oneof![
        (0.1..0.9_f64).prop_map(|radius_m| Shape::Sphere { radius_m }),
        half.prop_map(|half_m| Shape::Box { half_m: Vector3::from(half_m) }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// No body ever overlaps an obstacle or leaves free space, whatever both do.
    #[test]
    fn bodies_and_obstacles_never_overlap(
        shapes in prop::collection::vec((shape(), prop::collection::vec(prop::array::uniform3(2.0..8.0_f64), 2..5), 0.2..20.0_f64), 1..5),
        goals in prop::collection::vec(prop::array::uniform3(1.5..8.5_f64), 12),
    ) {
        let workers = Workers::new(1).unwrap();
        let model = |(shape, path, speed_m_s): &(Shape, Vec<[f64; 3]>, f64)| ObstacleModel {
            speed_m_s: *speed_m_s,
            ..obstacle(*shape, path, Repeat::Loop)
        };
        let starts = [at(1.5, 1.5, 1.5), at(8.5, 1.5, 1.5), at(1.5, 8.5, 8.5)];
        let bodies = starts.map(|start| Sphere { centre: start.position, radius_m: 0.4 });
        let terrain = hall([8, 8, 8]);
        let models: Vec<_> = shapes.iter().map(model).filter(|model| model.check_place(&terrain, &bodies).is_ok()).collect();
        let mut world = World::new(terrain, params(models), &starts);
        for goals in goals.chunks(3) {
            let command = |goal: &[f64; 3]| Command::new(Motion::Path(vec![(*goal).into()]), WakeCondition::NEXT_TICK);
            let commands = (0..).map(AgentId).zip(goals.iter().map(command)).collect();
            world.sense(&workers);
            world.step(commands);
            for _ in 0..150 {
                world.step(BTreeMap::new());
                assert_apart(&world);
            }
        }
    }
}
