use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;
use protocol::body_model::BodyModel;
use voxels::{Extent, Grid, Terrain};

use super::super::super::spawn::check_room;
use super::super::{Collision, Motion, Pose};
use super::*;
use protocol::observation::Surface;

const DT_S: f64 = 0.02;

const START: Point3<f64> = Point3::new(10.0, 10.0, 10.0);

fn space() -> Grid<Terrain> {
    Grid::new(Extent::new([100, 20, 20], 1.0).unwrap(), Terrain::Free)
}

fn body() -> Body {
    Body::at_rest(BodyModel::AERIAL, Pose { position: START, yaw_rad: 0.0 })
}

/// Ticks until the task is done, in free space.
fn execute(body: &mut Body, motion: Motion) -> usize {
    let terrain = space();
    let obstacles = Obstacles::new(&terrain, &[], 0);
    body.set_task(motion);
    (1..100_000).find(|_| body.advance(&obstacles, DT_S).task_done).expect("every task that is tested here ends")
}

fn path(waypoints: &[[f64; 3]]) -> Motion {
    Motion::Path(waypoints.iter().map(|&point| Point3::from(point)).collect())
}

/// The least time for a straight leg from rest to rest, seconds.
fn least_s(length_m: f64) -> f64 {
    let BodyModel { speed_max_m_s: speed, acceleration_m_s2: faster, deceleration_m_s2: slower, .. } =
        BodyModel::AERIAL;
    let ramps_m = 0.5 * speed * speed * (1.0 / faster + 1.0 / slower);
    if length_m >= ramps_m {
        (length_m - ramps_m) / speed + speed / faster + speed / slower
    } else {
        (2.0 * length_m * (faster + slower) / (faster * slower)).sqrt()
    }
}

#[test]
fn flies_sideways_at_full_speed() {
    for length_m in [0.01, 0.5, 1.0, 3.0, 8.0] {
        let mut body = body();
        let took_s = execute(&mut body, path(&[[10.0, 10.0 - length_m, 10.0]])) as f64 * DT_S;
        let lost_s = took_s - least_s(length_m);
        assert!((-0.041..0.061).contains(&lost_s), "{length_m} m took {took_s} s");
        assert_eq!(body.pose().position, Point3::new(10.0, 10.0 - length_m, 10.0));
    }
}

#[test]
fn heading_turns_at_its_own_rate() {
    let terrain = space();
    let obstacles = Obstacles::new(&terrain, &[], 0);
    let mut body = body();
    body.set_task(path(&[[10.0, 18.0, 10.0], [10.0, 18.0, 18.0]]));
    body.advance(&obstacles, DT_S);
    assert!(body.pose().yaw_rad > 0.0 && body.velocity_in_map_m_s().y > 0.0, "both at once");
    for _ in 0..100 {
        body.advance(&obstacles, DT_S);
    }
    assert!(body.is_active() && (body.pose().yaw_rad - FRAC_PI_2).abs() < 1e-9, "{:?}", body.pose());
    while !body.advance(&obstacles, DT_S).task_done {}
    assert!((body.pose().yaw_rad - FRAC_PI_2).abs() < 1e-9, "a vertical leg leaves it as it is");
}

#[test]
fn straight_waypoints_are_flown_through() {
    let terrain = space();
    let obstacles = Obstacles::new(&terrain, &[], 0);
    let mut ticks_through = 0;
    let mut through = body();
    through.set_task(path(&[[12.0, 10.0, 10.0], [12.0, 10.0, 10.0], [14.0, 10.0, 10.0], [20.0, 10.0, 10.0]]));
    loop {
        ticks_through += 1;
        let done = through.advance(&obstacles, DT_S).task_done;
        let ahead = through.waypoints();
        assert!(ahead.iter().all(|point| point.x > through.pose().position.x), "{ahead:?} {:?}", through.pose());
        assert_eq!(ahead.is_empty(), done);
        if done {
            break;
        }
    }
    assert_eq!(ticks_through, execute(&mut body(), path(&[[20.0, 10.0, 10.0]])));
    let bent = execute(&mut body(), path(&[[14.0, 10.0, 10.0], [20.0, 10.1, 10.0]]));
    assert!(bent > ticks_through + 20, "it comes to rest where the way bends");
}

