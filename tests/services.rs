//! Simulation control from a node of a real ROS 2 (rclpy on Fast DDS, from
//! `launch_scripts/ros_env.sh`): the services of
//! `simulation_interfaces`, parameters, and malformed requests. The node is `services.py`.

use std::net::Ipv4Addr;
use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Intervention, MapChange};
use ros2_client::{Context, NodeName, NodeOptions};
use rustdds::{DomainParticipantBuilder, QosPolicyBuilder, TopicKind, policy};

use crate::support::processes::{Ended, Process};
use crate::support::recordings::{Recording, counter};
use crate::support::runs::{Run, Site};
use crate::support::{python, root};

/// A run of two agents without look-ahead.
pub(crate) const FLAGS: [&str; 10] = [
    "--agents",
    "2",
    "--size",
    "20",
    "--look-ahead",
    "false",
    "--set",
    "stop_when_explored=false",
    "--decision-timeout",
    "30",
];

/// Starts a paused run of this duration.
fn begun(site: &Site, duration_s: &str, flags: &[&str]) -> Run {
    python::prepare_ros();
    let paused = ["--paused", "true", "--record", "run.mcap", "--duration", duration_s];
    site.start(&mut site.run_sh(&[&paused[..], &FLAGS, flags].concat()))
}

/// Runs a scene of `services.py` to its end.
pub(crate) fn play(site: &Site, scene: &[&str]) {
    let mut command = site.command("bash");
    command.args(python::in_ros()).arg("python3").arg(root().join("tests/services.py")).args(scene);
    let player = Process::start(&mut command).ended().with_code(0);
    assert!(player.stdout.contains("done"), "{player}");
}

/// The end of a run that started paused and was controlled by a scene.
fn controlled(site: &Site, duration_s: &str, flags: &[&str], scene: &[&str]) -> Ended {
    let run = begun(site, duration_s, flags);
    play(site, scene);
    run.ended()
}

/// The recording of the same run without control.
fn undisturbed(site: &Site, duration_s: &str) -> Recording {
    Recording::from_bytes(
        &site.record(&[&["--transport", "memory", "--duration", duration_s][..], &FLAGS].concat()).bytes,
    )
}

#[test]
fn run_is_paused_stepped_and_ended_by_services() {
    let site = Site::new();
    controlled(&site, "600", &[], &["states"]).with_code(130);
    let recording = site.recording("run.mcap");
    assert_eq!(recording.result().reason, "quit");
    recording.assert_begins(&undisturbed(&site, "600"), 1);
}

/// Some 20 kB, which the DDS library sends in fragments.
#[test]
fn states_of_a_hundred_agents_come_in_one_answer() {
    if !ros_node::has_dds_fixes() {
        eprintln!("NOT TESTED: this build has the published DDS library; launch_scripts/patched_rustdds.sh patches it");
        return;
    }
    let site = Site::new();
    python::prepare_ros();
    let team = ["--agents", "100", "--agents-per-process", "50", "--size", "40", "--duration", "600"];
    let run = site.start(site.run_sh(&team).args(["--paused", "true"]));
    play(&site, &["crowd", "100"]);
    run.ended().with_code(130);
}

#[test]
fn agents_are_entities() {
    let site = Site::new();
    controlled(&site, "600", &[], &["entities"]).with_code(130);
    let recording = site.recording("run.mcap");
    let interventions: Vec<Intervention> = recording.of("/sim/intervention");
    let done: Vec<_> = interventions.iter().map(|done| (done.tick, done.kind, done.agent)).collect();
    assert_eq!(done, [(1, Intervention::PLACE, 1), (1, Intervention::LEAVE, 1)]);
    let result = recording.result();
    assert_eq!((counter(&result, "interventions"), counter(&result, "agents_dropped"), result.tick), (2, 0, 11));
}

#[test]
fn agents_join_and_leave_live() {
    let run = || {
        let site = Site::new();
        let reserve = ["--set", "agents.count=3", "--set", "agents.reserve=[2]"];
        controlled(&site, "8", &reserve, &["joining"]).with_code(0);
        site
    };
    let (site, again) = (run(), run());
    let recording = site.recording("run.mcap");
    let bytes = |site: &Site, name: &str| std::fs::read(site.path(name)).expect("there is a recording");
    assert!(bytes(&site, "run.mcap") == bytes(&again, "run.mcap"), "the same requests make the same bytes");
    let interventions: Vec<Intervention> = recording.of("/sim/intervention");
    let done: Vec<_> = interventions.iter().map(|done| (done.tick, done.kind, done.agent)).collect();
    assert_eq!(done, [(10, Intervention::LEAVE, 1), (10, Intervention::JOIN, 2)]);
    let result = recording.result();
    assert_eq!((counter(&result, "interventions"), counter(&result, "agents_dropped"), result.tick), (2, 0, 400));
    let ticks = |agent: u32| -> Vec<u64> {
        recording.of::<Command>(&format!("/agent_{}/command", AgentId(agent))).iter().map(|one| one.tick).collect()
    };
    assert!(ticks(1).iter().all(|&tick| tick < 10), "agent 1 has left: {:?}", ticks(1));
    assert_eq!(ticks(2).first(), Some(&10), "agent 2 decides from the tick on in which it joins");
    assert!(result.distance_m[2] > 0.0, "agent 2 moves: {:?}", result.distance_m);

    let maes = |arguments: &[&str]| Process::start(site.binary("maes").args(arguments)).ended().with_code(0);
    let verified = maes(&["verify", "run.mcap", "--controllers"]);
    assert_eq!(verified.digest(), recording.result_digest());
    // Forks after the last intervention repeat them without a service.
    maes(&["run", "--transport", "memory", "--fork", "run.mcap", "--at", "3", "--record", "fork.mcap"]);
    assert!(bytes(&site, "run.mcap") == bytes(&site, "fork.mcap"), "the fork over memory differs");
    maes(&["run", "--fork", "run.mcap", "--at", "2", "--record", "ros.mcap"]);
    assert!(bytes(&site, "run.mcap") == bytes(&site, "ros.mcap"), "the fork over ROS 2 differs");
}

