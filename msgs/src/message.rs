//! Which ROS type each struct is, and what its definition says.
//!
//! Invariant: every type that a definition mentions is in the list [`ALL`] itself, so that a
//! definition can always be completed. The texts are the `.msg` files, taken in at build time;
//! those under `src/standard` are the field lists of the packages that come with ROS 2.

use std::fmt;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A ROS message type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MessageType {
    /// The package it belongs to.
    pub package: &'static str,
    /// Its name in the package.
    pub name: &'static str,
    /// Its definition: the text of its `.msg` file.
    pub definition: &'static str,
}

impl fmt::Display for MessageType {
    /// The full name, as `ros2 topic list -t` shows it: `geometry_msgs/msg/Point`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/msg/{}", self.package, self.name)
    }
}

/// A struct that is a ROS message.
pub trait Message: Serialize + DeserializeOwned {
    /// The ROS type that it is.
    const TYPE: MessageType;
}

macro_rules! messages {
    ($($folder:literal: $package:ident { $($name:ident)* })*) => {
        $($(
            impl Message for crate::$package::$name {
                const TYPE: MessageType = MessageType {
                    package: stringify!($package),
                    name: stringify!($name),
                    definition: include_str!(concat!($folder, stringify!($name), ".msg")),
                };
            }
        )*)*

        /// Every type of this crate, by package and name.
        pub const ALL: &[MessageType] = &[$($(<crate::$package::$name as Message>::TYPE,)*)*];
    };
}

messages! {
    "standard/builtin_interfaces/": builtin_interfaces { Duration Time }
    "standard/diagnostic_msgs/": diagnostic_msgs { DiagnosticArray DiagnosticStatus KeyValue }
    "standard/geometry_msgs/": geometry_msgs {
        Point Pose PoseStamped PoseWithCovariance Quaternion Transform TransformStamped Twist TwistStamped
        TwistWithCovariance Vector3
    }
    "../msg/": maes_msgs {
        AgentMessage Body CellRuns Command Contact Counter Digest Intervention Join JoinReply Lidar MapChange Motion Observation
        Progress Radio Result ScanRequest Scenario SignedCommand SignedJoin SignedObservation WakeCondition
    }
    "standard/nav_msgs/": nav_msgs { MapMetaData OccupancyGrid Odometry Path }
    "standard/rcl_interfaces/": rcl_interfaces { Log }
    "standard/rosgraph_msgs/": rosgraph_msgs { Clock }
    "standard/sensor_msgs/": sensor_msgs { CompressedImage PointCloud2 PointField }
    "standard/std_msgs/": std_msgs { ColorRGBA Header String }
    "standard/tf2_msgs/": tf2_msgs { TFMessage }
    "standard/visualization_msgs/": visualization_msgs { Marker MarkerArray MeshFile UVCoordinate }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_as_ros_names_them() {
        assert_eq!(crate::maes_msgs::Observation::TYPE.to_string(), "maes_msgs/msg/Observation");
        assert_eq!(crate::tf2_msgs::TFMessage::TYPE.to_string(), "tf2_msgs/msg/TFMessage");
    }

    #[test]
    fn the_list_is_sorted_and_without_doubles() {
        assert!(ALL.is_sorted_by(|a, b| (a.package, a.name) < (b.package, b.name)));
    }
}
