//! Runs with depth cameras and spinning LiDARs: the same bytes over ROS 2, in memory, and forked,
//! and messages that a node of a real ROS 2 (rclpy on Fast DDS) compares with the map.

use std::collections::BTreeSet;

use msgs::sensor_msgs::{CameraInfo, Image, LaserScan, PointCloud2};
use msgs::std_msgs::Header;
use msgs::tf2_msgs::TFMessage;

use crate::support::processes::{Process, signal};
use crate::support::recordings::Recording;
use crate::support::runs::{Site, scenario, text};
use crate::support::{python, root};

/// The fields of points, all of them.
const FIELDS: &str = "views.points_fields=[\"intensity\", \"ring\", \"time\"]";

#[test]
fn depth_cameras_see_the_same_over_ros_and_forked() {
    let topics = ["--record-topics", "points,depth_image,camera_info,tf_static"];
    let recording = same_over_ros_and_forked("depth-camera.toml", &[], &topics);
    let infos: Vec<CameraInfo> = recording.of("/agent_1/depth/camera_info");
    let images: Vec<Image> = recording.of("/agent_1/depth/image");
    let headers = |headers: Vec<Header>| headers.into_iter().map(|header| header.stamp).collect::<Vec<_>>();
    assert!(images.len() > 50, "{} images", images.len());
    let of_infos = headers(infos.into_iter().map(|info| info.header).collect());
    assert_eq!(headers(images.into_iter().map(|image| image.header).collect()), of_infos);
}

#[test]
fn ring_lidars_see_the_same_over_ros_and_forked() {
    let topics = ["--record-topics", "points,scan,tf_static", "--set", FIELDS];
    let recording = same_over_ros_and_forked("ring-lidar.toml", &["--set", "lidar.columns=300"], &topics);
    let (scans, clouds) =
        (recording.of::<LaserScan>("/agent_2/scan").len(), recording.of::<PointCloud2>("/agent_2/points").len());
    assert!(scans > 50 && scans == clouds, "{scans} scans, {clouds} clouds");
}

#[test]
fn several_sensors_see_the_same_over_ros_and_forked() {
    let topics = ["--record-topics", "points,scan,depth_image,camera_info,tf_static,robot_description"];
    let keys = ["--set", "sensor.range_sigma_m=0.05"];
    let recording = same_over_ros_and_forked("two-sensors.toml", &keys, &topics);
    let clouds = |topic: &str| recording.of::<PointCloud2>(topic).len();
    let (top, front) = (clouds("/agent_0/top/points"), clouds("/agent_0/front/points"));
    assert!(top > 50 && top == front, "{top} clouds of the one, {front} of the other");
    assert_eq!(recording.of::<LaserScan>("/agent_0/top/scan").len(), top);
    let images: Vec<Image> = recording.of("/agent_1/front/depth/image");
    assert!(images.len() > 50 && images[0].header.frame_id == "agent_1/front_optical_frame", "{}", images.len());
    assert_eq!(recording.of::<CameraInfo>("/agent_1/front/depth/camera_info").len(), images.len());
    let frames: BTreeSet<String> = recording
        .of::<TFMessage>("/tf_static")
        .into_iter()
        .flat_map(|message| message.transforms.into_iter().map(|transform| transform.child_frame_id))
        .filter(|frame| !frame.ends_with("/odom"))
        .collect();
    let of_two = |agent: u32| ["top", "front", "front_optical_frame"].map(|name| format!("agent_{agent}/{name}"));
    let expected = [&of_two(0)[..], &of_two(1), &["agent_2/top".to_owned()]].concat();
    assert_eq!(frames, expected.into_iter().collect());
}

#[test]
fn bodies_in_the_way_are_the_same_over_ros_and_forked() {
    let sees_agents = ["--set", "lidar.sees_agents=true", "--set", "lidar.columns=200"];
    same_over_ros_and_forked("ring-lidar.toml", &sees_agents, &["--record-topics", "points"]);
}

/// The recording of a minute, with messages that change nothing.
fn same_over_ros_and_forked(file: &str, keys: &[&str], messages: &[&str]) -> Recording {
    let site = Site::new();
    let scenario = scenario(file);
    let plain = [&["--set", "duration_s=60"][..], keys].concat();
    let arguments = [&plain[..], messages].concat();
    let memory = site.record(&[&[text(&scenario), "--transport", "memory"][..], &arguments].concat());
    let ros = site.record(&[&[text(&scenario)][..], &arguments].concat());
    memory.assert_same(&ros, file);
    let without = site.record(&[&[text(&scenario), "--transport", "memory"][..], &plain].concat());
    assert_eq!(memory.digest(), without.digest(), "{file}: messages change nothing");

    site.file("run.mcap", &memory.bytes);
    site.assert_fork_is_same("30", &memory.digest());
    Recording::from_bytes(&memory.bytes)
}

#[test]
fn scans_and_points_of_rings_are_true_for_a_node_of_ros() {
    // The middle one of 15 lines is in the plane of the LiDAR, which is tilted.
    let rings = ["--set", "lidar.rows=15", "--set", "lidar.columns=90", "--set", "lidar.mount_pitch_rad=0.1"];
    agrees_with_the_map(
        "ring-lidar.toml",
        &["rings", "-15", "15", "15"],
        &[&rings[..], &["--rtf", "2", "--set", FIELDS]].concat(),
    );
}

#[test]
fn depth_images_are_true_for_a_node_of_ros() {
    let camera =
        ["--set", "lidar.columns=40", "--set", "lidar.mount_pitch_rad=-0.2", "--set", "lidar.mount_height_m=0.1"];
    agrees_with_the_map("depth-camera.toml", &["camera", "4.5"], &[&camera[..], &["--rtf", "2"]].concat());
}

#[test]
fn both_sensors_of_a_body_are_true_for_a_node_of_ros() {
    // In the frame of the whole team, of which agent 0 has both; an odd number of lines.
    let few = "lidars=[{name=\"top\", pattern=\"ring\", rows=15, columns=90, mount_height_m=0.2, mount_pitch_rad=0.1}, \
               {name=\"front\", agents=[0, 1], pattern=\"frustum\", columns=40, mount_pitch_rad=-0.5}]";
    agrees_with_the_map(
        "two-sensors.toml",
        &["rings@top", "-15", "15", "15", "+", "camera@front", "4.5"],
        &["--set", few, "--set", FIELDS, "--rtf", "2"],
    );
}

/// Fails unless what the sensors of a run measure agrees with the map, as a node of ROS 2 finds.
#[track_caller]
pub(crate) fn agrees_with_the_map(file: &str, arguments: &[&str], flags: &[&str]) {
    python::prepare_ros();
    let site = Site::new();
    let mut command = site.command("bash");
    command.args(python::in_ros()).arg("python3").arg(root().join("tests/sensor_observer.py")).args(arguments);
    let mut observer = Process::start(&mut command);
    observer.prints("ready");
    let scenario = scenario(file);
    let patient = ["--decision-timeout", "30"];
    let mut run = site.start(&mut site.run_sh(&[&[text(&scenario)][..], &patient, flags].concat()));
    observer.prints("received everything");
    observer.ended().with_code(0);
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
}