#[test]
fn a_move_goes_along_the_heading_and_a_turn_is_on_the_spot() {
    let mut body = body();
    execute(&mut body, Motion::Turn { angle_rad: FRAC_PI_2 });
    assert!((body.pose().yaw_rad - FRAC_PI_2).abs() < 1e-12 && body.pose().position == START);
    execute(&mut body, Motion::Move { pitch_rad: PI / 6.0, distance_m: 2.0 });
    let way = body.pose().position - START;
    assert!((way - Vector3::new(0.0, 3.0_f64.sqrt(), 1.0)).norm() < 1e-9, "{way}");
    assert!((body.pose().yaw_rad - FRAC_PI_2).abs() < 1e-12);
    execute(&mut body, Motion::Move { pitch_rad: 0.0, distance_m: f64::INFINITY });
    assert_eq!(body.collision(), Some(Collision { surface: Surface::Wall, with_agent: false }));
}

#[test]
fn a_velocity_may_be_sideways_and_turns_with_the_body() {
    let terrain = space();
    let obstacles = Obstacles::new(&terrain, &[], 0);
    let mut body = body();
    body.set_task(Motion::Velocity {
        linear_in_body_m_s: Vector3::new(0.0, 1.0, 0.0),
        yaw_rate_rad_s: 0.0,
        path: Vec::new(),
    });
    for _ in 0..50 {
        body.advance(&obstacles, DT_S);
    }
    assert!((body.velocity_in_map_m_s() - Vector3::new(0.0, 1.0, 0.0)).norm() < 1e-12);
    body.set_task(Motion::Velocity {
        linear_in_body_m_s: Vector3::new(0.0, 9.0, 0.0),
        yaw_rate_rad_s: 0.1,
        path: Vec::new(),
    });
    for _ in 0..150 {
        body.advance(&obstacles, DT_S);
    }
    let speed_m_s = body.velocity_in_body_m_s();
    assert!((speed_m_s.norm() - 3.0).abs() < 1e-3 && speed_m_s.y > 2.99, "{speed_m_s}");
    assert!(body.is_active());
}

/// A cave with an inner wall that has a door.
fn cave() -> Grid<Terrain> {
    let mut terrain = Grid::new(Extent::new([12, 9, 7], 1.0).unwrap(), Terrain::Free);
    voxels::close_shell(&mut terrain, 1);
    for y in 1..8 {
        for z in 1..6 {
            if (y, z) != (4, 3) {
                terrain.set(voxels::Cell::new(6, y, z), Terrain::Wall);
            }
        }
    }
    terrain
}

fn models() -> impl Strategy<Value = BodyModel> {
    let rate = || prop_oneof![0.05..5.0, 5.0..1e3];
    (0.01..0.5, 0.1..20.0, rate(), rate(), (0.1..5.0, rate(), rate())).prop_map(
        |(radius_m, speed_max_m_s, acceleration_m_s2, deceleration_m_s2, turn)| BodyModel {
            radius_m,
            speed_max_m_s,
            acceleration_m_s2,
            deceleration_m_s2,
            turn_rate_max_rad_s: turn.0,
            turn_acceleration_rad_s2: turn.1,
            turn_deceleration_rad_s2: turn.2,
            ..BodyModel::AERIAL
        },
    )
}

fn points() -> impl Strategy<Value = Point3<f64>> {
    (1.2..10.8, 1.2..7.8, 1.2..5.8).prop_map(|(x, y, z)| Point3::new(x, y, z))
}

