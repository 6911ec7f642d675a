use super::*;
use mapgen::{BuildingSpec, MapSpec, NoiseSpec, SpheresSpec, generate};
use proptest::prelude::*;
use voxels::Extent;

fn poses(spec: &SpawnSpec, terrain: &Grid<Terrain>, radii_m: &[f64]) -> Result<Vec<Pose>, SpawnError> {
    spec.poses(&Site { terrain, entrances: &[], seed: 7 }, &bodies(radii_m))
}

fn bodies(radii_m: &[f64]) -> Vec<BodyModel> {
    radii_m.iter().map(|&radius_m| BodyModel { radius_m, ..BodyModel::SUBMARINE }).collect()
}

fn hall() -> Grid<Terrain> {
    let layer = "#######\n#.....#\n#.....#\n#.....#\n#######\n";
    let solid = "#######\n#######\n#######\n#######\n#######\n";
    Grid::from_text(&[solid, layer, layer, layer, solid].join("\n")).unwrap()
}

#[test]
fn cube_nearest_to_the_origin_is_filled_x_slowest_then_up() {
    let spec = SpawnSpec::NearestOrigin { yaw_rad: 0.5 };
    let poses = poses(&spec, &hall(), &[0.4; 4]).unwrap();
    let positions: Vec<_> = poses.iter().map(|pose| pose.position).collect();
    assert_eq!(
        positions,
        [
            Point3::new(1.5, 1.5, 1.5),
            Point3::new(1.5, 2.5, 1.5),
            Point3::new(1.5, 3.5, 1.5),
            Point3::new(1.5, 1.5, 2.5),
        ]
    );
    assert!(poses.iter().all(|pose| pose.yaw_rad == 0.5));
}

#[test]
fn team_that_does_not_fit_is_refused() {
    let spec = SpawnSpec::NearestOrigin { yaw_rad: 0.0 };
    assert_eq!(poses(&spec, &hall(), &[0.4; 28]), Err(SpawnError::NoCube { edge: 4, agents: 28, fit: 27 }));
}

#[test]
fn a_list_is_checked_entry_by_entry() {
    let listed =
        |entries: Vec<Vec<f64>>, agents: usize| poses(&SpawnSpec::List { poses: entries }, &hall(), &vec![0.4; agents]);
    assert!(matches!(listed(vec![vec![1.5, 1.5, 1.5]], 2), Err(SpawnError::WrongCount { .. })));
    assert!(matches!(listed(vec![vec![1.5, 1.5]], 1), Err(SpawnError::NotAPose { index: 0, .. })));
    assert!(matches!(listed(vec![vec![1.5, f64::NAN, 1.0]], 1), Err(SpawnError::NotAPose { index: 0, .. })));
    assert!(matches!(listed(vec![vec![1.2, 1.5, 1.5]], 1), Err(SpawnError::NoRoom { index: 0, .. })));
    let too_near = listed(vec![vec![1.5, 1.5, 1.5], vec![2.0, 1.5, 1.5]], 2);
    assert!(matches!(too_near, Err(SpawnError::NoRoom { index: 1, .. })));
    let poses = listed(vec![vec![1.5, 1.5, 1.5], vec![3.0, 1.5, 1.5, 2.0]], 2).unwrap();
    assert_eq!(poses[1].yaw_rad, 2.0);
}

#[test]
fn each_agent_has_its_own_radius() {
    let entries = vec![vec![1.5, 1.5, 1.5], vec![2.9, 1.5, 1.5]];
    let spec = SpawnSpec::List { poses: entries };
    assert!(poses(&spec, &hall(), &[0.5, 0.5]).is_ok());
    assert!(matches!(poses(&spec, &hall(), &[0.5, 0.6]), Err(SpawnError::NoRoom { index: 1, .. })));
}

#[test]
fn bodies_wider_than_a_cell_start_side_by_side_near_the_origin() {
    let spec = SpawnSpec::NearestOrigin { yaw_rad: 0.5 };
    let positions = |radii_m: &[f64]| {
        let starts = poses(&spec, &hall(), radii_m).unwrap();
        starts.into_iter().map(|pose| [pose.position.x, pose.position.y, pose.position.z]).collect::<Vec<_>>()
    };
    assert_eq!(positions(&[0.6, 0.4]), [[2.0, 2.0, 2.0], [2.5, 3.5, 2.5]]);
    assert_eq!(positions(&[0.9; 2]), [[2.0, 2.0, 2.0], [4.0, 2.0, 2.0]]);
    assert_eq!(fit(poses(&spec, &hall(), &[0.9; 3])), 2);
    assert_eq!(fit(poses(&spec, &hall(), &[2.0])), 0);
}

