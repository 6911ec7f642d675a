//! The package `nav_msgs`: where a body is, where it is going, and maps of the plane.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;
use crate::geometry_msgs::{Pose, PoseStamped, PoseWithCovariance, TwistWithCovariance};
use crate::std_msgs::Header;

/// Where a body is and how it moves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// Sim time, and the frame of the pose.
    pub header: Header,
    /// The frame that the pose places, and that the twist is given in.
    pub child_frame_id: String,
    /// Where the child frame is.
    pub pose: PoseWithCovariance,
    /// How it moves, in the child frame.
    pub twist: TwistWithCovariance,
}

/// A way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// Sim time, and the frame of the way.
    pub header: Header,
    /// Its points, in order.
    pub poses: Vec<PoseStamped>,
}

/// The size and the place of a map of the plane.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapMetaData {
    /// Sim time of the map.
    pub map_load_time: Time,
    /// Length of a place, m.
    pub resolution: f32,
    /// Places along x.
    pub width: u32,
    /// Places along y.
    pub height: u32,
    /// The lower corner of the first place, in the frame of the map.
    pub origin: Pose,
}

/// A map of the plane.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OccupancyGrid {
    /// Sim time, and the frame of the map.
    pub header: Header,
    /// Size and place.
    pub info: MapMetaData,
    /// Row by row from the lowest y on: 0 free, 100 occupied, -1 unknown.
    pub data: Vec<i8>,
}

impl OccupancyGrid {
    /// A place that is free.
    pub const FREE: i8 = 0;
    /// A place that is occupied.
    pub const OCCUPIED: i8 = 100;
    /// A place of which nothing is known.
    pub const UNKNOWN: i8 = -1;
}
