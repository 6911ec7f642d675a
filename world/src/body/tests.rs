use voxels::{Extent, Grid, Terrain};

use protocol::observation::Surface;

use super::*;

const DT_S: f64 = 0.02;

fn space() -> Grid<Terrain> {
    Grid::new(Extent::new([100, 20, 20], 1.0).unwrap(), Terrain::Free)
}

fn body() -> Body {
    Body::at_rest(BodyModel::SUBMARINE, Pose { position: Point3::new(10.0, 10.0, 10.0), yaw_rad: 0.0 })
}

/// Ticks until the task is done.
fn execute(body: &mut Body, motion: Motion) -> usize {
    let terrain = space();
    let obstacles = Obstacles::new(&terrain, &[], 0);
    body.set_task(motion);
    (1..100_000).find(|_| body.advance(&obstacles, DT_S).task_done).expect("every task that is tested here ends")
}

#[test]
fn move_durations_match_maes3d() {
    // Durations measured in MAES3D, which computes in single precision.
    let durations = [
        (0.5, 2.28),
        (1.0, 3.22),
        (1.73, 4.46),
        (2.0, 4.56),
        (3.0, 5.94),
        (5.0, 7.26),
        (10.0, 10.6),
        (20.0, 17.6),
        (50.0, 37.6),
    ];
    for (distance_m, expected_s) in durations {
        let mut body = body();
        let ticks = execute(&mut body, Motion::Move { pitch_rad: 0.0, distance_m });
        let took_s = ticks as f64 * DT_S;
        assert!((took_s - expected_s).abs() <= 0.061, "{distance_m} m took {took_s} s instead of {expected_s} s");
        assert!((body.pose().position.x - 10.0 - distance_m).abs() < 1e-9, "lands on the target");
    }
}

#[test]
fn turn_durations_match_maes3d() {
    let durations = [(1.0, 0.30), (10.0, 0.90), (45.0, 2.14), (90.0, 3.08), (135.0, 3.74), (180.0, 4.24), (0.0, 0.02)];
    for (angle_deg, expected_s) in durations {
        for sign in [1.0, -1.0] {
            let mut body = body();
            let angle_rad: f64 = sign * angle_deg * PI / 180.0;
            let took_s = execute(&mut body, Motion::Turn { angle_rad }) as f64 * DT_S;
            assert!(
                (took_s - expected_s).abs() <= 0.021,
                "{angle_deg} degrees took {took_s} s instead of {expected_s} s"
            );
            assert!(wrapped(body.pose().yaw_rad - angle_rad).abs() < 1e-9, "lands on the target");
        }
    }
}

#[test]
fn speed_stays_within_its_limit() {
    let terrain = space();
    let obstacles = Obstacles::new(&terrain, &[], 0);
    let mut body = body();
    body.set_task(Motion::Move { pitch_rad: 0.0, distance_m: 60.0 });
    let mut top_m_s = 0.0_f64;
    while !body.advance(&obstacles, DT_S).task_done {
        top_m_s = top_m_s.max(body.velocity_in_map_m_s().norm());
    }
    assert!((top_m_s - 1.5).abs() < 1e-9, "{top_m_s}");
}

#[test]
fn a_raised_move_goes_along_the_heading_and_up() {
    let mut body =
        Body::at_rest(BodyModel::SUBMARINE, Pose { position: Point3::new(10.0, 10.0, 10.0), yaw_rad: PI / 2.0 });
    execute(&mut body, Motion::Move { pitch_rad: PI / 6.0, distance_m: 2.0 });
    let way = body.pose().position - Point3::new(10.0, 10.0, 10.0);
    assert!((way - Vector3::new(0.0, 3.0_f64.sqrt(), 1.0)).norm() < 1e-9, "{way}");
}

