use super::super::{MapSpec, entrances, free_cells, generate, terrain_hash};
use super::rect::{Rect, Side};
use super::skeleton::{Core, CoreKind, Skeleton};
use super::*;
use proptest::prelude::*;
use voxels::{Grid, Terrain, free_components, is_wall_at};

fn extent(size: [u32; 3]) -> Extent {
    Extent::new(size, 1.0).unwrap()
}

/// A spec, most of the time a legal one, for a map of the size beside it.
fn any_building() -> impl Strategy<Value = (BuildingSpec, Extent)> {
    let sizes = (18u32..70, 18u32..70, 5u32..24);
    let storeys = (2u32..5, 1u32..3, 0u32..20);
    let plan = (0.01f64..0.9, 1u32..6, 2u32..8, 0.0f64..=1.0, (0u32..4, 0u32..8, 0u32..5));
    let cores = (0u32..4, 1u32..4, 0u32..3, 1u32..4, 0u32..3);
    (sizes, storeys, plan, cores).prop_map(|(size, (floor_height, slab, floors), plan, cores)| {
        let (hall_share, hall_width, room_side_min, split_chance, (padding, door_width, door_height)) = plan;
        let (staircases, stair_width, lift_shafts, lift_width, entrances) = cores;
        let door_padding = padding.min((room_side_min - 1) / 2);
        let spec = BuildingSpec {
            floors: 1 + floors % ((size.2 - 2 + slab) / (floor_height + slab)).max(1),
            floor_height,
            slab,
            hall_share,
            hall_width,
            room_side_min,
            split_chance,
            door_width: 1 + door_width % (room_side_min - 2 * door_padding).min(hall_width),
            door_height: 1 + door_height % floor_height,
            door_padding,
            staircases,
            stair_width,
            lift_shafts,
            lift_width,
            entrances,
        };
        (spec, extent([size.0, size.1, size.2]))
    })
}

proptest! {
    #[test]
    fn building_is_connected_and_complete((spec, extent) in any_building(), seed: u64) {
        let map_spec = MapSpec::Building(spec.clone());
        if let Err(refused) = map_spec.check(extent) {
            let is_about_a_key = matches!(refused, MapError::OutOfRange { .. });
            prop_assert!(is_about_a_key, "{refused}");
            return Ok(());
        }
        let map = match generate(&map_spec, extent, seed) {
            Ok(map) => map,
            Err(error) => {
                let too_many_entrances = matches!(error, MapError::OutOfRange { key: "entrances", .. });
                prop_assert!(too_many_entrances && spec.entrances > 2, "{error}");
                return Ok(());
            }
        };
        super::super::tests::assert_sound(&map, 1);
        prop_assert_eq!((map.report.pockets_removed, map.report.shell_cells_closed), (0, 0));
        prop_assert_eq!(entrances(&map_spec, extent, seed), Ok(map.entrances.clone()));

        prop_assert_eq!(map.entrances.len(), spec.entrances as usize);
        let [size_x, size_y, _] = extent.size().map(u32::cast_signed);
        for entrance in &map.entrances {
            prop_assert_eq!(entrance.cells.len() as u32, spec.door_width * spec.door_height);
            for &cell in &entrance.cells {
                prop_assert!(!is_wall_at(&map.terrain, cell));
                let outside = cell + entrance.outward;
                let is_in_shell = [0, size_x - 1].contains(&outside.x) || [0, size_y - 1].contains(&outside.y);
                prop_assert!(is_in_shell, "{:?}", entrance);
            }
        }
        prop_assert_eq!(generate(&map_spec, extent, seed), Ok(map));
    }

    #[test]
    fn every_floor_is_used_and_the_slabs_have_openings_of_cores_alone((spec, extent) in any_building(), seed: u64) {
        let spec = BuildingSpec { entrances: 0, ..spec };
        prop_assume!(spec.check(extent).is_ok());
        let map = generate(&MapSpec::Building(spec.clone()), extent, seed).unwrap();
        let skeleton = Skeleton::draw(&spec, extent, &mut voxels::random_streams::stream(seed, 0, "map.building"));
        let is_in_core = |cell: Cell| skeleton.cores.iter().any(|core| {
            let Rect { low, high } = core.rect;
            (low[0]..high[0]).contains(&cell.x) && (low[1]..high[1]).contains(&cell.y)
        });
        let bases: Vec<i32> = spec.bases().collect();
        let is_on_floor = |z: i32| bases.iter().any(|base| (*base..base + spec.floor_height as i32).contains(&z));
        for (cell, &terrain) in map.terrain.iter() {
            prop_assert!(terrain == Terrain::Wall || is_on_floor(cell.z) || is_in_core(cell), "{:?} is free", cell);
        }
        for base in bases {
            let hall = skeleton.halls[0];
            prop_assert!(!is_wall_at(&map.terrain, Cell::new(hall.low[0], hall.low[1], base)));
        }
    }

    #[test]
    fn rooms_have_walls_between_them_and_no_short_sides(
        low in prop::array::uniform2(2i32..9), sides in prop::array::uniform2(6i32..60), chance in 0.0f64..=1.0, seed: u64,
    ) {
        let region = Rect { low, high: [low[0] + sides[0], low[1] + sides[1]] };
        let spec = BuildingSpec { split_chance: chance, ..BuildingSpec::default() };
        let rooms = rooms::split(&spec, region, &mut voxels::random_streams::stream(seed, 0, "test"));
        let mut owner = std::collections::BTreeMap::new();
        for (number, room) in rooms.iter().enumerate() {
            prop_assert!(room.shortest_side() >= 6, "{:?}", room);
            for cell in room.raised(0, 1).cells() {
                prop_assert_eq!(owner.insert(cell, number), None, "rooms lie apart");
            }
        }
        for (&cell, number) in &owner {
            let apart = cell.neighbours26().into_iter().all(|next| owner.get(&next).is_none_or(|other| other == number));
            prop_assert!(apart, "a wall lies around room {}", number);
        }
        let can_be_split = sides.into_iter().any(|side| side >= 13);
        prop_assert_eq!(rooms.len() > 1, can_be_split, "the first split is always made");
    }
}

