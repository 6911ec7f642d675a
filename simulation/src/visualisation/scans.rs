//! Scans as messages of other sensors: the plane of a spinning LiDAR, and the image of a depth
//! camera with its projection.
//!
//! Distances without a return are what REP 117 says: +Inf without a wall within the range, -Inf
//! before a wall that is too near, NaN for a return that noise has swallowed.

use msgs::sensor_msgs::{CameraInfo, Image, LaserScan};
use msgs::std_msgs::Header;
use protocol::map_views::CONTENT_BYTES_MAX;

use super::SensorId;
use crate::wire::{header, lidar_frame, optical_frame};
use world::World;
use world::body::Pose;
use world::lidar::{Measured, MiddleLine, Projection, RayGrid, RayReturn};

/// Bytes of a pixel.
const PIXEL_BYTES: u32 = 4;

/// A camera as OpenCV and `image_geometry` model it, without distortion. A pixel is at its centre.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Camera {
    width: u32,
    height: u32,
    /// The rays between two pixels of a row or a column, from the first ray on.
    step: u32,
    /// Focal lengths, pixels.
    focal: [f64; 2],
    /// Where the axis meets the image, pixels.
    centre: [f64; 2],
}

impl Camera {
    /// The camera of a frustum: with a pixel for each ray if such an image fits into a message,
    /// otherwise for every second or third one of each row and column, and so on. `None`: it is no
    /// frustum.
    fn of(grid: &RayGrid) -> Option<Self> {
        let Projection::Pinhole { vertical_rad, rows } = grid.projection else { return None };
        let size = |step: u32| [grid.columns.div_ceil(step), rows.div_ceil(step)];
        let fits = |step: &u32| {
            let [width, height] = size(*step).map(u64::from);
            width * height * u64::from(PIXEL_BYTES) <= CONTENT_BYTES_MAX as u64
        };
        let step = (1..).find(fits)?;
        let [width, height] = size(step);
        let scale = f64::from(step);
        let focal = |rays: u32, angle_rad: f64| f64::from(rays) / (2.0 * libm::tan(angle_rad / 2.0)) / scale;
        let centre = |rays: u32| (f64::from(rays) - 1.0) / 2.0 / scale;
        Some(Self {
            width,
            height,
            step,
            focal: [focal(grid.columns, grid.horizontal_rad), focal(rows, vertical_rad)],
            centre: [centre(grid.columns), centre(rows)],
        })
    }

    fn info(&self, header: Header) -> CameraInfo {
        let Self { width, height, focal: [fx, fy], centre: [cx, cy], .. } = *self;
        CameraInfo {
            header,
            height,
            width,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![0.0; 5],
            k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            ..CameraInfo::default()
        }
    }
}

/// The depths (metres along the axis) that the last scan of a camera has measured, by pixel; `None`
/// before the first scan, and of another LiDAR.
pub(super) fn depth_image(world: &World, sensor: SensorId) -> Option<Image> {
    let (pose, tick) = world.last_scan(sensor.agent)?;
    let scanner = sensor.scanner(world)?;
    let camera = Camera::of(scanner.grid()?)?;
    let (origin, axis) = (scanner.origin(&pose), scanner.axis(pose.yaw_rad));
    let mut depths_m = vec![f32::NAN; (camera.width * camera.height) as usize];
    for ray in world.returns(sensor.agent, sensor.number.into(), scanner) {
        let [row, column] = scanner.place_of(&ray.direction, pose.yaw_rad)?;
        if row % camera.step == 0 && column % camera.step == 0 {
            let pixel = row / camera.step * camera.width + column / camera.step;
            depths_m[pixel as usize] = informed(&ray.measured, |point| (point - origin).dot(&axis));
        }
    }
    Some(Image {
        header: Header { frame_id: optical_frame(sensor.agent, sensor.name), ..header(tick) },
        height: camera.height,
        width: camera.width,
        encoding: "32FC1".to_owned(),
        is_bigendian: 0,
        step: camera.width * PIXEL_BYTES,
        data: depths_m.into_iter().flat_map(f32::to_le_bytes).collect(),
    })
}

/// The projection of [`depth_image`].
pub(super) fn camera_info(world: &World, sensor: SensorId) -> Option<CameraInfo> {
    let (_, tick) = world.last_scan(sensor.agent)?;
    let camera = Camera::of(sensor.scanner(world)?.grid()?)?;
    Some(camera.info(Header { frame_id: optical_frame(sensor.agent, sensor.name), ..header(tick) }))
}

/// The distances in the plane of a LiDAR at its last scan, of the line that is closest to that
/// plane; `None` before the first scan, and without rings.
pub(super) fn laser_scan(world: &World, sensor: SensorId) -> Option<LaserScan> {
    let SensorId { agent, number, name } = sensor;
    let (pose, tick) = world.last_scan(agent)?;
    let line = sensor.scanner(world)?.middle_line()?;
    let MiddleLine { grid, elevation_rad, scanner } = &line;
    let returns = world.returns(agent, number.into(), scanner);
    // Distances are those of the line, projected to the plane.
    let level = libm::cos(*elevation_rad);
    let span_rad = grid.horizontal_rad.min(std::f64::consts::TAU);
    let increment_rad = span_rad / f64::from(grid.columns);
    let last_rad = (span_rad - increment_rad) / 2.0;
    let [least_m, greatest_m] = scanner.range_m();
    // Nothing in the map is farther away than its corners are from each other.
    let extent = world.terrain().extent();
    let diagonal_m = extent.size().map(|cells| f64::from(cells).powi(2)).iter().sum::<f64>().sqrt() * extent.cell_m();
    let period_s =
        world.scan_period_ticks(agent).map_or(0.0, |ticks| msgs::ids::Tick(ticks.into()).time_ns() as f64 / 1e9);
    Some(LaserScan {
        header: Header { frame_id: lidar_frame(agent, name), ..header(tick) },
        angle_min: -last_rad as f32,
        angle_max: last_rad as f32,
        angle_increment: increment_rad as f32,
        time_increment: 0.0,
        scan_time: period_s as f32,
        range_min: (least_m * level) as f32,
        range_max: (greatest_m.min(diagonal_m) * level) as f32,
        ranges: ranges(&line, &returns, &pose, level),
        intensities: Vec::new(),
    })
}

/// Counterclockwise, as angles grow.
fn ranges(line: &MiddleLine, returns: &[RayReturn], pose: &Pose, level: f64) -> Vec<f32> {
    let origin = line.scanner.origin(pose);
    let mut ranges_m = vec![f32::NAN; line.grid.columns as usize];
    for ray in returns {
        if let Some([_, column]) = line.scanner.place_of(&ray.direction, pose.yaw_rad) {
            let number = line.grid.columns - 1 - column;
            ranges_m[number as usize] = informed(&ray.measured, |point| (point - origin).norm() * level);
        }
    }
    ranges_m
}

/// A distance as REP 117 has it.
fn informed(measured: &Measured, distance_m: impl Fn(&nalgebra::Point3<f64>) -> f64) -> f32 {
    match measured {
        Measured::Surface { point, .. } => distance_m(point) as f32,
        Measured::OutOfRange => f32::INFINITY,
        Measured::TooNear => f32::NEG_INFINITY,
        Measured::Missed => f32::NAN,
    }
}

#[cfg(test)]
mod tests;
