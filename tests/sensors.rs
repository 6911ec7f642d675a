//! Runs with depth cameras and spinning LiDARs: the same bytes over ROS 2, in memory, and forked.

use crate::support::runs::{Site, scenario, text};

#[test]
fn depth_cameras_see_the_same_over_ros_and_forked() {
    same_over_ros_and_forked("depth-camera.toml");
}

#[test]
fn ring_lidars_see_the_same_over_ros_and_forked() {
    same_over_ros_and_forked("ring-lidar.toml");
}

fn same_over_ros_and_forked(file: &str) {
    let site = Site::new();
    let scenario = scenario(file);
    let arguments = ["--set", "duration_s=60"];
    let memory = site.record(&[&[text(&scenario), "--transport", "memory"][..], &arguments].concat());
    let ros = site.record(&[&[text(&scenario)][..], &arguments].concat());
    memory.assert_same(&ros, file);

    site.file("run.mcap", &memory.bytes);
    site.assert_fork_is_same("30", &memory.digest());
}