/// A change here changes what every reported seed stands for.
#[test]
fn a_seed_stands_for_the_same_building_for_ever() {
    let hash = |spec: &BuildingSpec, size, seed| {
        let map = generate(&MapSpec::Building(spec.clone()), extent(size), seed).unwrap();
        terrain_hash(&map.terrain).to_hex()[..32].to_owned()
    };
    let default = BuildingSpec::default();
    assert_eq!(hash(&default, [60, 60, 13], 7), "7960cd598f64cefd10b4fb54b0890496");
    let tower = BuildingSpec { floors: 5, lift_shafts: 2, lift_width: 3, staircases: 1, ..default.clone() };
    assert_eq!(hash(&tower, [30, 40, 30], 7), "221abd2be435d096cfe33b77d25b167b");
    assert_ne!(hash(&default, [60, 60, 13], 8), hash(&default, [60, 60, 13], 7));
}

/// The bar of the runs is measured on this building.
#[test]
fn the_default_building_has_what_it_says() {
    for seed in 0..20 {
        let map = generate(&MapSpec::Building(BuildingSpec::default()), extent([60, 60, 13]), seed).unwrap();
        let built = map.report.built.unwrap();
        assert_eq!((built.floors, built.staircases, built.lift_shafts, built.entrances), (3, 2, 0, 2));
        assert!(built.rooms >= 30 && built.doors >= built.rooms, "{built:?}");
    }
}

/// A staircase of two floors from the side, and from above at each layer.
#[test]
fn a_flight_rises_cell_by_cell_with_the_head_room_of_a_floor() {
    let spec =
        BuildingSpec { floors: 2, floor_height: 2, slab: 1, stair_width: 1, door_height: 1, ..BuildingSpec::default() };
    let rect = Rect { low: [1, 2], high: [5, 3] };
    let core = Core { kind: CoreKind::Stairs { up_to: 1 }, rect, hall: Side { axis: 1, end: 0 } };
    let mut terrain = Grid::new(extent([6, 4, 7]), Terrain::Wall);
    for block in stairs::carve(&spec, &core) {
        block.carve(&mut terrain);
    }
    let from_the_side = |y: i32| {
        let row = |z: i32| (0..6).map(|x| if is_wall_at(&terrain, Cell::new(x, y, z)) { '#' } else { '.' }).collect();
        (0..7).rev().map(row).collect::<Vec<String>>()
    };
    assert_eq!(from_the_side(2), ["######", "####.#", "###..#", "##..##", "#..###", "#.####", "######"]);
    assert_eq!(from_the_side(1), ["######", "######", "####.#", "######", "######", "#.####", "######"]);
    assert_eq!(free_components(&terrain).sizes.len(), 1);
    assert_eq!(free_cells(&terrain), 10);
}

