use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::ops::ControlFlow;

use nalgebra::Point3;
use proptest::prelude::*;
use voxels::{Cell, Grid, Terrain, is_wall_at, walk};

use super::cast::Kernel;
use super::naive::NaiveEngine;
use super::*;
use crate::lidar::pattern::LANES;

fn pose(position: [f64; 3], yaw_rad: f64) -> Pose {
    Pose { position: position.into(), yaw_rad }
}

fn scanned(scanner: &Scanner, memory: &mut SensorMemory, pose: &Pose) -> (Vec<u32>, Vec<u32>) {
    let (mut free, mut wall) = (Vec::new(), Vec::new());
    scanner.scan(memory, pose, &mut free, &mut wall);
    free.sort_unstable();
    wall.sort_unstable();
    (free, wall)
}

/// The rays of a pattern that lie within the field of view, by the angle itself.
fn used(pattern: &Pattern, yaw_rad: f64, fov_rad: f64) -> impl Iterator<Item = Vector3<f64>> + use<> {
    let (sin, cos) = libm::sincos(yaw_rad);
    let heading = Vector3::new(cos, sin, 0.0);
    let turns = matches!(pattern, Pattern::Grid(grid) if grid.turns());
    let turned = move |ray: Vector3<f64>| Vector3::new(cos * ray.x - sin * ray.y, sin * ray.x + cos * ray.y, ray.z);
    let all = pattern.directions().into_iter().map(move |ray| if turns { turned(ray) } else { ray });
    all.filter(move |direction| fov_rad >= TAU || heading.dot(&direction.normalize()) > libm::cos(fov_rad / 2.0))
}

/// What a scan sees, by `voxels::walk` alone.
fn by_definition(
    terrain: &Grid<Terrain>,
    pose: &Pose,
    pattern: &Pattern,
    range_m: f64,
    fov_rad: f64,
    mount: Mount,
) -> (BTreeSet<u32>, BTreeSet<u32>) {
    let extent = terrain.extent();
    let index = |cell: Cell| extent.index(cell).unwrap() as u32;
    let range_m = match pattern {
        Pattern::Lattice { .. } | Pattern::Grid(_) => range_m,
        Pattern::Shell { .. } => extent.cell_m(),
    };
    let origin = pose.position + Vector3::z() * mount.height_m;
    let own = [pose.position, origin].map(|point| index(extent.cell_of(&point)));
    let (mut free, mut wall) = (BTreeSet::from(own), BTreeSet::new());
    for direction in used(pattern, pose.yaw_rad, fov_rad) {
        let mut crossed = Vec::new();
        let met = walk(extent, &origin, &direction, range_m, |cell, entry| {
            if is_wall_at(terrain, cell) {
                return ControlFlow::Break((cell, entry));
            }
            crossed.push(index(cell));
            ControlFlow::Continue(())
        });
        match met {
            ControlFlow::Break((_, entry)) if mount.min_range_m > 0.0 && entry <= mount.min_range_m => continue,
            ControlFlow::Break((cell, _)) => drop(wall.insert(index(cell))),
            ControlFlow::Continue(()) => {}
        }
        free.extend(crossed);
    }
    (free, wall)
}

#[test]
fn the_lattice_is_evenly_spread() {
    let rays = Pattern::Lattice { rays: 5124 }.directions();
    assert_eq!(rays.len(), 5124);
    assert!(rays.iter().all(|ray| (ray.norm() - 1.0).abs() < 1e-15));
    assert!(rays.iter().sum::<Vector3<f64>>().norm() < 1e-2);
    assert!(rays[0].x > 0.999 && rays[5123].x < -0.999);
    for ray in rays.iter().step_by(97) {
        let nearest = rays.iter().map(|other| ray.dot(other)).filter(|&cos| cos < 1.0 - 1e-12).fold(-1.0, f64::max);
        let degrees = libm::acos(nearest).to_degrees();
        assert!((2.4..2.9).contains(&degrees), "{degrees}");
    }
}

#[test]
fn the_lattice_turns_about_the_heading_at_yaw_0() {
    let rays = Pattern::Lattice { rays: 4 }.directions();
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let azimuth = TAU * 3.0 / golden;
    let polar = libm::acos(1.0 - 2.0 * 3.5 / 4.0);
    let expected =
        Vector3::new(libm::cos(polar), libm::cos(azimuth) * libm::sin(polar), libm::sin(azimuth) * libm::sin(polar));
    assert!((rays[3] - expected).norm() < 1e-14);
}

