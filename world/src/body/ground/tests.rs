use std::collections::{BTreeMap, VecDeque};

use proptest::prelude::*;
use protocol::observation::Pose;
use voxels::{Clearance, Extent, Ground};

use super::super::super::spawn::check_room;
use super::super::Motion;
use super::*;

const DT_S: f64 = 0.02;

/// A floor with these heights in cells, from a digit for each column, under a ceiling.
fn hills(heights: &[Vec<u8>], cell_m: f64) -> Grid<Terrain> {
    let size = [heights[0].len() as u32 + 2, heights.len() as u32 + 2, 12];
    let mut terrain = Grid::new(Extent::new(size, cell_m).unwrap(), Terrain::Wall);
    for (y, row) in (1..).zip(heights) {
        for (x, &height) in (1..).zip(row) {
            (i32::from(height) + 1..11).for_each(|z| {
                terrain.set(Cell::new(x, y, z), Terrain::Free);
            });
        }
    }
    terrain
}

/// Nine rows of the same heights.
fn slope(heights: &str) -> Grid<Terrain> {
    hills(&vec![heights.bytes().map(|height| height - b'0').collect(); 9], 1.0)
}

fn body(terrain: &Grid<Terrain>, model: BodyModel, start: Cell) -> Option<Body> {
    let place = BodyLattice::of(model.radius_m, terrain.extent().cell_m()).place(terrain.extent(), start);
    let position = Floors::rest(terrain, &model, &place)?;
    Some(Body::at_rest(model, Pose { position, yaw_rad: 0.0 }))
}

/// Whether a wall is below a body, no deeper than it climbs: looked at bit by bit.
fn has_floor(terrain: &Grid<Terrain>, body: &Body) -> bool {
    let (extent, model) = (terrain.extent(), body.model());
    let climb = Climb::new(model.step_max_m, model.slope_max_rad, extent.cell_m());
    let touches = |depth_m: f64| {
        let centre = body.pose().position - Vector3::new(0.0, 0.0, depth_m);
        let mut walls = extent.cells().filter(|&cell| terrain.is_wall(cell));
        walls.any(|cell| is_touched(extent, cell, &centre, model.radius_m))
    };
    let steps = 8 * (climb.cells_max() + 1);
    (1..=steps).any(|step| touches(f64::from(step) / 8.0 * extent.cell_m() + 1e-6))
}

/// Drives on until the task ends.
fn run(body: &mut Body, terrain: &Grid<Terrain>, motion: Motion) -> MotionOutcome {
    body.set_task(motion);
    for _ in 0..50_000 {
        let moved = body.advance(&Obstacles::new(terrain, &[], 0), DT_S);
        if moved.task_done {
            return moved;
        }
    }
    panic!("it drives for ever: {body:?}");
}

#[test]
fn velocity_ahead_climbs_what_the_body_can() {
    const LEGS: BodyModel = BodyModel { step_max_m: 1.0, ..BodyModel::GROUND };
    const HIGH: BodyModel = BodyModel { step_max_m: 2.0, ..BodyModel::GROUND };
    let (stairs, ramp, ledge) = (slope("1111234444"), slope("11112222333344445555"), slope("1111333333"));
    for (terrain, model, is_passed) in [
        (&stairs, BodyModel::GROUND, false),
        (&stairs, LEGS, true),
        (&ramp, BodyModel::GROUND, true),
        (&ledge, LEGS, false),
        (&ledge, HIGH, true),
    ] {
        let mut body = body(terrain, model, Cell::new(2, 5, 9)).unwrap();
        assert_eq!(body.pose().position, Point3::new(2.5, 5.5, 2.5), "it is put on the floor");
        let ahead = Motion::Velocity {
            linear_in_body_m_s: Vector3::new(1.0, 5.0, -3.0),
            yaw_rate_rad_s: 0.0,
            path: Vec::new(),
        };
        assert!(run(&mut body, terrain, ahead).collided);
        let Point3 { coords } = body.pose().position;
        let end_m = f64::from(terrain.extent().size()[0]) - 1.0;
        assert_eq!(coords.x > end_m - 0.5, is_passed, "{coords} of {model:?}");
        assert!(coords.y == 5.5 && coords.z.fract() == 0.5, "{coords}");
        // And back.
        run(&mut body, terrain, Motion::turn(std::f64::consts::PI));
        run(&mut body, terrain, Motion::straight(0.7, f64::INFINITY));
        assert!(body.pose().position.x < 1.5 && body.pose().position.z == 2.5, "{:?}", body.pose());
    }
}

