//! A node of a real ROS 2 (rclpy on Fast DDS, from `launch_scripts/ros_env.sh`) looks on, and a participant of a third DDS.
//!
//! What they have to see is said in `onlooker.py` and `cyclone_onlooker.py`. They cannot see the seed of the map, and the run is the
//! same without them.

use crate::services;
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

/// A participant of Cyclone DDS.
fn cyclone_onlooker(site: &Site) -> Process {
    let mut command = site.command(python::for_cyclone());
    let mut onlooker = Process::start(command.arg(root().join("tests/cyclone_onlooker.py")));
    onlooker.prints("ready");
    onlooker
}

#[test]
fn onlookers_of_three_kinds_see_the_run_and_do_not_change_it() {
    let site = Site::new();
    let mut onlooker = onlooker(&site, &[]);
    let mut cyclone_onlooker = cyclone_onlooker(&site);
    let whole = site.record(&[&["--transport", "memory", "--duration", "600"][..], &FLAGS].concat());

    let mut run_sh = site.run_sh(&[&["--duration", "600", "--rtf", "4", "--record", "run.mcap"][..], &FLAGS].concat());
    let mut run = site.start(&mut run_sh);
    onlooker.prints("seen everything");
    onlooker.ended().with_code(0);
    cyclone_onlooker.prints("seen everything");
    cyclone_onlooker.ended().with_code(0);
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

    let mut onlooker = onlooker(&site, &["--then", "forever"]);
    // So slow that it does not end before everything has been seen, and as fast as possible from then on.
    let paced = ["--record", "run.mcap", "--rtf", "4", "--decision-timeout", "30"];
    let mut run_sh = site.run_sh(&[&paced[..], &flags].concat());
    let run = site.start(&mut run_sh);
    onlooker.prints("seen everything");
    drop(onlooker);
    services::play(&site, &["hurry"]);
    let ended = run.ended().with_code(0);
    assert_eq!(ended.digest(), undisturbed.digest());
}

#[test]
fn twenty_agents_are_not_disturbed_by_onlookers_that_come_and_go() {
    let site = Site::new();
    let flags = ["--agents", "20", "--size", "30", "--duration", "720", "--set", "stop_when_explored=false"];
    let undisturbed = site.record(&[&["--transport", "memory"][..], &flags].concat());

    let looks_on = ["--agents", "20", "--size", "30", "--look-ahead"];
    let mut early = onlooker(&site, &[&looks_on[..], &["--then", "forever"]].concat());
    // So slow that it does not end before everybody has seen everything.
    let paced = ["--record", "run.mcap", "--rtf", "4", "--agents-per-process", "5", "--decision-timeout", "30"];
    let mut run_sh = site.run_sh(&[&paced[..], &flags].concat());
    let mut run = site.start(&mut run_sh);
    run.is_under_way();
    let mut late = onlooker(&site, &[&looks_on[..], &["--then", "result"]].concat());
    early.prints("seen everything");
    drop(early);
    late.prints("seen everything");
    signal(run.process().pid(), "INT");
    let result = late.prints("result ");
    late.ended().with_code(0);
    let ended = run.ended().with_code(130);
    assert_eq!(result, format!("result {}", ended.digest()));
    site.recording("run.mcap").assert_begins(&Recording::from_bytes(&undisturbed.bytes), 1);
}