#[test]
fn the_shell_is_the_edge_of_a_ball() {
    let offsets = |radius_cells| Pattern::Shell { radius_cells }.directions();
    assert_eq!((offsets(1).len(), offsets(2).len(), offsets(5).len(), offsets(6).len()), (6, 26, 222, 354));
    assert!(offsets(5).iter().all(|offset| offset.norm() > 4.0 && offset.norm() <= 5.0));
}

#[test]
fn every_ray_is_in_exactly_one_bundle() {
    for pattern in [Pattern::Lattice { rays: 5124 }, Pattern::Lattice { rays: 3 }, Pattern::Shell { radius_cells: 5 }] {
        let directions = pattern.directions();
        let bundles = Bundle::pack(directions.clone());
        let key = |d: Vector3<f64>| [d.x, d.y, d.z].map(f64::to_bits);
        let packed: Vec<_> = bundles.iter().flat_map(|b| b.lanes(None).map(|lane| key(b.direction(lane)))).collect();
        assert_eq!(packed.len(), directions.len());
        assert_eq!(BTreeSet::from_iter(packed), BTreeSet::from_iter(directions.into_iter().map(key)));
        assert!(bundles.len() <= pattern.directions().len().div_ceil(LANES) + 7);
    }
}

#[test]
fn a_shell_sees_every_cell_up_to_its_edge() {
    let terrain = Grid::new(Extent::new([15, 15, 15], 0.5).unwrap(), Terrain::Free);
    let scanner = Scanner::new(Pattern::Shell { radius_cells: 5 }, 0.1, TAU);
    let body = pose([3.6, 3.9, 3.7], 0.0);
    let (free, wall) = scanned(&scanner, &mut SensorMemory::new(&terrain), &body);
    assert!(wall.is_empty(), "{wall:?}");
    let extent = terrain.extent();
    let own = extent.cell_of(&body.position);
    let offsets: BTreeSet<Cell> = free.iter().map(|&index| extent.cell_at(index as usize) - own).collect();
    for cell in extent.cells() {
        let d = cell - own;
        let squared = d.x * d.x + d.y * d.y + d.z * d.z;
        assert!(squared > 25 || offsets.contains(&d), "{d:?} is missed");
        assert!(squared <= 36 || !offsets.contains(&d), "{d:?} is too far");
    }
}

#[test]
fn a_cone_looks_along_the_heading() {
    let terrain = Grid::from_text("#####\n#...#\n#...#\n#...#\n#####\n").unwrap();
    let scanner = Scanner::new(Pattern::Lattice { rays: 5000 }, f64::INFINITY, PI / 2.0);
    let columns = |yaw_rad| {
        let (free, wall) = scanned(&scanner, &mut SensorMemory::new(&terrain), &pose([2.5, 2.5, 0.5], yaw_rad));
        (free, wall)
    };
    assert_eq!(columns(0.0), (vec![8, 12, 13, 18], vec![9, 14, 19]));
    assert_eq!(columns(PI), (vec![6, 11, 12, 16], vec![5, 10, 15]));
    assert_eq!(columns(PI / 2.0), (vec![12, 16, 17, 18], vec![21, 22, 23]));
}

#[test]
fn scan_reports_new_cells_only() {
    let terrain = Grid::from_text("......\n......\n").unwrap();
    let scanner = Scanner::new(Pattern::Lattice { rays: 500 }, 1.4, TAU);
    let mut memory = SensorMemory::new(&terrain);
    let (first, _) = scanned(&scanner, &mut memory, &pose([1.5, 0.5, 0.5], 0.0));
    let (again, _) = scanned(&scanner, &mut memory, &pose([1.5, 0.5, 0.5], 0.0));
    let (beside, _) = scanned(&scanner, &mut memory, &pose([2.5, 0.5, 0.5], 0.0));
    assert_eq!((first, again, beside), (vec![0, 1, 2, 6, 7, 8], vec![], vec![3, 9]));
}

