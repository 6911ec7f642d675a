use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;

use nalgebra::{Point3, Vector3};
use protocol::body_model::BodyModel;
use protocol::limits::VIEW_BYTES_MAX;
use voxels::{Cell, Extent, Grid, Terrain, walk};

use super::*;
use msgs::ids::AgentId;
use world::comms::{Comms, ContactModel};
use world::lidar::{Mount, Pattern, Scanner};
use world::noise::SensorNoise;
use world::{ScanSchedule, WorldParams};

/// A hall of 38 x 30 x 10 free cells of half a metre with a pillar and a beam, closed all around.
fn hall() -> Grid<Terrain> {
    let mut terrain = Grid::new(Extent::new([40, 32, 12], 0.5).unwrap(), Terrain::Free);
    voxels::close_shell(&mut terrain, 1);
    for z in 1..11 {
        terrain.set(Cell::new(26, 14, z), Terrain::Wall);
    }
    for x in 1..39 {
        terrain.set(Cell::new(x, 22, 9), Terrain::Wall);
    }
    terrain
}

const POSE: Pose = Pose { position: Point3::new(8.3, 7.1, 2.9), yaw_rad: 0.4 };

/// The world after the first scan of its only agent.
fn scanned(grid: RayGrid, range_m: f64, mount: Mount, noise: SensorNoise) -> World {
    let params = WorldParams {
        schedule: ScanSchedule::OnRequest { period_ticks: 5 },
        noise,
        ..WorldParams::new(
            BodyModel { radius_m: 0.4, ..BodyModel::default() },
            Scanner::new(Pattern::Grid(grid), range_m, TAU).on(mount),
            Comms::perfect(ContactModel::LineOfSightAndRange { range_m: 5.0 }),
        )
    };
    let mut world = World::new(hall(), params, &[POSE]);
    world.sense(&world::workers::Workers::new(1).unwrap());
    world.step(BTreeMap::new());
    world
}

const ONLY: SensorId = SensorId { agent: AgentId(0), number: 0, name: None };

const MOUNT: Mount = Mount { height_m: 0.2, min_range_m: 0.0 };

fn ring(horizontal_rad: f64, pitch_rad: f64, [lowest_rad, highest_rad]: [f64; 2]) -> RayGrid {
    let projection = Projection::Spherical { lowest_rad, highest_rad, rows: 16 };
    RayGrid { projection, columns: 90, horizontal_rad, pitch_rad }
}

fn frustum(columns: u32, rows: u32, pitch_rad: f64) -> RayGrid {
    let projection = Projection::Pinhole { vertical_rad: 1.0, rows };
    RayGrid { projection, columns, horizontal_rad: 1.4, pitch_rad }
}

/// The distance of the wall that a ray meets, metres, found with nothing of the LiDAR.
fn true_distance_m(origin: Point3<f64>, direction: Vector3<f64>) -> Option<f64> {
    let hall = hall();
    let mut met = None;
    let _end = walk(hall.extent(), &origin, &direction, 1e3, |cell, entry| {
        if hall.get(cell) == Some(&Terrain::Wall) {
            met = Some(entry);
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    });
    met
}

/// A vector in the frame of the sensor, in the frame `map`.
fn in_map(in_sensor: Vector3<f64>, pitch_rad: f64) -> Vector3<f64> {
    let pitched = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), -pitch_rad) * in_sensor;
    nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), POSE.yaw_rad) * pitched
}

fn origin() -> Point3<f64> {
    POSE.position + Vector3::new(0.0, 0.0, MOUNT.height_m)
}

#[test]
fn ranges_are_those_of_rays_at_their_angles() {
    // Level and tilted, all around and ahead. The line closest to the plane is at 1 degree in the
    // first cases, and in the last one.
    let degree = 1.0_f64.to_radians();
    for (horizontal_rad, pitch_rad, lines, elevation_rad) in [
        (TAU, 0.0, [-15.0 * degree, 15.0 * degree], degree),
        (TAU, 0.2, [-15.0 * degree, 15.0 * degree], degree),
        (2.0, -0.1, [-15.0 * degree, 15.0 * degree], degree),
        (TAU, 0.0, [0.0, 30.0 * degree], 0.0),
    ] {
        let world = scanned(ring(horizontal_rad, pitch_rad, lines), f64::INFINITY, MOUNT, SensorNoise::default());
        let scan = laser_scan(&world, ONLY).unwrap();
        assert_eq!((scan.header.frame_id.as_str(), scan.header.stamp), ("agent_0/lidar", msgs::ids::Tick(0).into()));
        assert_eq!((scan.ranges.len(), scan.scan_time, scan.time_increment), (90, 0.1, 0.0));
        assert!((f64::from(scan.angle_max - scan.angle_min) / 89.0 - horizontal_rad / 90.0).abs() < 1e-6);
        for (number, &range_m) in (0..).zip(&scan.ranges) {
            let angle_rad = f64::from(scan.angle_min) + f64::from(number) * f64::from(scan.angle_increment);
            let (up, ahead) = libm::sincos(elevation_rad);
            let ray = Vector3::new(ahead * libm::cos(angle_rad), ahead * libm::sin(angle_rad), up);
            let expected_m = true_distance_m(origin(), in_map(ray, pitch_rad)).unwrap() * ahead;
            // The angle has the precision of the message.
            assert!((f64::from(range_m) - expected_m).abs() < 1e-3, "{number}: {range_m} {expected_m}");
            assert!(range_m <= scan.range_max && range_m >= scan.range_min);
        }
    }
}

