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

    let verified = Process::start(site.binary("maes").args(["verify", "run.mcap", "--controllers"])).ended();
    assert_eq!(verified.with_code(0).digest(), whole.digest());
    site.assert_fork_is_same("20", &whole.digest());
}
