//! A mixed team of ground and aerial bodies: the same bytes over ROS 2 and in memory, and verified
//! and forked.

use crate::support::processes::Process;
use crate::support::runs::{Site, scenario, text};

#[test]
fn ground_team_is_the_same_over_ros_verified_and_forked() {
    let site = Site::new();
    let scenario = scenario("ground.toml");
    let whole = site.record(&[text(&scenario), "--transport", "memory"]);
    let over_ros = site.start(&mut site.run_sh(&[text(&scenario), "--record", "run.mcap"])).ended().with_code(0);
    assert_eq!(over_ros.digest(), whole.digest());
    assert!(std::fs::read(site.path("run.mcap")).expect("it is complete") == whole.bytes, "run.mcap");

    let maes = |arguments: &[&str]| Process::start(site.binary("maes").args(arguments)).ended().with_code(0);
    assert_eq!(maes(&["verify", "run.mcap", "--controllers"]).digest(), whole.digest());
    let fork = maes(&["run", "--transport", "memory", "--fork", "run.mcap", "--at", "20", "--record", "fork.mcap"]);
    assert_eq!(fork.digest(), whole.digest(), "a fork without a change");
}