#[test]
fn a_position_outside_sees_nothing() {
    let terrain = Grid::from_text("..\n").unwrap();
    let scanner = Scanner::new(Pattern::Lattice { rays: 100 }, f64::INFINITY, TAU);
    let mut memory = SensorMemory::new(&terrain);
    for position in [[2.0, 0.5, 0.5], [-0.1, 0.5, 0.5], [f64::NAN, 0.5, 0.5]] {
        assert_eq!(scanned(&scanner, &mut memory, &pose(position, 0.0)), (vec![], vec![]));
        assert_eq!(scanner.view(&memory, &pose(position, 0.0)), ScanView::default());
    }
}

#[test]
fn heading_matters_only_with_a_limited_view() {
    let scanner = |fov_rad| Scanner::new(Pattern::Lattice { rays: 10 }, 5.0, fov_rad);
    let (here, turned, moved) = (pose([1.0; 3], 0.0), pose([1.0; 3], 1.0), pose([1.1; 3], 0.0));
    assert!(scanner(TAU).sees_the_same(&here, &turned));
    assert!(!scanner(TAU).sees_the_same(&here, &moved));
    assert!(!scanner(3.0).sees_the_same(&here, &turned));
    assert!(scanner(3.0).sees_the_same(&here, &here));
}

/// A world, its terrain drawn at random, with a free place in it: anywhere, on cell boundaries or
/// in the middle of a cell.
fn any_world() -> impl Strategy<Value = (Grid<Terrain>, [f64; 3])> {
    let size = prop::array::uniform3(prop_oneof![1u32..4, 4u32..14]);
    (size, prop_oneof![Just(1.0), Just(0.5), Just(0.3)], 0.0..0.5).prop_flat_map(|(size, cell_m, share)| {
        let extent = Extent::new(size, cell_m).unwrap();
        let walls = prop::collection::vec(prop::bool::weighted(share), extent.volume());
        let place = prop::array::uniform3(prop_oneof![Just(0.0), Just(0.5), 0.0..1.0]);
        (walls, any::<prop::sample::Index>(), place).prop_map(move |(walls, own, place)| {
            let cells = walls.into_iter().map(|wall| if wall { Terrain::Wall } else { Terrain::Free });
            let mut terrain = Grid::from_vec(extent, cells.collect()).unwrap();
            let own = extent.cell_at(own.index(extent.volume()));
            let corner = [own.x, own.y, own.z].map(f64::from);
            let position = [0, 1, 2].map(|axis| (corner[axis] + place[axis]) * extent.cell_m());
            // Rounding may lift a place on a boundary into the next cell, or push it below its own.
            let own = extent.cell_of(&position.into());
            terrain.set(own, Terrain::Free);
            (terrain, position)
        })
    })
}

/// Rings, level and tilted, and cameras.
fn any_grid() -> impl Strategy<Value = Pattern> {
    let rows = 1..16_u32;
    let projection = prop_oneof![
        (-1.5..1.5, 0.0..1.0, rows.clone()).prop_map(|(lowest_rad, band, rows)| {
            Projection::Spherical { lowest_rad, highest_rad: lowest_rad + band, rows }
        }),
        prop::collection::vec(-1.5..1.5, 1..16).prop_map(|lines| Projection::Lines(Elevations::new(lines).unwrap())),
        (0.1..2.9, rows).prop_map(|(vertical_rad, rows)| Projection::Pinhole { vertical_rad, rows }),
    ];
    (projection, 1..24_u32, prop_oneof![Just(TAU), 0.1..2.9], prop_oneof![Just(0.0), -1.5..1.5]).prop_map(
        |(projection, columns, angle_rad, pitch_rad)| {
            let grid = RayGrid { projection, columns, horizontal_rad: angle_rad, pitch_rad };
            let horizontal_rad = if grid.is_camera() { angle_rad.min(2.9) } else { angle_rad };
            Pattern::Grid(RayGrid { horizontal_rad, ..grid })
        },
    )
}

fn any_scanner() -> impl Strategy<Value = (Pattern, f64, f64)> {
    let pattern = prop_oneof![
        (1u32..400).prop_map(|rays| Pattern::Lattice { rays }),
        (1u32..6).prop_map(|radius_cells| Pattern::Shell { radius_cells }),
        any_grid(),
    ];
    (pattern, prop_oneof![Just(f64::INFINITY), Just(1.0), 0.01..9.0], prop_oneof![Just(TAU), 0.1..TAU])
}

