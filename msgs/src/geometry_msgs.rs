//! The package `geometry_msgs`: points, poses, velocities and transforms. Metres; right-handed, z
//! up.

use std::fmt;

use serde::de::{self, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

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

/// Where something is and how it is turned.
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
    /// Sim time, and the frame of the pose.
    pub header: Header,
    /// The pose.
    pub pose: Pose,
}

/// How fast something moves and turns; the field that holds it says in which frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Velocity, m/s.
    pub linear: Vector3,
    /// Turn rates about the axes, rad/s.
    pub angular: Vector3,
}

/// A twist at a time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistStamped {
    /// Sim time, and the frame that the twist is given in.
    pub header: Header,
    /// The twist.
    pub twist: Twist,
}

/// A pose and how sure it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// The pose.
    pub pose: Pose,
    /// How sure it is.
    pub covariance: Covariance,
}

/// A twist and how sure it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// The twist.
    pub twist: Twist,
    /// How sure it is.
    pub covariance: Covariance,
}

/// Elements of a 6 x 6 matrix.
const COVARIANCE_LENGTH: usize = 36;

/// A covariance by rows: x, y, z, and the rotations about them. All zeros: exact, or not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance(pub [f64; COVARIANCE_LENGTH]);

impl Default for Covariance {
    fn default() -> Self {
        Covariance([0.0; COVARIANCE_LENGTH])
    }
}

/// On the wire it is the bare array. Serde itself knows arrays of up to 32 elements only.
impl Serialize for Covariance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut elements = serializer.serialize_tuple(COVARIANCE_LENGTH)?;
        self.0.iter().try_for_each(|element| elements.serialize_element(element))?;
        elements.end()
    }
}

impl<'de> Deserialize<'de> for Covariance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Elements;

        impl<'de> Visitor<'de> for Elements {
            type Value = Covariance;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(formatter, "{COVARIANCE_LENGTH} numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Covariance, A::Error> {
                let mut covariance = Covariance::default();
                for (at, element) in covariance.0.iter_mut().enumerate() {
                    *element = elements.next_element()?.ok_or_else(|| de::Error::invalid_length(at, &self))?;
                }
                Ok(covariance)
            }
        }

        deserializer.deserialize_tuple(COVARIANCE_LENGTH, Elements)
    }
}

/// How a motion changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Accel {
    /// m/s^2.
    pub linear: Vector3,
    /// rad/s^2 about each axis.
    pub angular: Vector3,
}