#[test]
fn wide_bodies_start_in_one_connected_part() {
    // The part nearest to the origin has room for one body of a radius of a cell.
    let layer = "###########\n#...#.....#\n#...#.....#\n#...#.....#\n###########\n";
    let solid = "###########\n".repeat(5);
    let terrain = Grid::from_text(&[&solid, layer, layer, layer, &solid].map(str::to_owned).join("\n")).unwrap();
    let spec = SpawnSpec::NearestOrigin { yaw_rad: 0.0 };
    let starts = |agents| poses(&spec, &terrain, &vec![1.0; agents]).unwrap();
    assert_eq!(starts(1)[0].position, Point3::new(2.0, 2.0, 2.0));
    assert_eq!(starts(2)[0].position, Point3::new(6.0, 2.0, 2.0));
}

/// The number of bodies with room, from an error.
fn fit(outcome: Result<Vec<Pose>, SpawnError>) -> usize {
    match outcome {
        Err(SpawnError::Full { fit, .. } | SpawnError::NoCube { fit, .. }) => fit,
        other => panic!("expected an error that says how many fit, got {other:?}"),
    }
}

#[test]
fn a_box_is_packed_x_slowest_then_up() {
    let spec = SpawnSpec::Box { low: [2.0, 1.6, 0.0], high: [3.5, 9.0, 3.0], yaw_rad: 1.0 };
    let packed = poses(&spec, &hall(), &[0.4; 5]).unwrap();
    let cells: Vec<_> = packed.iter().map(|pose| hall().extent().cell_of(&pose.position)).collect();
    assert_eq!(cells, [(2, 2, 1), (2, 3, 1), (2, 2, 2), (2, 3, 2), (3, 2, 1)].map(|(x, y, z)| Cell::new(x, y, z)));
    assert!(packed.iter().all(|pose| pose.yaw_rad == 1.0));
    assert_eq!(fit(poses(&spec, &hall(), &[0.4; 9])), 8);
    let message = poses(&spec, &hall(), &[0.4; 9]).unwrap_err().to_string();
    assert_eq!(message, "spawn: 8 of 9 bodies find room in the box from [2.0, 1.6, 0.0] to [3.5, 9.0, 3.0] m");
}

#[test]
fn bodies_wider_than_a_cell_keep_clear_of_each_other_and_of_walls() {
    let spec = SpawnSpec::Box { low: [0.0; 3], high: [9.0; 3], yaw_rad: 0.0 };
    let packed = poses(&spec, &hall(), &[1.0; 2]).unwrap();
    let positions: Vec<_> = packed.iter().map(|pose| pose.position).collect();
    assert_eq!(positions, [Point3::new(2.0, 2.0, 2.0), Point3::new(4.0, 2.0, 2.0)]);
    assert_eq!(fit(poses(&spec, &hall(), &[1.0; 3])), 2);
    assert_eq!(fit(poses(&spec, &hall(), &[1.2; 2])), 1);
}

/// A building with one hallway along x and an entrance at its low end.
fn house() -> (Grid<Terrain>, Vec<Entrance>) {
    let solid = "#######\n#######\n#######\n";
    let terrain = Grid::from_text(&[solid, "#######\n#.....#\n#######\n", solid].join("\n")).unwrap();
    (terrain, vec![Entrance { cells: vec![Cell::new(1, 1, 1)], outward: Cell::new(-1, 0, 0) }])
}

#[test]
fn bodies_queue_at_an_entrance_facing_inwards() {
    let (terrain, entrances) = house();
    let site = Site { terrain: &terrain, entrances: &entrances, seed: 1 };
    let line = SpawnSpec::Entrances {}.poses(&site, &bodies(&[0.4; 3])).unwrap();
    let along: Vec<f64> = line.iter().map(|pose| pose.position.x).collect();
    assert_eq!(along, [1.5, 2.5, 3.5]);
    assert!(line.iter().all(|pose| pose.yaw_rad == 0.0));
    assert_eq!(fit(SpawnSpec::Entrances {}.poses(&site, &bodies(&[0.4; 6]))), 5);
    assert_eq!(poses(&SpawnSpec::Entrances {}, &terrain, &[0.4]), Err(SpawnError::NoEntrances));
}

