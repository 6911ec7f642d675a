//! The package `geometry_msgs`: points, vectors and transforms. Metres; right-handed, z up.

use serde::{Deserialize, Serialize};

use crate::std_msgs::Header;

/// A place in space, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

/// A direction with a length; the field that holds it says the unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

/// A rotation as a unit quaternion. The default is no rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// Imaginary part along x.
    pub x: f64,
    /// Imaginary part along y.
    pub y: f64,
    /// Imaginary part along z.
    pub z: f64,
    /// Real part.
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

/// How to get from one frame to another: rotate, then translate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Where the origin of the child frame lies in the parent frame, metres.
    pub translation: Vector3,
    /// How the child frame is turned in the parent frame.
    pub rotation: Quaternion,
}

/// Where a frame is in its parent frame at a time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Sim time, and the parent frame.
    pub header: Header,
    /// The frame that is placed.
    pub child_frame_id: String,
    /// Its place in the parent frame.
    pub transform: Transform,
}

/// Where a body is and how it is turned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Its place, metres.
    pub position: Point,
    /// How it is turned.
    pub orientation: Quaternion,
}

/// A pose at a time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    /// When, and in which frame.
    pub header: Header,
    /// The pose.
    pub pose: Pose,
}

/// How a body moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Velocity, m/s.
    pub linear: Vector3,
    /// Rate of turning, rad/s about each axis.
    pub angular: Vector3,
}

/// How the motion of a body changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Accel {
    /// m/s^2.
    pub linear: Vector3,
    /// rad/s^2 about each axis.
    pub angular: Vector3,
}
