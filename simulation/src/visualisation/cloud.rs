//! Point clouds of LiDAR scans.

use msgs::sensor_msgs::{PointCloud2, PointField};
use msgs::std_msgs::Header;
use nalgebra::Point3;
use protocol::map_views::{self, ExtraField};

use super::SensorId;
use crate::scenario::PointsField;
use crate::wire::{body_frame, header};
use world::World;
use world::body::Pose;
use world::lidar::{Measured, RayReturn, Scanner};

/// The intensity of a wall that a ray meets at a right angle: that of a matt white surface, as
/// LiDARs that are calibrated to reflectivities report it.
const INTENSITY_MAX: f64 = 100.0;

/// The hits of the last scan of a LiDAR, metres, in the frame of its body at the stamp, which is
/// that of the scan; `None` before the first scan. More than fit into a message are thinned evenly
/// over the rays: 4957 without further fields. Only a spinning LiDAR has the field `ring`.
#[must_use]
pub fn points(world: &World, sensor: SensorId, fields: &[PointsField]) -> Option<PointCloud2> {
    let SensorId { agent, number, .. } = sensor;
    let (pose, tick) = world.last_scan(agent)?;
    let header = Header { frame_id: body_frame(agent), ..header(tick) };
    let scanner = sensor.scanner(world)?;
    let returns = world.returns(agent, number.into(), scanner);
    Some(cloud(header, &pose, scanner, &returns, fields))
}

impl SensorId {
    /// The LiDAR; `None` if the agent has no such one.
    pub(super) fn scanner(self, world: &World) -> Option<&Scanner> {
        world.sensors(self.agent).lidars().get(usize::from(self.number)).map(|lidar| &lidar.scanner)
    }
}

fn cloud(header: Header, pose: &Pose, scanner: &Scanner, returns: &[RayReturn], fields: &[PointsField]) -> PointCloud2 {
    // As drivers order them.
    let fields = [PointsField::Intensity, PointsField::Ring, PointsField::Time]
        .into_iter()
        .filter(|field| fields.contains(field) && (*field != PointsField::Ring || has_rings(scanner)));
    let fields: Vec<PointsField> = fields.collect();
    let extra: Vec<ExtraField> = fields.iter().copied().map(extra_field).collect();
    let hits: Vec<(&RayReturn, Point3<f64>, f64)> = returns.iter().filter_map(hit).collect();
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    map_views::cloud_with(header, hits.len(), &extra, |number| {
        let (ray, point, incidence_cos) = hits[number];
        let [x, y, z]: [f64; 3] = (point - pose.position).into();
        let value = |field: &PointsField| match field {
            PointsField::Intensity => ((INTENSITY_MAX * incidence_cos) as f32).to_le_bytes().to_vec(),
            PointsField::Ring => ring(scanner, ray, pose.yaw_rad).to_le_bytes().to_vec(),
            // All rays of a scan are cast at its stamp.
            PointsField::Time => 0.0_f32.to_le_bytes().to_vec(),
        };
        ([cos * x + sin * y, cos * y - sin * x, z], fields.iter().flat_map(value).collect())
    })
}

fn has_rings(scanner: &Scanner) -> bool {
    scanner.grid().is_some_and(|grid| !grid.is_camera())
}

fn hit(ray: &RayReturn) -> Option<(&RayReturn, Point3<f64>, f64)> {
    let Measured::Surface { point, incidence_cos } = ray.measured else { return None };
    Some((ray, point, incidence_cos))
}

/// The line of a ray, 0 for the lowest.
fn ring(scanner: &Scanner, ray: &RayReturn, yaw_rad: f64) -> u16 {
    let place = scanner.grid().zip(scanner.place_of(&ray.direction, yaw_rad));
    place.map_or(0, |(grid, [row, _])| u16::try_from(grid.rows() - 1 - row).unwrap_or(u16::MAX))
}

fn extra_field(field: PointsField) -> ExtraField {
    let (name, datatype, bytes) = match field {
        PointsField::Intensity => ("intensity", PointField::FLOAT32, 4),
        PointsField::Ring => ("ring", PointField::UINT16, 2),
        PointsField::Time => ("time", PointField::FLOAT32, 4),
    };
    ExtraField { name, datatype, bytes }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use world::lidar::{Pattern, Projection, RayGrid};

    /// A level ring of three lines.
    fn ring_of_three(pitch_rad: f64) -> Scanner {
        let projection = Projection::Spherical { lowest_rad: -0.5, highest_rad: 0.5, rows: 3 };
        let grid = RayGrid { projection, columns: 8, horizontal_rad: std::f64::consts::TAU, pitch_rad };
        Scanner::new(Pattern::Grid(grid), f64::INFINITY, std::f64::consts::TAU)
    }

    fn return_at(point: Point3<f64>, incidence_cos: f64) -> RayReturn {
        RayReturn { direction: Vector3::x(), measured: Measured::Surface { point, incidence_cos } }
    }

    // The heading is along y: what is ahead has a positive x, what is at greater x of the map is to
    // the right.
    const POSE: Pose = Pose { position: Point3::new(1.0, 2.0, 3.0), yaw_rad: std::f64::consts::FRAC_PI_2 };

    #[test]
    fn points_are_in_the_frame_of_the_body() {
        let missed = RayReturn { direction: Vector3::x(), measured: Measured::Missed };
        let hits = [return_at(Point3::new(1.0, 6.0, 3.0), 1.0), missed, return_at(Point3::new(2.5, 2.0, 2.0), 1.0)];
        let cloud = cloud(Header::default(), &POSE, &ring_of_three(0.0), &hits, &[]);
        let numbers: Vec<f32> =
            cloud.data.chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
        let expected = [4.0, 0.0, 0.0, 0.0, -1.5, -1.0];
        assert!(numbers.iter().zip(expected).all(|(number, expected)| (number - expected).abs() < 1e-6), "{numbers:?}");
        assert_eq!((cloud.width, cloud.row_step, numbers.len()), (2, 24, 6));
    }

    #[test]
    fn fields_are_laid_out_as_drivers_do() {
        let fields = [PointsField::Time, PointsField::Ring, PointsField::Intensity];
        let hits = [return_at(Point3::new(1.0, 6.0, 3.0), 0.5)];
        let cloud = cloud(Header::default(), &POSE, &ring_of_three(0.0), &hits, &fields);
        let layout: Vec<_> =
            cloud.fields.iter().map(|field| (field.name.as_str(), field.offset, field.datatype)).collect();
        let (float, integer) = (PointField::FLOAT32, PointField::UINT16);
        let coordinates = [("x", 0, float), ("y", 4, float), ("z", 8, float)];
        let others = [("intensity", 12, float), ("ring", 16, integer), ("time", 18, float)];
        assert_eq!((layout, cloud.point_step), ([coordinates, others].concat(), 22));
        assert_eq!(cloud.data[12..], [&50.0_f32.to_le_bytes()[..], &[1, 0], &[0; 4]].concat());
    }

    #[test]
    fn rings_are_counted_from_the_lowest() {
        for pitch_rad in [0.0, 0.3] {
            let scanner = ring_of_three(pitch_rad);
            for (elevation_rad, expected) in [(-0.5, 0), (0.0, 1), (0.5, 2)] {
                // Straight ahead, with a body that heads along y if the LiDAR turns with it.
                let (up, ahead) = libm::sincos(elevation_rad + pitch_rad);
                let ray = RayReturn { direction: Vector3::new(0.0, ahead, up), measured: Measured::OutOfRange };
                assert_eq!(ring(&scanner, &ray, POSE.yaw_rad), expected, "{elevation_rad}");
            }
        }
    }
}