fn motions() -> impl Strategy<Value = Motion> {
    let velocity = || (-9.0..9.0, -9.0..9.0, -9.0..9.0).prop_map(|(x, y, z)| Vector3::new(x, y, z));
    prop_oneof![
        1 => Just(Motion::Stop),
        1 => Just(Motion::Keep),
        2 => (-FRAC_PI_2..FRAC_PI_2, prop_oneof![0.0..9.0, Just(f64::INFINITY)])
            .prop_map(|(pitch_rad, distance_m)| Motion::Move { pitch_rad, distance_m }),
        1 => (-6.2..6.2).prop_map(|angle_rad| Motion::Turn { angle_rad }),
        4 => prop::collection::vec(points(), 1..5).prop_map(Motion::Path),
        3 => (velocity(), -9.0..9.0)
            .prop_map(|(linear_in_body_m_s, yaw_rate_rad_s)| Motion::Velocity {
                linear_in_body_m_s,
                yaw_rate_rad_s,
                path: Vec::new()
            }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn any_motion_keeps_limits_and_free_space(
        model in models(),
        tasks in prop::collection::vec((motions(), 1..200_usize), 1..8),
    ) {
        let terrain = cave();
        let obstacles = Obstacles::new(&terrain, &[], 0);
        let mut body = Body::at_rest(model, Pose { position: Point3::new(3.0, 4.5, 3.5), yaw_rad: 0.3 });
        // A way may bend by so much without a rest.
        let bend_m_s = model.speed_max_m_s * BEND_RAD + 1e-6;
        for (motion, ticks) in tasks {
            let is_kept = matches!(motion, Motion::Keep);
            body.set_task(motion);
            for tick in 0..ticks {
                let (before, rate_before) = (body.velocity_in_map_m_s(), body.yaw_rate_rad_s());
                let had_task = body.is_active();
                let moved = body.advance(&obstacles, DT_S);
                let (after, rate) = (body.velocity_in_map_m_s(), body.yaw_rate_rad_s());
                prop_assert!(after.norm() <= model.speed_max_m_s + 1e-9);
                prop_assert!(rate.abs() <= model.turn_rate_max_rad_s + 1e-9);
                prop_assert!(check_room(&terrain, [], &body.pose().position, model.radius_m - 1e-9).is_ok());
                if moved.collided || !had_task {
                    prop_assert_eq!(after, Vector3::zeros());
                    continue;
                }
                // A new task continues from a velocity only if both are velocities, and this need
                // not have been one.
                if tick == 0 && !is_kept && before == Vector3::zeros() {
                    prop_assert!(after.norm() <= model.acceleration_m_s2 * DT_S + bend_m_s);
                }
                let gets_faster = after.norm() >= before.norm();
                let limit_m_s2 = if gets_faster {
                    model.acceleration_m_s2
                } else {
                    model.deceleration_m_s2.max(model.acceleration_m_s2)
                };
                let change_m_s = (after - before).norm();
                prop_assert!(change_m_s <= limit_m_s2 * DT_S + bend_m_s, "{before} {after} {limit_m_s2}");
                let limit_rad_s2 = model.turn_acceleration_rad_s2.max(model.turn_deceleration_rad_s2);
                prop_assert!((rate - rate_before).abs() <= limit_rad_s2 * DT_S + 1e-6);
            }
        }
    }

    #[test]
    fn lands_exactly_on_the_last_waypoint(model in models(), waypoints in prop::collection::vec(points(), 1..6)) {
        let terrain = space();
        let obstacles = Obstacles::new(&terrain, &[], 0);
        let mut body = Body::at_rest(model, Pose { position: Point3::new(3.0, 4.5, 3.5), yaw_rad: 0.3 });
        body.set_task(Motion::Path(waypoints.clone()));
        let mut to_visit = VecDeque::from(waypoints.clone());
        let mut last = body.velocity_in_map_m_s();
        let is_done = (0..500_000).any(|_| {
            let done = body.advance(&obstacles, DT_S).task_done;
            let is_slow = body.velocity_in_map_m_s().norm() <= model.deceleration_m_s2 * DT_S + 1e-6;
            if is_slow && to_visit.front() == Some(&body.pose().position) {
                to_visit.pop_front();
            }
            last = body.velocity_in_map_m_s();
            done
        });
        prop_assert!(is_done);
        prop_assert_eq!(body.pose().position, *waypoints.last().unwrap());
        prop_assert!(to_visit.is_empty(), "{to_visit:?}");
        prop_assert!(last.norm() <= model.deceleration_m_s2 * DT_S + 1e-6, "slow enough to be at rest next");
    }
}
