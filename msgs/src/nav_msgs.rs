//! The package `nav_msgs`: where a body is, and where it is going.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::{PoseStamped, PoseWithCovariance, TwistWithCovariance};
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