#[test]
fn entrances_take_turns() {
    let (terrain, mut entrances) = house();
    entrances.push(Entrance { cells: vec![Cell::new(5, 1, 1)], outward: Cell::new(1, 0, 0) });
    let site = Site { terrain: &terrain, entrances: &entrances, seed: 1 };
    let lines = SpawnSpec::Entrances {}.poses(&site, &bodies(&[0.4; 5])).unwrap();
    let along: Vec<f64> = lines.iter().map(|pose| pose.position.x).collect();
    assert_eq!(along, [1.5, 5.5, 2.5, 4.5, 3.5]);
    assert_eq!(lines[1].yaw_rad, std::f64::consts::PI);
}

#[test]
fn scattered_starts_depend_on_the_seed() {
    let scattered = |run_seed, seed| {
        let spec = SpawnSpec::Scattered { min_distance_m: 1.5, seed, yaw_rad: 0.0 };
        spec.poses(&Site { terrain: &hall(), entrances: &[], seed: run_seed }, &bodies(&[0.4; 4])).unwrap()
    };
    assert_eq!(scattered(1, None), scattered(1, None));
    assert_eq!(scattered(1, Some(2)), scattered(2, None));
    assert_ne!(scattered(1, None), scattered(2, None));
}

#[test]
fn scattering_reports_how_many_fit() {
    let spec = |min_distance_m| SpawnSpec::Scattered { min_distance_m, seed: None, yaw_rad: 0.0 };
    assert_eq!(fit(poses(&spec(0.0), &hall(), &[0.4; 46])), 45);
    assert_eq!(fit(poses(&spec(100.0), &hall(), &[0.4; 2])), 1);
    assert_eq!(fit(poses(&spec(0.0), &hall(), &[2.0; 1])), 0);
}

