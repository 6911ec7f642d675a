//! Localisation that drifts: the same bytes over ROS 2 and in memory, verified, forked and resumed.

use crate::support::processes::{Process, signal};
use crate::support::recordings::counter;
use crate::support::runs::{Site, scenario, text};
use crate::support::{python, root};

#[test]
fn drift_is_the_same_over_ros_verified_forked_and_resumed() {
    let site = Site::new();
    let scenario = scenario("drift.toml");
    let whole = site.record(&[text(&scenario), "--transport", "memory"]);

    let paced = ["--rtf", "60", "--decision-timeout", "2", "--record", "run.mcap"];
    let mut run = site.start(&mut site.run_sh(&[&[text(&scenario)][..], &paced].concat()));
    run.is_under_way(&site.path("run.mcap"));
    signal(run.process().member(&["sim_server", "run"]), "KILL");
    run.ended().with_code(137);
    let resumed = site.start(&mut site.run_sh(&["--resume", "run.mcap"])).ended().with_code(0);
    assert_eq!(resumed.digest(), whole.digest());
    assert!(std::fs::read(site.path("run.mcap")).expect("it is complete") == whole.bytes, "run.mcap");
    let result = site.recording("run.mcap").result();
    assert!(counter(&result, "map_blocks") > 0 && counter(&result, "position_error_micrometres") > 0, "{result:?}");

    let verified = Process::start(site.binary("maes").args(["verify", "run.mcap", "--controllers"])).ended();
    assert_eq!(verified.with_code(0).digest(), whole.digest());
    site.assert_fork_is_same("100", &whole.digest());
}

/// The absolute trajectory error that evo computes of a recording is that of the result.
#[test]
#[ignore = "installs evo, with 26 packages"]
fn evo_computes_the_position_error_of_the_result() {
    let site = Site::new();
    let scenario = scenario("drift.toml");
    let arguments = ["run", text(&scenario), "--agents", "1", "--transport", "memory", "--record", "run.mcap"];
    Process::start(site.binary("maes").args(arguments)).ended().with_code(0);
    let micrometres = counter(&site.recording("run.mcap").result(), "position_error_micrometres");

    let interpreter = python::for_trajectories();
    let script = root().join("examples/python/trajectories.py");
    Process::start(site.command(interpreter).arg(script).arg("run.mcap")).ended().with_code(0);
    let mut evo = site.command(interpreter.with_file_name("evo_ape"));
    let said = Process::start(evo.args(["tum", "agent_0_true.tum", "agent_0_map.tum"])).ended().with_code(0);
    let rmse = said.stdout.lines().find_map(|line| line.trim().strip_prefix("rmse")).expect("evo says the rmse");
    let rmse_m: f64 = rmse.trim().parse().expect("a number");
    assert!(micrometres > 0 && (rmse_m - micrometres as f64 / 1e6).abs() < 2e-6, "{rmse_m} m, {micrometres} um");
}