/// A scanner whose rays are followed for `1 << offset_bits` cells to see whether they need be cast.
fn with_culling(pattern: &Pattern, range_m: f64, fov_rad: f64, offset_bits: u32) -> Scanner {
    let scanner = Scanner::new(pattern.clone(), range_m, fov_rad);
    if scanner.rays.turning.is_some() {
        return scanner;
    }
    let culling = Some(Arc::new(Culling::new(pattern, &scanner.rays.bundles, offset_bits)));
    let rays = Rays {
        pattern: pattern.clone(),
        count: scanner.rays.count,
        bundles: scanner.rays.bundles.clone(),
        turning: None,
        culling,
    };
    Scanner { rays: Arc::new(rays), ..scanner }
}

/// The cells that an engine finds, ascending, and the count of its rays.
fn cast_by(engine: &mut dyn Engine, scanner: &Scanner, memory: &mut SensorMemory, pose: &Pose) -> Cast {
    let (mut free, mut wall) = (Vec::new(), Vec::new());
    let count = engine.cast(scanner, memory, pose, NewCells { free: &mut free, wall: &mut wall });
    free.sort_unstable();
    wall.sort_unstable();
    ([free, wall], count)
}

type Cast = ([Vec<u32>; 2], CastCount);

/// Marks cells as seen, whether they can be seen or not.
fn see(memory: &mut SensorMemory, cells: &[bool]) {
    let (mut free, mut wall) = (Vec::new(), Vec::new());
    for index in (0..memory.extent().volume()).filter(|&index| cells[index]) {
        memory.see(memory.extent().cell_at(index), &mut NewCells { free: &mut free, wall: &mut wall });
    }
}

/// Poses on a way of some steps, in cells, that stays in the map.
fn poses(extent: Extent, position: [f64; 3], steps: impl IntoIterator<Item = [f64; 3]>) -> Vec<Pose> {
    let mut position = Point3::from(position);
    let mut pose = |(step, yaw_rad): ([f64; 3], f64)| {
        let next = position + Vector3::from(step) * extent.cell_m();
        if extent.contains(extent.cell_of(&next)) {
            position = next;
        }
        Pose { position, yaw_rad }
    };
    steps.into_iter().zip((0..).map(f64::from)).map(&mut pose).collect()
}