#[test]
fn body_does_not_fall_off_an_edge() {
    let terrain = slope("3333331111");
    let mut body = body(&terrain, BodyModel { step_max_m: 1.0, ..BodyModel::GROUND }, Cell::new(3, 5, 5)).unwrap();
    let end = run(&mut body, &terrain, Motion::straight(0.0, f64::INFINITY));
    assert!(end.collided && body.collision().is_some_and(|collision| collision.surface == Surface::Wall));
    let position = body.pose().position;
    assert!((7.0..=7.4).contains(&position.x) && position.z == 4.5, "{position}");
}

#[test]
fn holonomic_body_moves_aside_and_keeps_its_heading() {
    let terrain = slope("1111111111");
    let holonomic = BodyModel { drive: Drive::Holonomic, ..BodyModel::GROUND };
    let mut body = body(&terrain, holonomic, Cell::new(3, 3, 3)).unwrap();
    let to = Point3::new(3.5, 7.5, 8.0);
    run(&mut body, &terrain, Motion::Path(vec![to]));
    assert_eq!((body.pose().position, body.pose().yaw_rad), (Point3::new(3.5, 7.5, 2.5), 0.0));
}

#[test]
fn body_is_let_down_where_the_floor_goes_away() {
    let mut terrain = slope("4444444444");
    let mut body = body(&terrain, BodyModel::GROUND, Cell::new(3, 3, 5)).unwrap();
    (1..5).for_each(|z| {
        terrain.set(Cell::new(3, 3, z), Terrain::Free);
    });
    let obstacles = Obstacles::new(&terrain, &[], 0);
    (0..500).for_each(|_| {
        let moved = body.advance(&obstacles, DT_S);
        assert!(!moved.task_done && !moved.collided && moved.distance_m <= body.model().speed_max_m_s * DT_S + 1e-9);
    });
    assert_eq!(body.pose().position, Point3::new(3.5, 3.5, 1.5));
}

fn models() -> impl Strategy<Value = BodyModel> {
    let radius = prop_oneof![Just(0.4), Just(0.5), Just(1.0), 0.1..1.6_f64];
    let climbs = (prop_oneof![Just(0.0), Just(1.0), 0.0..3.0_f64], prop_oneof![Just(0.0), 0.0..0.8_f64]);
    (radius, climbs, any::<bool>(), 0.5..3.0_f64).prop_map(|(radius_m, (step_max_m, slope_max_rad), turns, speed)| {
        let drive = if turns { Drive::Differential } else { Drive::Holonomic };
        BodyModel { radius_m, step_max_m, slope_max_rad, drive, speed_max_m_s: speed, ..BodyModel::GROUND }
    })
}

/// Heights of which many are the same, so that there are slopes, stairs and ledges.
fn heights() -> impl Strategy<Value = Vec<Vec<u8>>> {
    let random = prop::collection::vec(prop::collection::vec(0_u8..4, 9), 9);
    let gentle = (prop::collection::vec(0_u8..2, 9), 0_u8..3).prop_map(|(rises, first)| {
        let row = rises.iter().scan(first, |at, rise| {
            *at = (*at + rise).min(6);
            Some(*at)
        });
        vec![row.collect(); 9]
    });
    prop_oneof![random, gentle]
}

