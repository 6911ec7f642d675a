//! Third-party agents on a real ROS 2 (rclpy on Fast DDS): one with the protocol of this project,
//! and one with standard messages only. Both are the examples of docs/own-node.md.

use crate::support::processes::Process;
use crate::support::recordings::Recording;
use crate::support::runs::{Outcome, Site};
use crate::support::{python, root};

fn example(site: &Site, script: &str, agent: &str) -> Process {
    python::prepare_ros();
    let mut command = site.command("bash");
    let script = root().join("examples/python").join(script);
    command.args(python::in_ros()).arg("python3").arg(script).arg(agent).env("PYTHONDONTWRITEBYTECODE", "1");
    Process::start(&mut command)
}

/// The example in C++, compiled against the parts of rclcpp that it uses.
fn cpp_example(site: &Site, agent: &str) -> Process {
    python::prepare_ros();
    let mut command = site.command("bash");
    command.args(python::in_ros()).arg("python3").arg(root().join("tests/cpp_agent.py"));
    command.arg(site.path("")).arg(agent).env("PYTHONDONTWRITEBYTECODE", "1");
    Process::start(&mut command)
}

/// Agent 0 uses the protocol, agent 1 standard messages; agent 2 is an `agent_node`.
fn mixed_team(order: &str) -> Outcome {
    let site = Site::new();
    let speaker = example(&site, "agent.py", "0");
    let _driver = example(&site, "cmd_vel_agent.py", "1");
    let team = ["--agents", "3", "--external", "0", "--set", "agents.cmd_vel=[1]", "--order", order];
    let cave = ["--size", "30", "--duration", "30", "--set", "stop_when_explored=false"];
    let outcome = site.record(&[&team[..], &cave, &["--decision-timeout", "60", "--join-timeout", "300"]].concat());
    speaker.ended().with_code(0);
    outcome
}

#[test]
fn mixed_team_is_deterministic() {
    let [first, again] = ["forward", "reverse"].map(mixed_team);
    assert_eq!(first.digest(), again.digest());
    let result = Recording::from_bytes(&first.bytes).result();
    assert!(result.explored_by.iter().all(|&share| share > 0.2), "{:?}", result.explored_by);
    assert!(result.distance_m.iter().all(|&distance_m| distance_m > 5.0), "{:?}", result.distance_m);
}

/// As in docs/own-node.md, on the default map, where the agents start near a floor.
#[test]
fn examples_move_on_the_default_map() {
    assert_examples_move(["1", "2"]);
}

#[test]
#[ignore = "takes minutes"]
fn examples_move_on_more_maps() {
    assert_examples_move(["3", "4"]);
}

#[track_caller]
fn assert_examples_move(seeds: [&str; 2]) {
    let ways = [("cmd_vel_agent.py", ["--set", "agents.cmd_vel=[0]"], "30"), ("agent.py", ["--external", "0"], "90")];
    for seed in seeds {
        for (script, flags, duration) in ways {
            let site = Site::new();
            let _node = example(&site, script, "0");
            let run = ["--agents", "2", "--seed", seed, "--duration", duration, "--set", "stop_when_explored=false"];
            let patient = ["--decision-timeout", "60", "--join-timeout", "300"];
            let outcome = site.record(&[&run[..], &flags, &patient].concat());
            let result = Recording::from_bytes(&outcome.bytes).result();
            assert!(result.distance_m[0] > 5.0, "{script}, seed {seed}: {:?}", result.distance_m);
            assert!(result.explored_by[0] > 0.1, "{script}, seed {seed}: {:?}", result.explored_by);
        }
    }
}

#[test]
#[ignore = "builds a C++ node, which takes minutes"]
fn cpp_example_moves() {
    let site = Site::new();
    let agent = cpp_example(&site, "0");
    let run = ["--agents", "2", "--external", "0", "--duration", "90", "--set", "stop_when_explored=false"];
    let outcome = site.record(&[&run[..], &["--decision-timeout", "60", "--join-timeout", "300"]].concat());
    agent.ended().with_code(0);
    let result = Recording::from_bytes(&outcome.bytes).result();
    assert!(result.distance_m[0] > 5.0, "{:?}", result.distance_m);
    assert!(result.explored_by[0] > 0.1, "{:?}", result.explored_by);
}

#[test]
fn cmd_vel_example_replies_in_any_order_of_topics() {
    python::prepare_ros();
    let site = Site::new();
    let mut command = site.command("bash");
    command.args(python::in_ros()).arg("python3").arg(root().join("tests/cmd_vel_orders.py"));
    command.arg(root().join("examples/python")).env("PYTHONDONTWRITEBYTECODE", "1");
    Process::start(&mut command).ended().with_code(0);
}

#[test]
fn cmd_vel_agents_require_ros() {
    let site = Site::new();
    let mut over_memory = site.run_sh(&["--agents", "2", "--transport", "memory", "--set", "agents.cmd_vel=[1]"]);
    let ended = site.start(&mut over_memory).ended().with_code(2);
    assert!(ended.stderr.contains("agents.cmd_vel"), "{}", ended.stderr);
}