proptest! {
    #[test]
    fn culled_scans_are_those_of_the_naive_engine(
        (terrain, position) in any_world(),
        (pattern, range_m, fov_rad) in any_scanner(),
        offset_bits in 1_u32..5,
        seen in prop::collection::vec(prop::bool::weighted(0.8), 2744),
        sees_at_random in any::<bool>(),
        steps in prop::collection::vec(prop::array::uniform3(prop_oneof![Just(0.0), -0.4..0.4, -1.5..1.5]), 1..24),
    ) {
        let scanner = with_culling(&pattern, range_m, fov_rad, offset_bits);
        let mut memories = [SensorMemory::new(&terrain), SensorMemory::new(&terrain)];
        if sees_at_random {
            memories.iter_mut().for_each(|memory| see(memory, &seen));
        }
        let [naive, culled] = &mut memories;
        for pose in poses(terrain.extent(), position, steps) {
            let (expected, all) = cast_by(&mut NaiveEngine::default(), &scanner, naive, &pose);
            let (found, count) = cast_by(&mut CullingEngine, &scanner, culled, &pose);
            prop_assert_eq!(expected, found);
            prop_assert!(naive.seen_cells().eq(culled.seen_cells()));
            // Each ray is cast, or it is said once why not.
            prop_assert_eq!(all.due(), u64::from(scanner.rays()));
            prop_assert_eq!(all.cast() + all.not_cast(NotCast::OutsideView), all.due());
            prop_assert_eq!(count.due(), all.due());
            prop_assert!(count.cast() <= all.cast());
            let left_out = [NotCast::NothingUnseen, NotCast::OutsideView].map(|reason| count.not_cast(reason));
            prop_assert_eq!(count.cast() + left_out.iter().sum::<u64>(), count.due());
            prop_assert!(left_out[1] <= all.not_cast(NotCast::OutsideView));
        }
    }

    /// However many scans are cast ahead, from the poses of later ones or from others.
    #[test]
    fn scans_ahead_change_no_scan(
        (terrain, position) in any_world(),
        (pattern, range_m, fov_rad) in any_scanner(),
        offset_bits in 2..5_u32,
        seen in prop::collection::vec(prop::bool::weighted(0.8), 2744),
        sees_at_random in any::<bool>(),
        steps in prop::collection::vec(
            (prop::array::uniform3(prop_oneof![Just(0.0), -0.4..0.4, -1.5..1.5]), 0..4_usize, prop::bool::weighted(0.2)),
            1..24,
        ),
    ) {
        let scanner = with_culling(&pattern, range_m, fov_rad, offset_bits);
        let mut memories = [SensorMemory::new(&terrain), SensorMemory::new(&terrain)];
        if sees_at_random {
            memories.iter_mut().for_each(|memory| see(memory, &seen));
        }
        let [naive, ahead] = &mut memories;
        let mut engine = SpeculativeEngine::default();
        let way = poses(terrain.extent(), position, steps.iter().map(|&(step, ..)| step));
        for (now, pose) in way.iter().enumerate() {
            let (_, scans_ahead, goes_astray) = steps[now];
            let mut previous = now.checked_sub(1).map(|last| way[last]);
            let poses = way.iter().skip(now).take(scans_ahead).chain(way.first().filter(|_| goes_astray));
            for pose in poses {
                engine.cast_ahead(&scanner, ahead, previous.as_ref(), pose);
                previous = Some(*pose);
            }
            let (expected, _) = cast_by(&mut NaiveEngine::default(), &scanner, naive, pose);
            let is_ahead = engine.is_ahead(&scanner, 0, pose);
            let (found, count) = cast_by(&mut engine, &scanner, ahead, pose);
            prop_assert_eq!(found, expected);
            prop_assert_eq!(count.not_cast(NotCast::CastAhead) > 0, is_ahead);
        }
    }

    #[test]
    fn scan_sees_what_walk_visits(
        (terrain, position) in any_world(),
        (pattern, range_m, fov_rad) in any_scanner(),
        yaw_rad in -PI..PI,
    ) {
        let body = pose(position, yaw_rad);
        prop_assume!(terrain.extent().contains(terrain.extent().cell_of(&body.position)));
        let scanner = Scanner::new(pattern.clone(), range_m, fov_rad);
        let (free, wall) = by_definition(&terrain, &body, &pattern, range_m, fov_rad, Mount::default());
        let sorted = |set: BTreeSet<u32>| set.into_iter().collect::<Vec<u32>>();
        let expected = (sorted(free), sorted(wall));

        let fresh = SensorMemory::new(&terrain);
        let view = scanner.view(&fresh, &body);
        prop_assert_eq!((&view.free, &view.wall), (&expected.0, &expected.1));

        let mut memory = fresh.clone();
        prop_assert_eq!(&scanned(&scanner, &mut memory, &body), &expected);
        prop_assert_eq!(scanned(&scanner, &mut memory, &body), (vec![], vec![]));

        for kernel in Kernel::available() {
            let mut memory = fresh.clone();
            let start = scanner.start(&fresh, &body).unwrap();
            let (mut free, mut wall) = (Vec::new(), Vec::new());
            let mut new = NewCells { free: &mut free, wall: &mut wall };
            let marks = memory.parts().marks;
            marks.see(start.slot(), &mut new);
            let rays = kernel.scan(marks, &start, &scanner.bundles(yaw_rad), 0.0, &mut new);
            prop_assert_eq!(rays, used(&pattern, yaw_rad, fov_rad).count() as u64);
            prop_assert_eq!((free.len(), wall.len()), (expected.0.len(), expected.1.len()));
            let seen: Vec<usize> = memory.seen_cells().collect();
            prop_assert_eq!(seen.len(), free.len() + wall.len());
        }
    }

    /// Every engine, with walls too near for a return, and with the sensor above or below the body.
    #[test]
    fn mounted_sensors_see_what_walk_visits(
        (terrain, position) in any_world(),
        (pattern, range_m, fov_rad) in any_scanner(),
        offset_bits in 1_u32..5,
        min_range_m in prop_oneof![Just(0.0), 0.0..3.0],
        height_m in -0.5..0.5,
        steps in prop::collection::vec(prop::array::uniform3(-0.6..0.6), 1..6),
    ) {
        let is_shell = matches!(pattern, Pattern::Shell { .. });
        let mount = Mount { height_m, min_range_m: if is_shell { 0.0 } else { f64::min(min_range_m, range_m) } };
        let extent = terrain.extent();
        let is_free = |pose: &Pose| [0.0, height_m].iter().all(|up| {
            let cell = extent.cell_of(&(pose.position + Vector3::z() * *up));
            extent.contains(cell) && !is_wall_at(&terrain, cell)
        });
        let scanner = with_culling(&pattern, range_m, fov_rad, offset_bits).on(mount);
        let [mut naive, mut culled] = [SensorMemory::new(&terrain), SensorMemory::new(&terrain)];
        let mut known = BTreeSet::new();
        for pose in poses(extent, position, steps).into_iter().filter(is_free) {
            let (free, wall) = by_definition(&terrain, &pose, &pattern, range_m, fov_rad, mount);
            let view = scanner.view(&naive, &pose);
            prop_assert!(view.free.iter().eq(&free) && view.wall.iter().eq(&wall));
            let returns = scanner.returns(&naive, &pose, &Bodies::default());
            prop_assert_eq!(&view.hits, &returns.iter().filter_map(RayReturn::point).collect::<Vec<_>>());
            let new = |all: &BTreeSet<u32>| all.difference(&known).copied().collect::<Vec<u32>>();
            let expected = [new(&free), new(&wall)];
            prop_assert_eq!(&cast_by(&mut NaiveEngine::default(), &scanner, &mut naive, &pose).0, &expected);
            prop_assert_eq!(&cast_by(&mut CullingEngine, &scanner, &mut culled, &pose).0, &expected);
            known.extend(free.into_iter().chain(wall));
        }
    }

    #[test]
    fn several_scans_find_each_cell_once(
        (terrain, position) in any_world(),
        shift in prop::array::uniform3(-2.0..2.0),
        (pattern, range_m, fov_rad) in any_scanner(),
    ) {
        let poses = [pose(position, 0.0), pose([0, 1, 2].map(|axis| position[axis] + shift[axis]), 2.0)];
        let is_free = |pose: &&Pose| !is_wall_at(&terrain, terrain.extent().cell_of(&pose.position));
        let scanner = Scanner::new(pattern.clone(), range_m, fov_rad);
        let mut memory = SensorMemory::new(&terrain);
        let mut known = BTreeSet::new();
        for pose in poses.iter().filter(is_free) {
            let (free, wall) = by_definition(&terrain, pose, &pattern, range_m, fov_rad, Mount::default());
            let all: BTreeSet<u32> = free.union(&wall).copied().collect();
            let (new_free, new_wall) = scanned(&scanner, &mut memory, pose);
            let new: BTreeSet<u32> = new_free.iter().chain(&new_wall).copied().collect();
            prop_assert_eq!(&new, &all.difference(&known).copied().collect());
            prop_assert!(new_free.iter().all(|index| free.contains(index)));
            known.extend(all);
        }
    }

    #[test]
    fn hits_lie_on_the_faces_of_walls(
        (terrain, position) in any_world(), (pattern, range_m, fov_rad) in any_scanner(),
    ) {
        let body = pose(position, 0.4);
        prop_assume!(terrain.extent().contains(terrain.extent().cell_of(&body.position)));
        let scanner = Scanner::new(pattern, range_m, fov_rad);
        let view = scanner.view(&SensorMemory::new(&terrain), &body);
        prop_assert_eq!(view.hits.is_empty(), view.wall.is_empty());
        prop_assert!(view.hits.len() >= view.wall.len());
        let cell_m = terrain.extent().cell_m();
        for hit in view.hits {
            let close = view.wall.iter().any(|&index| {
                let off = (hit - terrain.extent().centre(terrain.extent().cell_at(index as usize))).abs().max();
                (off / cell_m - 0.5).abs() < 1e-9
            });
            prop_assert!(close, "{hit} is on no wall");
        }
    }
}