proptest! {
    /// Placed bodies have room, and an error reports the size of a team that can be placed.
    #[test]
    fn every_start_has_room(
        walls in prop::collection::vec(0u8..4, 6 * 5 * 4),
        radii in prop::collection::vec(0.05f64..1.3, 1..12),
        kind in 0u8..3,
        min_distance_m in 0.0f64..3.0,
        seed: u64,
    ) {
        let extent = Extent::new([6, 5, 4], 1.0).unwrap();
        let cells = walls.iter().map(|&wall| if wall == 0 { Terrain::Wall } else { Terrain::Free }).collect();
        let terrain = Grid::from_vec(extent, cells).unwrap();
        let entrances = [Cell::new(0, 0, 0), Cell::new(5, 4, 1)]
            .map(|cell| Entrance { cells: vec![cell], outward: Cell::new(0, 1, 0) });
        let site = Site { terrain: &terrain, entrances: &entrances, seed };
        let spec = match kind {
            0 => SpawnSpec::Scattered { min_distance_m, seed: None, yaw_rad: 0.0 },
            1 => SpawnSpec::Box { low: [1.0, 0.0, 0.0], high: [5.0, 9.0, 3.0], yaw_rad: 0.0 },
            _ => SpawnSpec::Entrances {},
        };
        match spec.poses(&site, &super::tests::bodies(&radii)) {
            Ok(poses) => {
                let bodies: Vec<Sphere> = poses.iter().zip(&radii)
                    .map(|(pose, &radius_m)| Sphere { centre: pose.position, radius_m }).collect();
                prop_assert_eq!(bodies.len(), radii.len());
                for (index, body) in bodies.iter().enumerate() {
                    prop_assert_eq!(check_room(&terrain, &bodies[..index], &body.centre, body.radius_m), Ok(()));
                    let far = |other: &Sphere| (other.centre - body.centre).norm() >= min_distance_m;
                    prop_assert!(kind != 0 || bodies[..index].iter().all(far));
                }
            }
            Err(SpawnError::Full { fit, agents, .. }) => {
                prop_assert!(fit < agents && agents == radii.len());
                let mut largest_first = radii.clone();
                largest_first.sort_by(|one, other| other.total_cmp(one));
                let team = if kind == 0 { &largest_first } else { &radii };
                prop_assert!(spec.poses(&site, &super::tests::bodies(&team[..fit])).is_ok());
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}

proptest! {
    #[test]
    fn cells_with_room_are_listed_without_looking_at_each(
        size in (1u32..80, 1u32..12, 1u32..12),
        walls in prop::collection::vec(0u16..300, 500),
        placed in prop::collection::vec(any::<prop::sample::Index>(), 0..4),
        min_distance_m in prop_oneof![Just(0.0), 0.0f64..30.0],
        radius_cells in 0.1f64..4.0,
        cell_m in prop_oneof![Just(1.0), 0.1f64..3.0],
    ) {
        let extent = Extent::new([size.0, size.1, size.2], cell_m).unwrap();
        let cells = walls.iter().cycle().take(extent.volume());
        let cells = cells.map(|&wall| if wall == 0 { Terrain::Wall } else { Terrain::Free }).collect();
        let terrain = Grid::from_vec(extent, cells).unwrap();
        let radius_m = radius_cells * cell_m;
        let mut bodies = placed_bodies::PlacedBodies::new(&terrain, &[radius_m], min_distance_m * cell_m);
        for place in placed {
            bodies.place(extent.cell_at(place.index(extent.volume())), &Candidate { radius_m, footing: None });
        }
        let all = extent.cells().zip(0u32..).filter(|&(cell, _)| bodies.has_room(cell, radius_m));
        let expected: Vec<u32> = all.map(|(_, index)| index).collect();
        prop_assert_eq!(room::cells_with_room(&terrain, &bodies, radius_m), expected);
    }

    #[test]
    fn one_body_can_start_in_every_generated_map(kind in 0usize..3, seed: u64) {
        let spec = match kind {
            0 => MapSpec::Spheres(SpheresSpec::default()),
            1 => MapSpec::Noise(NoiseSpec::default()),
            _ => MapSpec::Building(BuildingSpec::default()),
        };
        let extent = Extent::new([30, 30, 13], 1.0).unwrap();
        if let Ok(map) = generate(&spec, extent, seed) {
            let start = SpawnSpec::Scattered { min_distance_m: 0.0, seed: None, yaw_rad: 0.0 };
            let site = Site { terrain: &map.terrain, entrances: &map.entrances, seed: map.report.seed };
            prop_assert_eq!(start.poses(&site, &super::tests::bodies(&[0.5])).map(|poses| poses.len()), Ok(1));
        }
    }
}

#[test]
fn bodies_that_fit_exactly_find_room_whatever_the_rounding() {
    for (cell_m, radii_m) in [
        (0.15, &[0.075, 0.3, 0.45][..]),
        (0.3, &[0.15, 0.6, 0.9]),
        (0.35, &[0.175, 0.7, 0.875, 1.05]),
        (0.6, &[0.3, 1.2, 1.8]),
        (0.7, &[0.35, 1.4, 1.75, 2.1]),
    ] {
        for &radius_m in radii_m {
            let wide = (2.0_f64 * radius_m / cell_m).round() as u32;
            // A hall as high as the body, and a duct in which it just fits.
            for size in [[20, 20, wide], [20, wide, wide]] {
                let mut terrain = Grid::new(Extent::new(size.map(|cells| cells + 2), cell_m).unwrap(), Terrain::Wall);
                for cell in terrain.extent().cells() {
                    let along = [(cell.x, size[0]), (cell.y, size[1]), (cell.z, size[2])];
                    if along.into_iter().all(|(at, cells)| (1..=cells.cast_signed()).contains(&at)) {
                        terrain.set(cell, Terrain::Free);
                    }
                }
                let site = Site { terrain: &terrain, entrances: &[], seed: 7 };
                for body in [BodyModel::GROUND, BodyModel::AERIAL] {
                    // Near the origin bodies of one cell start in a free cube of at least
                    // 3 x 3 x 3 cells, as in the reference.
                    let start = match wide {
                        1 => SpawnSpec::Scattered { min_distance_m: 0.0, seed: None, yaw_rad: 0.0 },
                        _ => SpawnSpec::NearestOrigin { yaw_rad: 0.0 },
                    };
                    let starts = start.poses(&site, &[BodyModel { radius_m, ..body }]).unwrap_or_else(|error| {
                        panic!("{:?} of {radius_m} m in {size:?} cells of {cell_m} m: {error}", body.kind)
                    });
                    assert!((starts[0].position.z - (cell_m + radius_m)).abs() < 1e-9, "{starts:?}");
                }
            }
        }
    }
}
