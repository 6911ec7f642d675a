//! What the programs say beside their results: text or JSON, and what `RUST_LOG` adds.

use serde_json::Value;

use crate::support::processes::Process;
use crate::support::runs::Site;

const SHORT: [&str; 6] = ["--agents", "2", "--size", "20", "--duration", "5"];

#[test]
fn errors_alone_are_none_of_a_run_over_ros() {
    let site = Site::new();
    let mut over_ros = site.binary("maes");
    over_ros.arg("run").args(SHORT).env("RUST_LOG", "error");
    assert_eq!(Process::start(&mut over_ros).ended().with_code(0).stderr, "");
}

#[test]
fn events_of_all_processes_are_json_and_change_nothing() {
    let site = Site::new();
    let mut over_memory = site.binary("maes");
    over_memory.args(["run", "--transport", "memory"]).args(SHORT).env("RUST_LOG", "error");
    let over_memory = Process::start(&mut over_memory).ended().with_code(0);
    assert_eq!(over_memory.stderr, "", "no error, and nothing else is asked for");

    let mut over_ros = site.binary("maes");
    over_ros.args(["--log-format", "json", "run"]).args(SHORT).env("RUST_LOG", "ros2_client=debug");
    let over_ros = Process::start(&mut over_ros).ended().with_code(0);
    assert_eq!(over_ros.digest(), over_memory.digest());
    let events: Vec<Value> = over_ros.stderr.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    let has = |target: &str, level: &str, text: &str| {
        events.iter().any(|event| {
            let is_there = |key: &str, value: &str| event[key].as_str().is_some_and(|there| there.starts_with(value));
            is_there("target", target) && event["level"] == level && is_there("message", text)
        })
    };
    // The server is a process of its own.
    assert!(has("sim_server::terminal", "INFO", "all 2 agents are there"), "{events:#?}");
    assert!(has("ros2_client::", "DEBUG", ""), "{events:#?}");
}