#[test]
fn scans_of_a_known_place_cast_few_rays() {
    let extent = Extent::new([40; 3], 1.0).unwrap();
    let spec = mapgen::MapSpec::Spheres(mapgen::SpheresSpec::default());
    let terrain = mapgen::generate(&spec, extent, 1).unwrap().terrain;
    let scanner = with_culling(&Pattern::Lattice { rays: 2000 }, f64::INFINITY, TAU, 5);
    let mut memories = [SensorMemory::new(&terrain), SensorMemory::new(&terrain)];
    let [naive, culled] = &mut memories;
    let mut counts = CastCount::default();
    let free = extent.cells().filter(|&cell| !is_wall_at(&terrain, cell));
    for (cell, shift) in free.step_by(7).flat_map(|cell| [-0.2, 0.1, 0.1].map(|shift| (cell, shift))) {
        let body = Pose { position: extent.centre(cell) + Vector3::repeat(shift), yaw_rad: 0.0 };
        let (found, count) = cast_by(&mut CullingEngine, &scanner, culled, &body);
        assert_eq!(cast_by(&mut NaiveEngine::default(), &scanner, naive, &body).0, found);
        counts.add(&count);
    }
    assert!(counts.cast() * 5 < counts.due(), "{counts:?}");
    assert_eq!(counts.cast() + counts.not_cast(NotCast::NothingUnseen), counts.due());
}

