//! Bodies with several LiDARs.

use std::collections::BTreeSet;

use protocol::observation::Cells;

use super::lidar::{NamedScanner, Projection, RayGrid};
use super::*;

fn grid(projection: Projection, columns: u32, horizontal_rad: f64, pitch_rad: f64) -> Scanner {
    let grid = RayGrid { projection, columns, horizontal_rad, pitch_rad };
    Scanner::new(Pattern::Grid(grid), 6.0, TAU)
}

fn lattice(rays: u32, range_m: f64) -> Scanner {
    Scanner::new(Pattern::Lattice { rays }, range_m, TAU)
}

fn ring() -> Scanner {
    grid(Projection::Spherical { lowest_rad: -0.3, highest_rad: 0.3, rows: 12 }, 120, TAU, 0.0)
}

fn camera() -> Scanner {
    grid(Projection::Pinhole { vertical_rad: 1.0, rows: 30 }, 40, 1.4, 0.4)
}

fn suite(scanners: &[Scanner]) -> SensorSuite {
    let named = |scanner: &Scanner| NamedScanner { name: None, scanner: scanner.clone() };
    SensorSuite::new(scanners.iter().map(named).collect()).unwrap()
}

/// A hall with pillars.
fn pillars() -> Grid<Terrain> {
    let mut terrain = hall([16, 10, 6]);
    for cell in [[5, 4], [9, 7], [12, 3]].into_iter().flat_map(|[x, y]| (1..5).map(move |z| Cell::new(x, y, z))) {
        terrain.set(cell, Terrain::Wall);
    }
    terrain
}

/// Each pose of a way, some of them twice.
fn way() -> Vec<Pose> {
    let at = |x: f64, yaw_rad: f64| Pose { position: Point3::new(x, 5.5, 3.4), yaw_rad };
    vec![at(2.5, 0.0), at(2.5, 0.0), at(2.5, 2.0), at(7.2, 2.0), at(7.4, -1.0), at(2.5, 3.0), at(13.5, 0.5)]
}

/// The cells of the observations of an agent on the way, and its last view.
fn observed(sensors: &SensorSuite, noise: SensorNoise, threads: usize) -> (Cells, Cells) {
    let workers = workers(threads);
    let params = WorldParams { sensors: sensors.clone(), noise, ..params() };
    let mut world = World::new(pillars(), params, &way()[..1]);
    let (mut seen, mut view) = (Cells::default(), Cells::default());
    for pose in way() {
        world.place(A, pose).unwrap();
        let lidar = ScanRequest::Every(1);
        world.step([(A, Command { lidar, want_view: true, ..command(Motion::Keep) })].into());
        world.sense(&workers);
        let observation = world.observe(A, RequestKind::Scheduled);
        seen.free.extend(observation.seen.free);
        seen.wall.extend(observation.seen.wall);
        view = observation.view.unwrap();
    }
    (seen, view)
}

fn set(cells: impl IntoIterator<Item = u32>) -> BTreeSet<u32> {
    cells.into_iter().collect()
}

#[test]
fn agent_is_told_once_what_its_lidars_see_together() {
    let memory = SensorMemory::new(&pillars());
    let suites = [vec![lattice(2000, 4.0), camera()], vec![ring(), lattice(1500, 3.0)], vec![camera(), ring(), ring()]];
    for (number, scanners) in suites.iter().enumerate() {
        // A body knows the cells that it is in, which the lattice sees as well.
        let view = |pose: &Pose| scanners.iter().map(|scanner| scanner.view(&memory, pose)).collect::<Vec<_>>();
        let views: Vec<_> = way().iter().flat_map(view).collect();
        let sensors = suite(scanners);
        let (seen, last) = observed(&sensors, SensorNoise::default(), 1);
        let (free, wall) = (set(seen.free.clone()), set(seen.wall.clone()));
        assert_eq!((free.len(), wall.len()), (seen.free.len(), seen.wall.len()), "{number}: each cell once");
        assert_eq!(free, set(views.iter().flat_map(|view| view.free.clone())), "{number}");
        assert_eq!(wall, set(views.iter().flat_map(|view| view.wall.clone())), "{number}");
        let of_last = &views[views.len() - scanners.len()..];
        assert_eq!(set(last.free.clone()), set(of_last.iter().flat_map(|view| view.free.clone())), "{number}");
        assert!(last.free.is_sorted() && last.wall.is_sorted());
        assert_eq!(observed(&sensors, SensorNoise::default(), 3), (seen, last), "{number}: whatever the helpers");
    }
}

#[test]
fn noise_of_each_lidar_is_its_own() {
    let noise = SensorNoise { range_sigma_m: 0.3, seed: 7, ..SensorNoise::default() };
    let two = suite(&[camera(), camera()]);
    let mut world = World::new(pillars(), WorldParams { sensors: two.clone(), noise, ..params() }, &way()[..1]);
    world.sense(&workers(1));
    let [first, second] = [0, 1].map(|lidar| world.returns(A, lidar, &camera()));
    assert!(first != second && first.len() == second.len());
    assert_eq!(observed(&two, noise, 1), observed(&two, noise, 3));
}

#[test]
fn agents_have_lidars_of_their_own() {
    let sensors = suite(&[ring(), camera()]);
    let params = WorldParams { other_sensors: [(B, sensors)].into(), ..params() };
    let starts = [way()[0], way()[6]];
    let mut world = World::new(pillars(), params, &starts);
    assert_eq!((world.sensors(A).rays(), world.sensors(B).rays(), world.rays()), (500, 2640, 2640));
    world.sense(&workers(1));
    let [plain, fitted] = [A, B].map(|agent| world.observe(agent, RequestKind::Scheduled));
    assert_eq!(plain.field_of_view, None);
    let view = fitted.field_of_view.unwrap();
    assert!(view.horizontal_rad == 1.4 && (view.highest_rad - 0.9).abs() < 1e-12, "{view:?}");
    // Free cells that neither the ring nor the camera sees: below.
    let memory = SensorMemory::new(world.terrain());
    let seen = set([ring(), camera()].iter().flat_map(|scanner| scanner.view(&memory, &starts[1]).free));
    let below = world.terrain().extent().index(Cell::new(14, 5, 1)).unwrap() as u32;
    assert!(!seen.contains(&below) && seen.is_subset(&set(fitted.seen.free)));
}

#[test]
fn only_the_lidar_that_sees_agents_meets_them() {
    let sensors = suite(&[lattice(4000, f64::INFINITY), lattice(4000, f64::INFINITY).seeing_agents(true)]);
    let params = WorldParams { sensors, ..params() };
    let mut world = World::new(hall([12, 1, 1]), params, &[at(1.5, 1.5, 1.5), at(4.5, 1.5, 1.5)]);
    world.sense(&workers(1));
    let farthest_m = |lidar: usize| {
        let returns = world.returns(A, lidar, &world.sensors(A).lidars()[lidar].scanner);
        let ahead = returns.iter().max_by(|one, other| one.direction.x.total_cmp(&other.direction.x)).unwrap();
        ahead.point().unwrap().x
    };
    assert!((farthest_m(0) - 13.0).abs() < 0.01 && (farthest_m(1) - 4.1).abs() < 0.01);
}