#[test]
fn infinite_move_ends_at_a_wall() {
    let mut body = body();
    execute(&mut body, Motion::Move { pitch_rad: 0.0, distance_m: f64::INFINITY });
    assert_eq!(body.collision(), Some(Collision { surface: Surface::Wall, with_agent: false }));
    let gap_m = 100.0 - body.pose().position.x - BodyModel::SUBMARINE.radius_m;
    assert!((0.0..=0.03).contains(&gap_m), "{gap_m}");
    assert!(!body.is_active());
    assert_eq!(body.velocity_in_map_m_s(), Vector3::zeros());
}

#[test]
fn path_ends_exactly_on_its_last_waypoint() {
    let mut body = body();
    let waypoints = vec![
        Point3::new(12.0, 10.0, 10.0),
        Point3::new(12.0, 13.0, 10.0),
        Point3::new(12.0, 13.0, 12.0),
        Point3::new(10.0, 13.0, 11.0),
    ];
    execute(&mut body, Motion::Path(waypoints.clone()));
    assert_eq!(body.pose().position, *waypoints.last().unwrap());
    assert!(wrapped(body.pose().yaw_rad - PI).abs() < 1e-9, "{}", body.pose().yaw_rad);
}

#[test]
fn a_vertical_leg_needs_no_turn() {
    let mut up = body();
    let above = Point3::new(10.0, 10.0, 12.0);
    assert_eq!(
        execute(&mut up, Motion::Path(vec![above])),
        execute(&mut body(), Motion::Move { pitch_rad: PI / 2.0, distance_m: 2.0 })
    );
    assert_eq!(up.pose().yaw_rad, 0.0);
}

#[test]
fn new_task_starts_from_rest() {
    let terrain = space();
    let obstacles = Obstacles::new(&terrain, &[], 0);
    let mut body = body();
    body.set_task(Motion::Move { pitch_rad: 0.0, distance_m: 50.0 });
    for _ in 0..100 {
        body.advance(&obstacles, DT_S);
    }
    assert!(body.velocity_in_map_m_s().norm() > 0.9);
    body.set_task(Motion::Keep);
    body.advance(&obstacles, DT_S);
    assert!(body.velocity_in_map_m_s().norm() > 0.9);
    body.set_task(Motion::Move { pitch_rad: 0.0, distance_m: 50.0 });
    body.advance(&obstacles, DT_S);
    assert!((body.velocity_in_map_m_s().norm() - 0.01).abs() < 1e-12);
    body.set_task(Motion::Stop);
    assert_eq!(body.velocity_in_map_m_s(), Vector3::zeros());
    assert!(!body.is_active());
}

#[test]
fn velocity_is_ramped_held_and_clamped() {
    let terrain = space();
    let obstacles = Obstacles::new(&terrain, &[], 0);
    let mut body = body();
    let forwards = |x: f64, yaw_rate_rad_s| Motion::Velocity {
        linear_in_body_m_s: Vector3::new(x, 5.0, 0.0),
        yaw_rate_rad_s,
        path: Vec::new(),
    };
    body.set_task(forwards(1.0, 0.0));
    body.advance(&obstacles, DT_S);
    assert!((body.velocity_in_map_m_s().x - 0.01).abs() < 1e-12, "speeds up as it can, and never sideways");
    for _ in 0..200 {
        body.advance(&obstacles, DT_S);
    }
    assert!((body.velocity_in_map_m_s() - Vector3::new(1.0, 0.0, 0.0)).norm() < 1e-12);
    body.set_task(forwards(9.0, 9.0));
    body.advance(&obstacles, DT_S);
    assert!(body.velocity_in_map_m_s().norm() > 1.0, "continues from the present velocity");
    for _ in 0..200 {
        body.advance(&obstacles, DT_S);
    }
    assert!((body.velocity_in_map_m_s().norm() - 1.5).abs() < 1e-12);
    assert!((body.yaw_rate_rad_s() - BodyModel::SUBMARINE.turn_rate_max_rad_s).abs() < 1e-12);
    assert!(body.is_active());
}