#[test]
fn rays_leap_over_what_is_known_to_be_free() {
    let extent = Extent::new([40; 3], 1.0).unwrap();
    let mut terrain = Grid::new(extent, Terrain::Free);
    voxels::close_shell(&mut terrain, 1);
    let scanner = with_culling(&Pattern::Lattice { rays: 2000 }, f64::INFINITY, TAU, 5);
    let mut memory = SensorMemory::new(&terrain);
    let is_known: Vec<bool> = extent.cells().map(|cell| !is_wall_at(&terrain, cell)).collect();
    see(&mut memory, &is_known);
    let start = scanner.start(&memory, &pose([20.5; 3], 0.0)).unwrap();
    let parts = memory.parts();
    let culling = scanner.rays.culling.as_ref().unwrap();
    let active = culling.active_bundles(&start, f64::INFINITY, parts.marks, parts.culling).bundles;
    assert_eq!(active.iter().map(|(bundles, _)| bundles.len()).sum::<usize>(), scanner.bundles(0.0).len());
    // The walls are 18.5 m away or farther.
    assert!(active.iter().all(|&(_, clear_cells)| (15.0..30.0).contains(&clear_cells)), "{active:?}");
}

#[test]
fn grids_have_their_angles() {
    let degrees = |angle: f64| angle.to_radians();
    let ring = Projection::Spherical { lowest_rad: degrees(-15.0), highest_rad: degrees(15.0), rows: 16 };
    let level = RayGrid { projection: ring, columns: 36, horizontal_rad: TAU, pitch_rad: 0.0 };
    let elevations: Vec<f64> =
        level.directions().iter().step_by(36).map(|ray| libm::asin(ray.z).to_degrees().round()).collect();
    assert_eq!(elevations, (0..16).map(|line| f64::from(15 - 2 * line)).collect::<Vec<f64>>());
    assert!(!level.turns() && RayGrid { pitch_rad: 0.1, ..level }.turns());
    let camera = RayGrid {
        projection: Projection::Pinhole { vertical_rad: degrees(60.0), rows: 60 },
        columns: 80,
        horizontal_rad: degrees(80.0),
        pitch_rad: degrees(-20.0),
    };
    let rays = camera.directions();
    // The first ray is that of the pixel at the upper left, half a pixel from the corner.
    let [ahead, left, up] = [1.0, libm::tan(degrees(40.0)) * 79.0 / 80.0, libm::tan(degrees(30.0)) * 59.0 / 60.0];
    let (sin, cos) = libm::sincos(degrees(-20.0));
    let corner = Vector3::new(cos * ahead - sin * up, left, sin * ahead + cos * up).normalize();
    let mirrored = Vector3::new(corner.x, -corner.y, corner.z);
    assert!((rays[0] - corner).norm() < 1e-12 && (rays[79] - mirrored).norm() < 1e-12);
    let view = Scanner::new(Pattern::Grid(camera.clone()), 4.5, TAU).field_of_view().unwrap();
    let [lowest, highest] = [view.lowest_rad, view.highest_rad].map(|angle| angle.to_degrees().round());
    assert_eq!((lowest, highest, view.horizontal_rad.to_degrees().round()), (-50.0, 10.0, 80.0));
    assert!((0.9..1.3).contains(&view.spacing_rad.to_degrees()), "{view:?}");
    let swept = Scanner::new(Pattern::Grid(camera), 4.5, TAU).swept();
    assert!(swept.sees_all_around() && swept.rays() > 60 * 80 * 3);
}