fn motions() -> impl Strategy<Value = Motion> {
    let point = [0.0..11.0_f64, 0.0..11.0, 0.0..11.0].prop_map(|[x, y, z]| Point3::new(x, y, z));
    prop_oneof![
        Just(Motion::Stop),
        (-1.5..1.5_f64).prop_map(|pitch_rad| Motion::straight(pitch_rad, f64::INFINITY)),
        (-3.0..3.0_f64).prop_map(Motion::turn),
        prop::collection::vec(point, 1..4).prop_map(Motion::Path),
        ([-2.0..2.0_f64, -2.0..2.0, -2.0..2.0], -2.0..2.0_f64).prop_map(|(linear, yaw_rate_rad_s)| Motion::Velocity {
            linear_in_body_m_s: Vector3::from(linear),
            yaw_rate_rad_s,
            path: Vec::new(),
        }),
    ]
}

/// A shortest way along the axes between two cells, by the moves of a footing.
fn way(terrain: &Grid<Terrain>, model: &BodyModel, from: Cell, to: Cell) -> Option<Vec<Cell>> {
    let cell_m = terrain.extent().cell_m();
    let footing = model.footing(cell_m)?;
    let room = Clearance::for_body(model.radius_m, terrain).room(model.radius_m / cell_m);
    let mut before = BTreeMap::from([(from, from)]);
    let mut next = VecDeque::from([from]);
    while let Some(cell) = next.pop_front() {
        if cell == to {
            let mut cells: Vec<Cell> =
                std::iter::successors(Some(to), |cell| Some(before[cell])).take_while(|&cell| cell != from).collect();
            cells.reverse();
            return Some(cells);
        }
        for beside in cell.neighbours6() {
            if room.is_free(beside) && !before.contains_key(&beside) && footing.can_go(terrain, cell, beside) {
                before.insert(beside, cell);
                next.push_back(beside);
            }
        }
    }
    None
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn any_motion_keeps_free_space_and_a_floor(
        model in models(),
        heights in heights(),
        start in (1..10_i32, 1..10_i32),
        tasks in prop::collection::vec((motions(), 1..120_usize), 1..6),
    ) {
        let terrain = hills(&heights, 1.0);
        let Some(mut body) = body(&terrain, model, Cell::new(start.0, start.1, 9)) else { return Ok(()) };
        let obstacles = Obstacles::new(&terrain, &[], 0);
        prop_assume!(check_room(&terrain, [], &body.pose().position, model.radius_m).is_ok());
        for (motion, ticks) in tasks {
            body.set_task(motion);
            for tick in 0..ticks {
                body.advance(&obstacles, DT_S);
                prop_assert!(check_room(&terrain, [], &body.pose().position, model.radius_m - 1e-6).is_ok());
                prop_assert!(tick % 8 != 0 || has_floor(&terrain, &body), "{:?}", body.pose());
                let speed_m_s = body.velocity_in_map_m_s().norm();
                prop_assert!(speed_m_s <= model.speed_max_m_s + 1e-9, "{speed_m_s} m/s");
            }
        }
    }

    #[test]
    fn body_drives_wherever_its_footing_leads(
        model in models(), heights in heights(), start in (1..10_i32, 1..10_i32), goal in any::<prop::sample::Index>(),
    ) {
        let terrain = hills(&heights, 1.0);
        let extent = terrain.extent();
        let lattice = BodyLattice::of(model.radius_m, 1.0);
        let footing = model.footing(1.0).unwrap();
        let room = Clearance::for_body(model.radius_m, &terrain).room(model.radius_m);
        let standing: Vec<Cell> =
            extent.cells().filter(|&cell| room.is_free(cell) && footing.stands(&terrain, cell)).collect();
        let Some(&from) = standing.iter().min_by_key(|cell| (cell.x - start.0).abs() + (cell.y - start.1).abs()) else {
            return Ok(());
        };
        let to = standing[goal.index(standing.len())];
        let Some(cells) = way(&terrain, &model, from, to).filter(|cells| !cells.is_empty()) else { return Ok(()) };
        let mut body = body(&terrain, model, from).unwrap();
        prop_assert_eq!(body.pose().position, lattice.place(extent, from));
        let waypoints = cells.iter().map(|&cell| lattice.place(extent, cell)).collect();
        let end = run(&mut body, &terrain, Motion::Path(waypoints));
        prop_assert!(!end.collided, "{:?} at {:?}", cells, body.pose());
        prop_assert_eq!(body.pose().position, lattice.place(extent, to));
    }
}