#[test]
fn map_is_changed_live() {
    let run = || {
        let site = Site::new();
        controlled(&site, "8", &["--controller", "dsvp"], &["changing"]).with_code(0);
        site
    };
    let (site, again) = (run(), run());
    let bytes = |site: &Site, name: &str| std::fs::read(site.path(name)).expect("there is a recording");
    assert!(bytes(&site, "run.mcap") == bytes(&again, "run.mcap"), "the same requests make the same bytes");
    let recording = site.recording("run.mcap");
    let changes: Vec<MapChange> = recording.of("/sim/map_change");
    let done: Vec<_> = changes.iter().map(|change| (change.tick, change.kind)).collect();
    assert_eq!(done, [(10, MapChange::FREE_ON_REQUEST), (20, MapChange::WALL_ON_REQUEST)]);
    assert_eq!((changes[0].low, changes[0].high), ([1; 3], [18; 3]), "the outermost layer stays wall");
    let result = recording.result();
    assert_eq!((counter(&result, "interventions"), counter(&result, "map_changes")), (2, 2));
    let free_cells = 18 * 18 * u64::from(changes[1].low[2] - 1);
    assert_eq!(counter(&result, "free_cells"), free_cells);

    let maes = |arguments: &[&str]| Process::start(site.binary("maes").args(arguments)).ended().with_code(0);
    assert_eq!(maes(&["verify", "run.mcap", "--controllers"]).digest(), recording.result_digest());
    maes(&["run", "--transport", "memory", "--fork", "run.mcap", "--at", "3", "--record", "fork.mcap"]);
    assert!(bytes(&site, "run.mcap") == bytes(&site, "fork.mcap"), "the fork differs");
}

#[test]
fn interventions_change_the_run_and_pauses_do_not() {
    let site = Site::new();
    let run = |distance: &str| {
        controlled(&site, "2", &[], &["intervention", distance]).with_code(0);
        std::fs::read(site.path("run.mcap")).expect("there is a recording")
    };
    let (paused, moved, again) = (run("0"), run("0.05"), run("0.05"));
    assert!(moved == again, "the same interventions at the same ticks make the same bytes");
    let whole = undisturbed(&site, "2");
    let paused = Recording::from_bytes(&paused);
    assert_eq!(paused, whole, "{}", paused.first_difference(&whole));
    let moved = Recording::from_bytes(&moved);
    assert_ne!(moved.result_digest(), whole.result_digest());
    assert_eq!(moved.of::<Intervention>("/sim/intervention").len(), 1);
}

#[test]
fn reset_run_is_the_same() {
    let site = Site::new();
    let whole = undisturbed(&site, "2");
    // The first agent of a process leaves, and another one.
    for (per_process, leaving) in [("1", "agent_1"), ("2", "agent_0")] {
        controlled(&site, "2", &["--agents-per-process", per_process], &["again", leaving]).with_code(0);
        let recording = site.recording("run.mcap");
        assert_eq!(recording, whole, "{per_process} in a process: {}", recording.first_difference(&whole));
    }
}

#[test]
fn parameters_are_read_and_set() {
    let site = Site::new();
    controlled(&site, "600", &[], &["parameters"]).with_code(130);
}

#[test]
fn malformed_requests_have_no_effect() {
    let site = Site::new();
    let mut run = begun(&site, "20", &[]);
    run.process().says("waiting for agents");
    noise(&site, &mut run);
    play(&site, &["nonsense"]);
    run.ended().with_code(0);
    let (recording, whole) = (site.recording("run.mcap"), undisturbed(&site, "20"));
    assert_eq!(recording, whole, "{}", recording.first_difference(&whole));
}

/// Publishes bytes that are no request on the topics of requests, until the server has logged one.
fn noise(site: &Site, run: &mut Run) {
    let participant = DomainParticipantBuilder::new(site.domain().id()).with_only_networks([Ipv4Addr::LOCALHOST]);
    let participant = participant.build().expect("the domain has room");
    let context = Context::from_domain_participant(participant.clone()).expect("the domain has room");
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    let mut node = context.new_node(NodeName::new("/", "rogue").expect("legal"), options).expect("there is room");
    let qos = QosPolicyBuilder::new()
        .reliability(policy::Reliability::Reliable { max_blocking_time: rustdds::Duration::ZERO })
        .history(policy::History::KeepLast { depth: 16 })
        .build();
    let topics = [
        "get_entities",
        "step_simulation",
        "set_parameters",
        "simulate_steps/_action/send_goal",
        "simulate_steps/_action/cancel_goal",
    ];
    let publishers = topics.map(|name| {
        let name = format!("rq/sim_server/{name}Request");
        let topic = participant.create_topic(name, "noise".to_owned(), &qos, TopicKind::NoKey).expect("a topic");
        node.create_publisher::<u8>(&topic, None).expect("a publisher")
    });
    for _ in 0..1000 {
        publishers.iter().for_each(|publisher| publisher.publish(7).expect("a rogue can publish"));
        if run.process().says_within("request ignored", Duration::from_millis(50)) {
            return;
        }
    }
    panic!("the server never logged the noise");
}
