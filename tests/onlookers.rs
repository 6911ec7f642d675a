//! A node of a real ROS 2 (rclpy on Fast DDS, from `launch_scripts/ros_env.sh`) looks on.
//!
//! What it has to see is said in `onlooker.py`. It cannot see the seed of the map, and the run is the same without it.

use crate::support::processes::{Process, signal};
use crate::support::recordings::Recording;
use crate::support::runs::Site;
use crate::support::{python, root};

/// A run of two agents that are asked at every tick.
const FLAGS: [&str; 8] =
    ["--agents", "2", "--size", "20", "--look-ahead", "false", "--set", "stop_when_explored=false"];

fn onlooker(site: &Site, arguments: &[&str]) -> Process {
    python::prepare_ros();
    let mut command = site.command("bash");
    command.args(python::in_ros()).arg("python3").arg(root().join("tests/onlooker.py")).args(arguments);
    let mut onlooker = Process::start(&mut command);
    onlooker.prints("ready");
    onlooker
}

#[test]
fn a_ros_2_node_sees_the_run_and_does_not_change_it() {
    let site = Site::new();
    let mut onlooker = onlooker(&site, &[]);
    let whole = site.record(&[&["--transport", "memory", "--duration", "600"][..], &FLAGS].concat());

    let mut run_sh = site.run_sh(&[&["--duration", "600", "--rtf", "4", "--record", "run.mcap"][..], &FLAGS].concat());
    let mut run = site.start(&mut run_sh);
    onlooker.prints("seen everything");
    onlooker.ended().with_code(0);
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let interrupted = site.recording("run.mcap");
    // The identity of the run is the same; only the end differs.
    interrupted.assert_begins(&Recording::from_bytes(&whole.bytes), 1);
}

/// A reader that was killed acknowledges nothing, and the middleware believes in it for most of a minute.
#[test]
fn a_ros_2_node_that_is_killed_does_not_hold_the_run_back() {
    let site = Site::new();
    let flags = [&["--duration", "600"][..], &FLAGS].concat();
    let undisturbed = site.record(&[&["--transport", "memory"][..], &flags].concat());

    let mut onlooker = onlooker(&site, &["FOREVER"]);
    let mut run_sh = site.run_sh(&[&["--record", "run.mcap", "--decision-timeout", "30"][..], &flags].concat());
    let run = site.start(&mut run_sh);
    onlooker.prints("seen everything");
    drop(onlooker);
    let ended = run.ended().with_code(0);
    assert_eq!(ended.digest(), undisturbed.digest());
}
