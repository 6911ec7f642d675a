//! Point clouds of LiDAR scans.

use msgs::ids::AgentId;
use msgs::sensor_msgs::PointCloud2;
use msgs::std_msgs::Header;
use nalgebra::Point3;
use protocol::map_views;

use crate::wire::{body_frame, header};
use crate::world::World;
use crate::world::body::Pose;

/// The hits of the last scan of an agent, metres, in the frame of its body at the stamp, which is
/// that of the scan; `None` before the first scan. More than 4957 points are thinned evenly over
/// the rays.
#[must_use]
pub fn points(world: &World, agent: AgentId) -> Option<PointCloud2> {
    let (pose, tick) = world.last_scan(agent)?;
    let header = Header { frame_id: body_frame(agent), ..header(tick) };
    Some(cloud(header, &pose, &world.hits_from(agent, &pose)))
}

fn cloud(header: Header, pose: &Pose, hits: &[Point3<f64>]) -> PointCloud2 {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    map_views::cloud(header, hits.len(), |number| {
        let [x, y, z]: [f64; 3] = (hits[number] - pose.position).into();
        [cos * x + sin * y, cos * y - sin * x, z]
    })
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
}
