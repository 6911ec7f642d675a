//! Runs with batteries: the same bytes over ROS 2 and in memory, forked, and with a killed server.

use crate::support::processes::signal;
use crate::support::recordings::counter;
use crate::support::runs::{Site, scenario, text};

#[test]
fn endurance_is_the_same_forked_and_resumed() {
    let site = Site::new();
    let scenario = scenario("endurance.toml");
    let whole = site.record(&[text(&scenario), "--transport", "memory"]);

    let paced = ["--rtf", "60", "--decision-timeout", "2", "--record", "run.mcap"];
    let mut run = site.start(&mut site.run_sh(&[&[text(&scenario)][..], &paced].concat()));
    run.is_under_way(&site.path("run.mcap"));
    signal(run.process().member(&["sim_server", "run"]), "KILL");
    run.ended().with_code(137);
    let resumed = site.start(&mut site.run_sh(&["--resume", "run.mcap"])).ended().with_code(0);
    assert_eq!(resumed.digest(), whole.digest());
    let recording = site.recording("run.mcap");
    assert!(std::fs::read(site.path("run.mcap")).expect("it is complete") == whole.bytes, "run.mcap");
    assert!(counter(&recording.result(), "energy_used_millijoules") > 0, "{:?}", recording.result());
    site.assert_fork_is_same("200", &whole.digest());
}
