//! Observers: nodes of a real ROS 2 (rclpy on Fast DDS, from `launch_scripts/ros_env.sh`) and a
//! participant of Cyclone DDS.
//!
//! `observer.py` and `cyclone_observer.py` check what they receive. The run is the same without
//! them.

use crate::services;
use crate::support::processes::{Process, signal};
use crate::support::recordings::Recording;
use crate::support::runs::Site;
use crate::support::{python, root};

/// A run of two agents without look-ahead.
const FLAGS: [&str; 8] =
    ["--agents", "2", "--size", "20", "--look-ahead", "false", "--set", "stop_when_explored=false"];

fn observer(site: &Site, arguments: &[&str]) -> Process {
    python::prepare_ros();
    let mut command = site.command("bash");
    command.args(python::in_ros()).arg("python3").arg(root().join("tests/observer.py")).args(arguments);
    if ros_node::has_dds_fixes() {
        command.arg("--type-hashes");
    }
    let mut observer = Process::start(&mut command);
    observer.prints("ready");
    observer
}

/// A participant of Cyclone DDS.
fn cyclone_observer(site: &Site) -> Process {
    let mut command = site.command(python::for_cyclone());
    let mut observer = Process::start(command.arg(root().join("tests/cyclone_observer.py")));
    observer.prints("ready");
    observer
}

#[test]
fn observers_of_three_kinds_do_not_change_the_run() {
    observers_receive_everything(&[]);
}

/// Fails unless observers of three kinds receive everything of a run, which is the undisturbed one.
#[track_caller]
pub(crate) fn observers_receive_everything(flags: &[&str]) {
    let site = Site::new();
    let mut observer = observer(&site, &[]);
    let mut cyclone_observer = cyclone_observer(&site);
    let whole = site.record(&[&["--transport", "memory", "--duration", "600"][..], &FLAGS].concat());

    let paced = ["--duration", "600", "--rtf", "2", "--record", "run.mcap"];
    let mut run = site.start(&mut site.run_sh(&[&paced[..], &FLAGS, flags].concat()));
    observer.prints("received everything");
    observer.ended().with_code(0);
    cyclone_observer.prints("received everything");
    cyclone_observer.ended().with_code(0);
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let interrupted = site.recording("run.mcap");
    // The same run, with an earlier end.
    interrupted.assert_begins(&Recording::from_bytes(&whole.bytes), 1);
}

/// A killed reader acknowledges nothing, and the middleware takes most of a minute to drop it.
#[test]
fn killed_observer_does_not_block_the_run() {
    let site = Site::new();
    let flags = [&["--duration", "600"][..], &FLAGS].concat();
    let undisturbed = site.record(&[&["--transport", "memory"][..], &flags].concat());

    let mut observer = observer(&site, &["--then", "forever"]);
    // Slow until the observer has received everything, then as fast as possible.
    let paced = ["--record", "run.mcap", "--rtf", "2", "--decision-timeout", "30"];
    let mut run_sh = site.run_sh(&[&paced[..], &flags].concat());
    let run = site.start(&mut run_sh);
    observer.prints("received everything");
    drop(observer);
    services::play(&site, &["hurry"]);
    let ended = run.ended().with_code(0);
    assert_eq!(ended.digest(), undisturbed.digest());
}

#[test]
fn observers_may_come_and_go() {
    let site = Site::new();
    let flags = ["--agents", "20", "--size", "30", "--duration", "720", "--set", "stop_when_explored=false"];
    let undisturbed = site.record(&[&["--transport", "memory"][..], &flags].concat());

    let arguments = ["--agents", "20", "--size", "30", "--look-ahead"];
    let mut early = observer(&site, &[&arguments[..], &["--then", "forever"]].concat());
    // Slow enough for both observers to receive everything.
    let paced = ["--record", "run.mcap", "--rtf", "2", "--agents-per-process", "5", "--decision-timeout", "30"];
    let mut run_sh = site.run_sh(&[&paced[..], &flags].concat());
    let mut run = site.start(&mut run_sh);
    run.is_under_way(&site.path("run.mcap"));
    let mut late = observer(&site, &[&arguments[..], &["--then", "result"]].concat());
    early.prints("received everything");
    drop(early);
    late.prints("received everything");
    signal(run.process().pid(), "INT");
    let result = late.prints("result ");
    late.ended().with_code(0);
    let ended = run.ended().with_code(130);
    assert_eq!(result, format!("result {}", ended.digest()));
    site.recording("run.mcap").assert_begins(&Recording::from_bytes(&undisturbed.bytes), 1);
}