#[test]
fn a_lift_is_a_shaft_with_a_door_on_every_floor() {
    let spec = BuildingSpec { floors: 3, floor_height: 2, door_height: 1, ..BuildingSpec::default() };
    let rect = Rect { low: [2, 1], high: [4, 3] };
    let core = Core { kind: CoreKind::Lift, rect, hall: Side { axis: 0, end: 0 } };
    let mut terrain = Grid::new(extent([5, 4, 10]), Terrain::Wall);
    for block in stairs::carve(&spec, &core) {
        block.carve(&mut terrain);
    }
    let free = |x: i32| -> Vec<i32> { (0..10).filter(|&z| !is_wall_at(&terrain, Cell::new(x, 1, z))).collect() };
    assert_eq!(free(2), [1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(free(1), [1, 4, 7]);
    assert_eq!(free(0), [0; 0]);
}

#[test]
fn doors_lead_from_room_to_room_where_no_hallway_is_near() {
    let rect = |low, high| Rect { low, high };
    let halls = [rect([1, 1], [20, 3])];
    // One room at the hallway, one behind it, and one that meets that one along two cells only.
    let rooms = [rect([1, 12], [8, 19]), rect([1, 4], [8, 11]), rect([9, 17], [18, 28])];
    let spec = BuildingSpec::default();
    for seed in 0..20 {
        let mut rng = voxels::random_streams::stream(seed, 0, "test");
        let connected = doors::connect(&spec, extent([22, 30, 5]), &halls, &rooms, &mut rng);
        assert_eq!(connected.rooms, rooms);
        let [to_hall, to_room, narrow] = connected.doors[..] else { panic!("{:?}", connected.doors) };
        for (door, y) in [(to_hall, 3), (to_room, 11)] {
            assert_eq!((door.low[1], door.high[1], door.along(0)), (y, y + 1, 2));
            assert!(door.low[0] >= 3 && door.high[0] <= 6, "padding on both sides: {door:?}");
        }
        assert_eq!(narrow, rect([8, 17], [9, 19]));
    }
    let alone = [rect([1, 12], [8, 19])];
    let mut rng = voxels::random_streams::stream(1, 0, "test");
    assert!(doors::connect(&spec, extent([22, 30, 5]), &halls, &alone, &mut rng).rooms.is_empty());
}

#[test]
fn refusals_name_what_fits() {
    let default = BuildingSpec::default();
    let refused = |spec: BuildingSpec, size| spec.check(extent(size)).unwrap_err().to_string();
    for (spec, size, expected) in [
        (
            BuildingSpec { floors: 4, ..default.clone() },
            [60, 60, 13],
            "floors is 4, allowed is 1 to 3: floors of 3 cells with 1 between them, in 13 along z",
        ),
        (BuildingSpec { floor_height: 12, ..default.clone() }, [60, 60, 13], "floor_height is 12, allowed is 2 to 11"),
        (
            default.clone(),
            [17, 18, 13],
            "room_side_min is 6, allowed is 2 to 4 on a map of 17x18x13 cells with a hallway 4 wide",
        ),
        (
            default.clone(),
            [9, 9, 13],
            "room_side_min is 6, allowed is none on a map of 9x9x13 cells: a hallway 4 wide needs 14 along x or y",
        ),
        (BuildingSpec { door_width: 3, ..default.clone() }, [60, 60, 13], "door_width is 3, allowed is 1 to 2"),
        (BuildingSpec { door_height: 4, ..default.clone() }, [60, 60, 13], "door_height is 4, allowed is 1 to 3"),
        (
            BuildingSpec { hall_share: 0.0, ..default.clone() },
            [60, 60, 13],
            "hall_share is 0, allowed is more than 0 and at most 0.9",
        ),
        (BuildingSpec { staircases: 0, ..default.clone() }, [60, 60, 13], "staircases is 0, allowed is 1 to 64"),
        (
            BuildingSpec { staircases: 15, ..default.clone() },
            [60, 60, 13],
            "staircases is 15, allowed is at most 14: no more find room along the first hallway",
        ),
        (
            BuildingSpec { lift_shafts: 50, ..default.clone() },
            [60, 60, 13],
            "lift_shafts is 50, allowed is at most 14: no more find room along the first hallway",
        ),
        (default.clone(), [60, 60, 4], "map size along z is 4 cells, generators need at least 5"),
    ] {
        assert_eq!(refused(spec, size), expected);
    }
    // What is said to fit does.
    for spec in
        [BuildingSpec { staircases: 14, ..default.clone() }, BuildingSpec { lift_shafts: 14, ..default.clone() }]
    {
        let map = generate(&MapSpec::Building(spec), extent([60, 60, 13]), 7).unwrap();
        assert_eq!(map.report.pockets_removed, 0);
    }
    let many = MapSpec::Building(BuildingSpec { entrances: 60, ..default.clone() });
    let error = generate(&many, extent([60, 60, 13]), 7).unwrap_err().to_string();
    assert!(error.ends_with("so many ends of hallways of this seed are at the outer wall"), "{error}");
    // Where nothing has to be joined there may be nothing that joins.
    assert_eq!(BuildingSpec { floors: 1, staircases: 0, ..default.clone() }.check(extent([60, 60, 13])), Ok(()));
    assert_eq!(BuildingSpec { lift_shafts: 1, staircases: 0, ..default }.check(extent([60, 60, 13])), Ok(()));
}

#[test]
fn the_text_form_has_the_ancestor_s_defaults_and_no_other_keys() {
    let default: BuildingSpec = toml::from_str("").unwrap();
    assert_eq!(default, BuildingSpec::default());
    let carried_over = (default.hall_share, default.hall_width, default.room_side_min, default.split_chance);
    assert_eq!(carried_over, (0.2, 4, 6, 0.85));
    assert_eq!((default.door_width, default.door_padding), (2, 2));
    assert_eq!(toml::from_str(&toml::to_string(&default).unwrap()), Ok(default));
    assert!(toml::from_str::<BuildingSpec>("storeys = 3").unwrap_err().message().contains("unknown field `storeys`"));
}
