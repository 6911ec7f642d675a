use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;
use voxels::{Cell, Extent};

use super::*;
use crate::bodies::legs_s;
use crate::path::{Goal, Graph, Moves, Neighbours, find, straighten_from};
use crate::testing::drawn;
use crate::testing::is_through_free_cells;

const BODY: BodyModel = BodyModel::SUBMARINE;

/// Free, with a border of walls.
fn hall(width: usize, height: usize) -> ExplorationMap {
    let wall = "#".repeat(width) + "\n";
    let row = format!("#{}#\n", ".".repeat(width - 2));
    drawn(&format!("{wall}{}{wall}", row.repeat(height - 2)))
}

fn points(along: &[(f64, f64)]) -> Vec<Point3<f64>> {
    along.iter().map(|&(x, y)| Point3::new(x, y, 0.5)).collect()
}

fn states(trajectory: &Trajectory) -> Vec<BodyState> {
    (0..=trajectory.ticks()).map(|ticks| trajectory.state_after(ticks, &BODY).unwrap()).collect()
}

fn duration_s(trajectory: &Trajectory) -> f64 {
    trajectory.ticks() as f64 * Tick::TICK_S
}

#[test]
fn corners_in_the_open_are_passed_at_speed() {
    let map = hall(30, 30);
    let start = BodyState::at_rest(Point3::new(3.5, 3.5, 0.5), 0.0);
    let waypoints = points(&[(15.5, 3.5), (15.5, 15.5), (25.5, 25.5)]);
    let trajectory = Trajectory::along(&waypoints, &map, &BODY, &start).unwrap();
    let stops_s = legs_s(&BODY, (start.position, start.yaw_rad), waypoints.iter().copied(), 1.0);
    assert!(duration_s(&trajectory) < stops_s - 10.0, "{} s, with stops {stops_s} s", duration_s(&trajectory));
    let states = states(&trajectory);
    let speed_m_s = |state: &BodyState| state.velocity_in_body_m_s.norm();
    let between = &states[states.len() / 4..states.len() / 2];
    assert!(between.iter().all(|state| speed_m_s(state) > 1.0), "{between:?}");
    let end = states.last().unwrap();
    assert!(end.is_at_rest() && (end.position - waypoints[2]).norm() < pursuit::MISSED_MAX_M, "{end:?}");
    assert_eq!(trajectory.state_after(trajectory.ticks() + 1, &BODY), None);
    assert_eq!(trajectory.step(trajectory.steps.len()), None);
}

#[test]
fn velocities_change_where_they_are_said_to() {
    let map = hall(30, 30);
    let start = BodyState::at_rest(Point3::new(3.5, 3.5, 0.5), 0.0);
    let trajectory = Trajectory::along(&points(&[(25.5, 3.5)]), &map, &BODY, &start).unwrap();
    let changes: Vec<usize> = std::iter::successors(Some(0), |&step| Some(trajectory.next_change(step)))
        .take_while(|&step| step < trajectory.steps.len())
        .collect();
    let held = |step: usize| trajectory.steps[step].held;
    for step in 1..trajectory.steps.len() {
        assert_eq!(held(step) != held(step - 1), changes.contains(&step), "step {step}");
    }
    // Ahead at full speed, nothing changes until it brakes.
    assert!(changes.len() < trajectory.steps.len() / 2, "{changes:?}");
}

#[test]
fn the_waypoint_ahead_is_known() {
    let map = hall(30, 30);
    let start = BodyState::at_rest(Point3::new(3.5, 3.5, 0.5), 0.0);
    let trajectory = Trajectory::along(&points(&[(15.5, 3.5), (15.5, 25.5)]), &map, &BODY, &start).unwrap();
    let ahead: Vec<usize> = trajectory.steps.iter().map(|step| step.ahead).collect();
    assert!(ahead.is_sorted() && ahead[0] == 0 && *ahead.last().unwrap() == 1, "{ahead:?}");
}

#[test]
fn narrow_corners_are_passed_slowly() {
    let map = drawn(&format!("############\n{}#..........#\n############\n", "##########.#\n".repeat(9)));
    let waypoints = points(&[(10.5, 1.5), (10.5, 10.5)]);
    let start = BodyState::at_rest(Point3::new(1.5, 1.5, 0.5), 0.0);
    let trajectory = Trajectory::along(&waypoints, &map, &BODY, &start).unwrap();
    let passed: Vec<Point3<f64>> = states(&trajectory).iter().map(|state| state.position).collect();
    assert!(is_through_free_cells(&map, &passed[0], &passed[1..]));
    let at_corner = |state: &&BodyState| (state.position - waypoints[0]).norm() < 0.5;
    let states = states(&trajectory);
    let slowest_m_s = states.iter().filter(at_corner).map(|state| state.velocity_in_body_m_s.norm()).reduce(f64::min);
    assert!(slowest_m_s.unwrap() < 0.5, "{slowest_m_s:?}");
}

