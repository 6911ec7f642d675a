//! The interface package and the structs say the same.
//!
//! - `definitions`: the `.msg` files, as they are and as this test reads them, against the fields
//!   of the structs;
//! - `fixtures`: the bytes that a real ROS 2 makes of each message, against ours;
//! - `sample`: a message with another value in every field;
//! - `shape`: the fields of a struct, as serde sees them.

#![expect(clippy::unwrap_used, reason = "a test that finds what it does not expect has failed")]

mod definitions;
mod fixtures;
mod sample;
mod shape;

use msgs::message::{Message, MessageType};

/// A message type and what the tests do with it.
struct Case {
    message: MessageType,
    record: fn(&mut shape::Shapes),
    compare: fn(fixtures::Way, &[u8]),
}

impl Case {
    fn new<M: Message + Default + PartialEq + std::fmt::Debug>() -> Self {
        Case { message: M::TYPE, record: shape::record::<M>, compare: fixtures::compare::<M> }
    }

    /// The name as it stands in a `.msg` file: `maes_msgs/Motion`.
    fn name(&self) -> String {
        format!("{}/{}", self.message.package, self.message.name)
    }
}

/// One case for each type of the crate.
fn cases() -> Vec<Case> {
    macro_rules! cases {
        ($($package:ident { $($name:ident)* })*) => { vec![$($(Case::new::<msgs::$package::$name>(),)*)*] };
    }
    cases! {
        builtin_interfaces { Duration Time }
        diagnostic_msgs { DiagnosticArray DiagnosticStatus KeyValue }
        geometry_msgs {
            Point Pose PoseStamped PoseWithCovariance Quaternion Transform TransformStamped Twist TwistStamped TwistWithCovariance
            Vector3
        }
        maes_msgs {
            AgentMessage Body CellRuns Command Contact Counter Digest Intervention Join JoinReply Lidar MapChange Motion
            Observation Progress Radio Result ScanRequest Scenario SignedCommand SignedJoin SignedObservation WakeCondition
        }
        nav_msgs { MapMetaData OccupancyGrid Odometry Path }
        rcl_interfaces { Log }
        rosgraph_msgs { Clock }
        sensor_msgs { CompressedImage PointCloud2 PointField }
        std_msgs { ColorRGBA Header String }
        tf2_msgs { TFMessage }
        visualization_msgs { Marker MarkerArray MeshFile UVCoordinate }
    }
}

#[test]
fn no_type_is_left_out() {
    let names: Vec<MessageType> = cases().into_iter().map(|case| case.message).collect();
    assert_eq!(names, msgs::message::ALL);
}
