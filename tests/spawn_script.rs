//! `launch_scripts/spawn.sh`: a server and agents, started by hand.

use crate::support::processes::signal;
use crate::support::root;
use crate::support::runs::{Site, text};

const FLAGS: [&str; 6] = ["--size", "20", "--duration", "20", "--set", "stop_when_explored=false"];

#[test]
fn the_script_makes_the_run_of_maes() {
    let site = Site::new();
    let mut script = site.command(root().join("launch_scripts/spawn.sh"));
    let spawned = site.record_with(script.arg("2").args(FLAGS));
    let over_memory = [&FLAGS[..], &["--agents", "2", "--transport", "memory"]].concat();
    spawned.assert_same(&site.record(&over_memory), "spawned by hand");
}

#[test]
fn a_signal_to_the_server_ends_the_script_with_its_exit_code() {
    let site = Site::new();
    let mut script = site.command(root().join("launch_scripts/spawn.sh"));
    let recording = site.path("run.mcap");
    let mut run = site.start(script.arg("2").args(FLAGS).args(["--rtf", "1", "--record", text(&recording)]));
    run.is_under_way(&recording);
    signal(run.process().member(&["sim_server", "run"]), "INT");
    run.ended().with_code(130);
}

#[test]
fn bad_input_ends_the_script_and_leaves_no_agents() {
    let site = Site::new();
    let mut script = site.command(root().join("launch_scripts/spawn.sh"));
    let ended = site.start(script.args(["2", "--set", "duration_s=-1.0"])).ended().with_code(2);
    assert!(ended.stderr.contains("duration_s = -1"), "{ended}");
}
