//! Point clouds of LiDAR scans.

use msgs::ids::{AgentId, Tick};
use msgs::sensor_msgs::{PointCloud2, PointField};
use msgs::std_msgs::Header;
use nalgebra::Point3;
use protocol::limits::{MESSAGE_BYTES_BARE, VIEW_BYTES_MAX};
use voxels::{Cell, Extent, Terrain};

use crate::wire::{body_frame, header};
use crate::world::World;
use crate::world::body::Pose;

/// Bytes of a coordinate, and of a point.
const COORDINATE_BYTES: u32 = 4;
const POINT_BYTES: u32 = 3 * COORDINATE_BYTES;

/// Largest number of points in a cloud: 4957.
const POINTS_MAX: usize = (VIEW_BYTES_MAX - MESSAGE_BYTES_BARE) / POINT_BYTES as usize;

/// The hits of the last scan of an agent, metres, in the frame of its body at the stamp, which is
/// that of the scan; `None` before the first scan. More than 4957 points are thinned evenly over
/// the rays.
#[must_use]
pub fn points(world: &World, agent: AgentId) -> Option<PointCloud2> {
    let (pose, tick) = world.last_scan(agent)?;
    let header = Header { frame_id: body_frame(agent), ..header(tick) };
    Some(cloud(header, &pose, &world.hits_from(agent, &pose)))
}

/// The centres of the walls that are known, metres, in the frame `map`. More than 4957 are thinned
/// evenly.
pub(super) fn of_walls(extent: Extent, tick: Tick, known: impl Fn(Cell) -> Option<Terrain>) -> PointCloud2 {
    let walls = extent.cells().filter(|&cell| known(cell) == Some(Terrain::Wall));
    let centres: Vec<Point3<f64>> = walls.map(|cell| extent.centre(cell)).collect();
    cloud(header(tick), &Pose { position: Point3::origin(), yaw_rad: 0.0 }, &centres)
}

fn cloud(header: Header, pose: &Pose, hits: &[Point3<f64>]) -> PointCloud2 {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    let width = hits.len().min(POINTS_MAX);
    let mut data = Vec::with_capacity(width * POINT_BYTES as usize);
    for number in 0..width {
        let [x, y, z]: [f64; 3] = (hits[number * hits.len() / width] - pose.position).into();
        for coordinate in [cos * x + sin * y, cos * y - sin * x, z] {
            data.extend((coordinate as f32).to_le_bytes());
        }
    }
    let field = |(name, number): (&str, u32)| PointField {
        name: name.to_owned(),
        offset: number * COORDINATE_BYTES,
        datatype: PointField::FLOAT32,
        count: 1,
    };
    let width = width as u32;
    PointCloud2 {
        header,
        height: 1,
        width,
        fields: ["x", "y", "z"].into_iter().zip(0..).map(field).collect(),
        is_bigendian: false,
        point_step: POINT_BYTES,
        row_step: POINT_BYTES * width,
        data,
        is_dense: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_in_the_frame_of_the_body() {
        // The heading is along y: what is ahead has a positive x, what is at greater x of the map
        // is to the right.
        let pose = Pose { position: Point3::new(1.0, 2.0, 3.0), yaw_rad: std::f64::consts::FRAC_PI_2 };
        let hits = [Point3::new(1.0, 6.0, 3.0), Point3::new(2.5, 2.0, 2.0)];
        let cloud = cloud(Header::default(), &pose, &hits);
        let numbers: Vec<f32> =
            cloud.data.chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
        let expected = [4.0, 0.0, 0.0, 0.0, -1.5, -1.0];
        assert!(numbers.iter().zip(expected).all(|(number, expected)| (number - expected).abs() < 1e-6), "{numbers:?}");
        assert_eq!((cloud.width, cloud.row_step, numbers.len()), (2, 24, 6));
    }

    #[test]
    fn large_clouds_are_thinned_evenly() {
        let pose = Pose { position: Point3::origin(), yaw_rad: 0.0 };
        let hits: Vec<Point3<f64>> = (0..2 * POINTS_MAX).map(|number| Point3::new(number as f64, 0.0, 0.0)).collect();
        let header = Header { frame_id: body_frame(AgentId(999)), ..Header::default() };
        let cloud = cloud(header, &pose, &hits);
        assert_eq!(POINTS_MAX, 4957);
        assert_eq!(cloud.width as usize, POINTS_MAX);
        assert!(msgs::cdr::encode(&cloud).len() <= VIEW_BYTES_MAX);
        assert_eq!(cloud.data[12..16], 2.0_f32.to_le_bytes());
    }
}