#[test]
fn distances_without_a_return_say_why() {
    let mount = Mount { min_range_m: 7.0, ..MOUNT };
    let lines = [-0.1, 0.1];
    let world = scanned(ring(TAU, 0.0, lines), 9.0, mount, SensorNoise::default());
    let scan = laser_scan(&world, ONLY).unwrap();
    let count = |kind: fn(f32) -> bool| scan.ranges.iter().filter(|&&range_m| kind(range_m)).count();
    assert!(count(|range_m| range_m == f32::INFINITY) > 5, "{:?}", scan.ranges);
    assert!(count(|range_m| range_m == f32::NEG_INFINITY) > 5, "{:?}", scan.ranges);
    assert!(count(f32::is_finite) > 5 && count(f32::is_nan) == 0, "{:?}", scan.ranges);
    let finite = scan.ranges.iter().filter(|range_m| range_m.is_finite());
    assert!({ finite }.all(|range_m| (scan.range_min..=scan.range_max).contains(range_m)), "{scan:?}");

    let noise = SensorNoise { missed_returns: 0.5, seed: 3, ..SensorNoise::default() };
    let world = scanned(ring(TAU, 0.0, lines), f64::INFINITY, MOUNT, noise);
    let scan = laser_scan(&world, ONLY).unwrap();
    let missed = scan.ranges.iter().filter(|range_m| range_m.is_nan()).count();
    assert!((20..70).contains(&missed), "{missed}");
    let image = depth_image(&scanned(frustum(20, 10, 0.0), 8.0, MOUNT, noise), ONLY).unwrap();
    assert!(depths_m(&image).iter().any(|depth_m| depth_m.is_nan()));
}

fn depths_m(image: &Image) -> Vec<f32> {
    let (numbers, rest) = image.data.as_chunks();
    assert!(rest.is_empty());
    numbers.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}

#[test]
fn pixels_are_projected_as_the_camera_info_says() {
    for (columns, rows, pitch_rad, size) in
        [(81, 60, 0.0, [81, 60]), (80, 61, -0.3, [80, 61]), (320, 240, 0.2, [107, 80])]
    {
        let world = scanned(frustum(columns, rows, pitch_rad), f64::INFINITY, MOUNT, SensorNoise::default());
        let (image, info) = (depth_image(&world, ONLY).unwrap(), camera_info(&world, ONLY).unwrap());
        assert_eq!(([image.width, image.height], image.encoding.as_str(), image.step), (size, "32FC1", 4 * size[0]));
        assert_eq!((&info.header, info.width, info.height), (&image.header, image.width, image.height));
        assert_eq!(image.header.frame_id, "agent_0/camera_optical_frame");
        assert!(msgs::cdr::encode(&image).len() <= VIEW_BYTES_MAX);
        let [fx, _, cx, _, fy, cy, ..] = info.k;
        for (number, &depth_m) in (0..).zip(&depths_m(&image)) {
            let (u, v) = (f64::from(number % image.width), f64::from(number / image.width));
            let (right, down) = ((u - cx) / fx, (v - cy) / fy);
            let ray = Vector3::new(1.0, -right, -down);
            let distance_m = true_distance_m(origin(), in_map(ray.normalize(), pitch_rad)).unwrap();
            let expected_m = distance_m / ray.norm();
            assert!((f64::from(depth_m) - expected_m).abs() < 1e-5, "{u} {v}: {depth_m} {expected_m}");
        }
    }
}

#[test]
fn depths_beyond_the_range_are_infinite() {
    let world = scanned(frustum(80, 60, 0.0), 8.0, MOUNT, SensorNoise::default());
    let depths_m = depths_m(&depth_image(&world, ONLY).unwrap());
    assert!(depths_m.contains(&f32::INFINITY) && depths_m.iter().any(|depth_m| depth_m.is_finite()));
    assert!(depths_m.iter().all(|&depth_m| depth_m == f32::INFINITY || depth_m <= 8.0));
}

#[test]
fn each_sensor_has_its_own_messages() {
    let camera = scanned(frustum(8, 6, 0.0), 4.5, MOUNT, SensorNoise::default());
    let rings = scanned(ring(TAU, 0.0, [-0.1, 0.1]), 4.5, MOUNT, SensorNoise::default());
    assert!(laser_scan(&camera, ONLY).is_none() && depth_image(&rings, ONLY).is_none());
    assert!(camera_info(&rings, ONLY).is_none());
    // Angles are those of the body, whatever its heading.
    let first = laser_scan(&rings, ONLY).unwrap();
    assert!((f64::from(first.angle_min) + PI * 89.0 / 90.0).abs() < 1e-6);
}