#[test]
fn a_moving_body_goes_on() {
    let map = hall(30, 30);
    let velocity_in_body_m_s = Vector3::new(1.5, 0.0, 0.0);
    let start = BodyState { velocity_in_body_m_s, ..BodyState::at_rest(Point3::new(10.5, 15.5, 0.5), FRAC_PI_2) };
    let ahead = Trajectory::along(&points(&[(10.5, 25.5)]), &map, &BODY, &start).unwrap();
    assert!(states(&ahead)[..100].iter().all(|state| state.velocity_in_body_m_s.norm() > 1.4));
    // Back: it brakes while it turns, and does not stop at once.
    let back = Trajectory::along(&points(&[(10.5, 5.5)]), &map, &BODY, &start).unwrap();
    let first = back.state_after(1, &BODY).unwrap();
    assert!((first.velocity_in_body_m_s - velocity_in_body_m_s).norm() <= 0.01 + 1e-12, "{first:?}");
    assert!((states(&back).last().unwrap().position - Point3::new(10.5, 5.5, 0.5)).norm() < pursuit::MISSED_MAX_M);
}

#[test]
fn there_is_none_without_room_or_waypoints_or_for_other_bodies() {
    let map = hall(30, 30);
    let start = BodyState::at_rest(Point3::new(3.5, 3.5, 0.5), 0.0);
    let waypoints = points(&[(15.5, 3.5)]);
    assert!(Trajectory::along(&waypoints, &map, &BODY, &start).is_some());
    assert_eq!(Trajectory::along(&[], &map, &BODY, &start), None);
    assert_eq!(Trajectory::along(&waypoints, &map, &BodyModel::AERIAL, &start), None);
    assert_eq!(Trajectory::along(&points(&[(40.5, 3.5)]), &map, &BODY, &start), None);
    // It cannot brake before the wall.
    let fast = BodyState {
        velocity_in_body_m_s: Vector3::new(1.5, 0.0, 0.0),
        ..BodyState::at_rest(Point3::new(2.5, 3.5, 0.5), PI)
    };
    assert_eq!(Trajectory::along(&waypoints, &map, &BODY, &fast), None);
    for wild in [f64::NAN, f64::INFINITY, 1e300] {
        let start = BodyState::at_rest(Point3::new(wild, 3.5, 0.5), wild);
        assert_eq!(Trajectory::along(&waypoints, &map, &BODY, &start), None);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn trajectories_are_clear_and_within_the_limits_of_the_body(
        walls in prop::collection::vec(0..12, 14 * 12 * 5),
        ends in prop::array::uniform2(0..14 * 12 * 5_usize),
        yaw_rad in -3.0..3.0,
        speed_m_s in 0.0..0.5,
        yaw_rate_rad_s in -0.5..0.5,
    ) {
        let extent = Extent::new([14, 12, 5], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        for (index, kind) in (0..).zip(walls) {
            if kind == 0 { map.note_wall(&[index]) } else { map.note_free(&[index]) }
        }
        let [from, to] = ends.map(|index| extent.cell_at(index));
        let moves = Moves::new(BODY.radius_m, 1.0, Neighbours::TwentySix);
        let Some(path) = find(Graph::new(&map, &moves), from, Goal::Cell(to)) else { return Ok(()) };
        let waypoints = straighten_from(&extent.centre(from), &path, &map, BODY.radius_m);
        let velocity_in_body_m_s = Vector3::new(speed_m_s, 0.0, 0.0);
        let start = BodyState { velocity_in_body_m_s, yaw_rate_rad_s, ..BodyState::at_rest(extent.centre(from), yaw_rad) };
        let Some(trajectory) = Trajectory::along(&waypoints, &map, &BODY, &start) else { return Ok(()) };
        let states = states(&trajectory);
        let positions: Vec<Point3<f64>> = states.iter().map(|state| state.position).collect();
        prop_assert!(is_through_free_cells(&map, &positions[0], &positions[1..]));
        for pair in states.windows(2) {
            let change_m_s = (pair[1].velocity_in_body_m_s - pair[0].velocity_in_body_m_s).norm();
            prop_assert!(change_m_s <= BODY.acceleration_m_s2 * Tick::TICK_S + 1e-12);
            let change_rad_s = (pair[1].yaw_rate_rad_s - pair[0].yaw_rate_rad_s).abs();
            prop_assert!(change_rad_s <= BODY.turn_acceleration_rad_s2 * Tick::TICK_S + 1e-12);
        }
        let end = states.last().unwrap();
        prop_assert!(end.is_at_rest());
        prop_assert_eq!(extent.cell_of(&end.position), to);
    }
}

#[test]
fn ends_are_in_the_cell_of_the_last_waypoint() {
    let map = hall(30, 30);
    let start = BodyState::at_rest(Point3::new(3.5, 3.5, 0.5), 0.0);
    for (x, y) in [(4, 3), (4, 4), (3, 5), (20, 9)] {
        let cell = Cell::new(x, y, 0);
        let trajectory = Trajectory::along(&[map.extent().centre(cell)], &map, &BODY, &start).unwrap();
        assert_eq!(map.extent().cell_of(&states(&trajectory).last().unwrap().position), cell);
    }
}