#[test]
fn lines_have_their_elevations() {
    let lines = |lines: &[f64]| Projection::Lines(Elevations::new(lines.to_vec()).unwrap());
    // Denser about the horizon, as those of many automotive LiDARs, and in no order.
    let ring =
        RayGrid { projection: lines(&[-0.1, 0.3, 0.0, -0.4, 0.05]), columns: 24, horizontal_rad: TAU, pitch_rad: 0.0 };
    let rays = ring.directions();
    let elevations: Vec<f64> = rays.iter().step_by(24).map(|ray| (libm::asin(ray.z) * 1e6).round() / 1e6).collect();
    assert_eq!(elevations, [0.3, 0.05, 0.0, -0.1, -0.4]);
    for (number, ray) in (0..).zip(&rays) {
        assert_eq!(ring.place_of(ray), [number / 24, number % 24]);
    }
    let (middle, elevation_rad) = ring.middle_row().unwrap();
    assert_eq!((middle.rows(), elevation_rad), (1, 0.0));
    let view = ring.field_of_view(0.0);
    assert_eq!((view.lowest_rad, view.highest_rad, view.spacing_rad), (-0.4, 0.3, 0.4 - 0.1));
    // At equal distances they are the rays of such a ring.
    let equal = Projection::Spherical { lowest_rad: -0.25, highest_rad: 0.25, rows: 3 };
    let same = RayGrid { projection: lines(&[0.25, -0.25, 0.0]), ..ring.clone() };
    assert_eq!(same.directions(), RayGrid { projection: equal, ..ring }.directions());
    assert!(Elevations::new(Vec::new()).is_none() && Elevations::new(vec![0.0, f64::NAN]).is_none());
}

#[test]
fn body_with_a_camera_knows_the_cells_it_is_in() {
    let mut terrain = Grid::new(Extent::new([9; 3], 0.5).unwrap(), Terrain::Free);
    voxels::close_shell(&mut terrain, 1);
    let projection = Projection::Pinhole { vertical_rad: 0.5, rows: 9 };
    let camera = RayGrid { projection, columns: 9, horizontal_rad: 0.5, pitch_rad: 0.0 };
    let scanner = Scanner::new(Pattern::Grid(camera), 4.0, TAU);
    let body = pose([2.25, 2.25, 1.4], 0.0);
    let seen = |radius_m: f64| {
        let mut memory = SensorMemory::new(&terrain).of_body(radius_m);
        scanned(&scanner, &mut memory, &body).0
    };
    let (without, with) = (seen(0.0), seen(0.9));
    for index in (0..terrain.extent().volume()).filter(|&index| terrain[index] == Terrain::Free) {
        let centre = terrain.extent().centre(terrain.extent().cell_at(index));
        let gap = (centre - body.position).abs().map(|along| (along - 0.25).max(0.0)).norm();
        let index = index as u32;
        assert_eq!(with.contains(&index), without.contains(&index) || gap < 0.9, "{centre}, {gap}");
    }
    assert!(with.len() > without.len() + 20 && with.iter().all(|&index| terrain[index as usize] == Terrain::Free));
}

#[test]
fn a_body_that_keeps_still_scans_once() {
    let (exact, noisy) = (false, true);
    let all_around = Scanner::new(Pattern::Lattice { rays: 10 }, 5.0, TAU);
    let ahead = Scanner::new(Pattern::Lattice { rays: 10 }, 5.0, 3.0);
    let (here, turned) = (pose([1.0; 3], 0.0), pose([1.0; 3], 1.0));
    let reason = |scanner: &Scanner, differs: bool, last: Option<&Pose>, pose: &Pose| {
        NotCast::of_scan(|a, b| scanner.sees_the_same(a, b), differs, last, pose)
    };
    assert_eq!(reason(&all_around, exact, None, &here), None, "the first scan");
    assert_eq!(reason(&all_around, exact, Some(&here), &turned), Some(NotCast::SamePose));
    assert_eq!(reason(&ahead, exact, Some(&here), &turned), None);
    assert_eq!(reason(&all_around, noisy, Some(&here), &here), None);
}
