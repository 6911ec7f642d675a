//! The interface package and the structs say the same.
//!
//! - `fixtures`: the bytes that a real ROS 2 makes of each message, against ours;
//! - `sample`: a message with another value in every field.

#![expect(clippy::unwrap_used, reason = "a test that finds what it does not expect has failed")]

mod fixtures;
mod sample;

use std::fs;
use std::path::Path;

use msgs::message::{Message, MessageType};

/// A message type and what the tests do with it.
struct Case {
    message: MessageType,
    compare: fn(fixtures::Way, &[u8]),
}

impl Case {
    fn new<M: Message + Default + PartialEq + std::fmt::Debug>() -> Self {
        Case { message: M::TYPE, compare: fixtures::compare::<M> }
    }

    /// The name as it stands in a `.msg` file: `maes_msgs/Motion`.
    fn name(&self) -> String {
        format!("{}/{}", self.message.package, self.message.name)
    }
}

/// Types that no topic carries: parts of services and actions.
fn is_of_services(message: &MessageType) -> bool {
    let packages = ["action_msgs", "service_msgs", "simulation_interfaces", "unique_identifier_msgs"];
    let names = ["Accel", "TF2Error"];
    let is_of_parameters = message.package == "rcl_interfaces" && message.name != "Log";
    packages.contains(&message.package) || names.contains(&message.name) || is_of_parameters
}

/// One case for each type that a topic carries.
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
            AgentMessage Base Body CellRuns Command Contact Counter Digest Energy FieldOfView Intervention Join JoinReply Lidar MapChange
            MapFrames Motion Observation Progress Radio Result ScanRequest Scenario SignedCommand SignedJoin SignedObservation
            WakeCondition
        }
        nav_msgs { MapMetaData OccupancyGrid Odometry Path }
        octomap_msgs { Octomap }
        rcl_interfaces { Log }
        rosgraph_msgs { Clock }
        sensor_msgs { BatteryState CameraInfo CompressedImage Image LaserScan PointCloud2 PointField RegionOfInterest }
        std_msgs { ColorRGBA Header String }
        tf2_msgs { TFMessage }
        visualization_msgs { Marker MarkerArray MeshFile UVCoordinate }
    }
}

#[test]
fn no_type_is_left_out() {
    let names: Vec<MessageType> = cases().into_iter().map(|case| case.message).collect();
    let of_topics = msgs::message::ALL.iter().copied().filter(|message| !is_of_services(message));
    assert_eq!(names, of_topics.collect::<Vec<_>>());
}

#[test]
fn the_package_builds_every_file_there_is() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../msgs");
    let mut files: Vec<String> = fs::read_dir(folder.join("msg"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    let cmake = fs::read_to_string(folder.join("CMakeLists.txt")).unwrap();
    let built: Vec<&str> = cmake.lines().filter_map(|line| line.trim().strip_prefix("\"msg/")).collect();
    assert_eq!(built, files.iter().map(|file| format!("{file}\"")).collect::<Vec<_>>());
}
