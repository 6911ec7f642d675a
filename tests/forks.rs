//! Forks of recorded runs, and events of scenarios: the same bytes over memory and ROS 2.

use msgs::cdr;
use msgs::ids::AgentId;
use msgs::maes_msgs::{AgentMessage, Command, Observation};
use msgs::tf2_msgs::TFMessage;
use msgs::topics;

use crate::support::processes::{Ended, Process};
use crate::support::runs::{Site, scenario};

/// A run of three agents in a small cave.
const SMALL: [&str; 10] =
    ["--agents", "3", "--size", "25", "--seed", "5", "--duration", "40", "--set", "stop_when_explored=false"];

/// Something of every kind; agent 1 joins late, and agent 2 leaves.
const EVENTS: &str = "event=[{ kind = \"join\", at_s = 5.0, agent = 1 }, \
                      { kind = \"radio_off\", at_s = 8.0, agent = 0 }, { kind = \"leave\", at_s = 12.0, agent = 2 }, \
                      { kind = \"radio_on\", at_s = 16.0, agent = 0 }, \
                      { kind = \"wall\", at_s = 17.0, low = [8.0, 8.0, 8.0], high = [14.0, 14.0, 14.0] }, \
                      { kind = \"free\", at_s = 18.0, within_m = 3.0, low = [6.0, 6.0, 6.0], high = [12.0, 12.0, 18.0] }, \
                      { kind = \"set\", at_s = 20.0, set = { \"agents.controller\" = \"nearest-frontier\" } }, \
                      { kind = \"break_down\", at_s = 30.0, agent = 0 }]";

/// Runs `maes run` with these arguments, recorded in a file.
fn run(site: &Site, name: &str, flags: &[&str]) -> Ended {
    let mut single = site.binary("maes");
    single.arg("run").args(flags).args(["--record", name]);
    site.start(&mut single).ended()
}

fn maes(site: &Site, args: &[&str]) -> Ended {
    Process::start(site.binary("maes").args(args)).ended()
}

/// A parent over memory.
fn record(site: &Site, name: &str, flags: &[&str]) -> Ended {
    let file = scenario("default.toml");
    let file = file.to_str().expect("a path of this project");
    run(site, name, &[&["--transport", "memory", file][..], &SMALL, flags].concat()).with_code(0)
}

fn bytes(site: &Site, name: &str) -> Vec<u8> {
    std::fs::read(site.path(name)).expect("there is a recording")
}

#[track_caller]
fn assert_same_bytes(site: &Site, one: &str, other: &str) {
    assert!(bytes(site, one) == bytes(site, other), "{one} and {other} differ:\n{}", maes(site, &["diff", one, other]));
}

#[track_caller]
fn assert_verifies(site: &Site, name: &str) {
    let ended = maes(site, &["verify", name, "--controllers"]).with_code(0);
    assert_eq!(ended.digest(), site.recording(name).result_digest(), "{ended}");
}

#[test]
fn forks_without_a_change_are_the_same_bytes() {
    let site = Site::new();
    for (controller, events) in [("rbw", "event=[]"), ("dsvp-auction", "event=[]"), ("lvd", EVENTS)] {
        record(&site, "parent.mcap", &["--controller", controller, "--set", events]);
        for at in ["0", "0.02", "12", "19.98", "40"] {
            run(&site, "fork.mcap", &["--transport", "memory", "--fork", "parent.mcap", "--at", at]).with_code(0);
            assert_same_bytes(&site, "parent.mcap", "fork.mcap");
        }
        run(
            &site,
            "named.mcap",
            &["--transport", "memory", "--fork", "parent.mcap", "--at", "9", "--controller", controller],
        )
        .with_code(0);
        assert_same_bytes(&site, "parent.mcap", "named.mcap");
    }
    run(&site, "ros.mcap", &["--fork", "parent.mcap", "--at", "15"]).with_code(0);
    assert_same_bytes(&site, "parent.mcap", "ros.mcap");
}

#[test]
fn forks_share_the_past_and_verify() {
    let site = Site::new();
    record(&site, "parent.mcap", &[]);
    let change: &[&str] = &[
        "--fork",
        "parent.mcap",
        "--at",
        "20",
        "--controller",
        "lvd",
        "--set",
        "communication.loss=0.5",
        "--set",
        "event=[{ kind = \"break_down\", at_s = 30.0, agent = 1 }]",
        "--duration",
        "45",
    ];
    run(&site, "fork.mcap", &[&["--transport", "memory"][..], change].concat()).with_code(0);
    run(&site, "ros.mcap", change).with_code(0);
    assert_same_bytes(&site, "fork.mcap", "ros.mcap");
    assert_verifies(&site, "fork.mcap");

    let (parent, fork) = (site.recording("parent.mcap"), site.recording("fork.mcap"));
    let shared = parent.messages.iter().take_while(|message| message.tick < 1000).count();
    assert!(parent.messages[..shared] == fork.messages[..shared], "the fork has another past");
    assert_eq!(fork.result().tick, 45 * 50, "the duration has changed");
    let diff = maes(&site, &["diff", "parent.mcap", "fork.mcap"]).with_code(1);
    assert!(diff.stdout.contains("first difference: tick 1000, agent 0, /agent_0/observation"), "{diff}");
    let info = maes(&site, &["info", "fork.mcap"]).with_code(0);
    let origin = parent.result_digest();
    for words in ["\nforked at 20.0 s from the run with digest ", &origin, "\"agents.controller\" = \"lvd\""] {
        assert!(info.stdout.contains(words), "{words}\n{info}");
    }
    // Of the agent that has broken down there is no command any more, but a body.
    let of_broken = |message: &&crate::support::recordings::Message| message.topic == topics::command(AgentId(1)).name;
    let last = fork.messages.iter().rfind(of_broken).expect("it has decided before");
    assert!(last.tick < 1500, "{}", last.tick);
    assert!(frames(&fork, 2000).contains(&"agent_1/base_link".to_owned()));

    // A fork of a fork.
    run(&site, "second.mcap", &["--transport", "memory", "--fork", "fork.mcap", "--at", "40", "--controller", "rbw"])
        .with_code(0);
    assert_verifies(&site, "second.mcap");
}

/// The frames on /tf in a tick.
fn frames(recording: &crate::support::recordings::Recording, tick: u64) -> Vec<String> {
    let mut poses = recording.messages.iter().filter(|message| message.topic == topics::tf().name);
    let message = poses.find(|message| message.tick == tick).expect("poses are recorded");
    let transforms: TFMessage = cdr::decode(&message.data).expect("it is one");
    transforms.transforms.into_iter().map(|transform| transform.child_frame_id).collect()
}

#[test]
fn events_happen_when_they_are_to() {
    let site = Site::new();
    record(&site, "memory.mcap", &["--set", EVENTS]);
    record(&site, "asked.mcap", &["--set", EVENTS, "--look-ahead", "false"]);
    assert_same_bytes(&site, "memory.mcap", "asked.mcap");
    let file = scenario("default.toml");
    let file = file.to_str().expect("a path of this project");
    run(&site, "ros.mcap", &[&[file][..], &SMALL, &["--set", EVENTS]].concat()).with_code(0);
    assert_same_bytes(&site, "memory.mcap", "ros.mcap");
    assert_verifies(&site, "memory.mcap");

    let recording = site.recording("memory.mcap");
    let of = |agent: u32, topic: fn(AgentId) -> topics::Topic| {
        let name = topic(AgentId(agent)).name;
        recording.messages.iter().filter(move |message| message.topic == name).collect::<Vec<_>>()
    };
    let commands = |agent| of(agent, topics::command).into_iter().map(|message| message.tick).collect::<Vec<_>>();
    assert_eq!((commands(0)[0], commands(1)[0], commands(2)[0]), (0, 250, 0), "agent 1 joins at 5 s");
    assert!(commands(2).last() < Some(&600) && commands(0).last() < Some(&1500));
    let names = |ids: &[u32]| ids.iter().map(|id| format!("agent_{id}/base_link")).collect::<Vec<_>>();
    for (tick, ids) in
        [(0, &[0, 2][..]), (240, &[0, 2]), (250, &[0, 2]), (260, &[0, 1, 2]), (610, &[0, 1]), (1600, &[0, 1])]
    {
        assert_eq!(frames(&recording, tick), names(ids), "{tick}");
    }
    let observations: Vec<Observation> =
        of(1, topics::observation).into_iter().map(|message| cdr::decode(&message.data).expect("it is one")).collect();
    let contact = |from: u64, to: u64| {
        let within = observations.iter().filter(move |seen| (from..to).contains(&seen.tick));
        within.flat_map(|seen| &seen.contacts).any(|contact| contact.agent == 0)
    };
    assert!(contact(250, 400), "they start beside each other");
    assert!(!contact(400, 800) && !contact(1500, 2001), "the radio of agent 0 is off, and then it has broken down");
    let changes: Vec<u64> = observations
        .iter()
        .filter(|seen| seen.messages.iter().any(|message| message.agent == AgentMessage::SERVER))
        .map(|seen| seen.tick)
        .collect();
    assert_eq!(changes, [1000], "the controller takes over at 20 s");
    let mut stopped =
        of(0, topics::command).into_iter().map(|message| cdr::decode::<Command>(&message.data).expect("it is one"));
    assert!(stopped.any(|command| command.tick == 1000), "every agent decides at once");
}

#[test]
fn forks_that_cannot_be_are_refused() {
    let site = Site::new();
    record(&site, "parent.mcap", &["--set", "duration_s=10.0"]);
    let refused = |flags: &[&str]| {
        let ended = run(&site, "fork.mcap", &[&["--transport", "memory", "--fork", "parent.mcap"][..], flags].concat());
        assert_eq!(ended.code, Some(2), "{ended}");
        assert!(!site.path("fork.mcap").exists(), "{ended}");
        ended.stderr
    };
    for (flags, expected) in [
        (&["--at", "20"][..], "parent.mcap: --at 20: expected a time of the recorded run, which has ended at 10 s"),
        (&["--at", "5.01"], "expected a multiple of 0.02 s"),
        (&["--at", "5", "--seed", "3"], "--seed 3: seed cannot change during a run: the map and every random number"),
        (&["--at", "5", "--size", "30"], "--size 30: map.size cannot change during a run"),
        (&["--at", "5", "--map", "noise"], "--map noise: map.kind cannot change during a run"),
        (&["--at", "5", "--set", "lidar.range_m=5"], "--set lidar.range_m=5: lidar.range_m cannot change"),
        (&["--at", "5", "--controller", "ldv"], "controller ldv: unknown"),
        (&["--at", "5", "--set", "communication.los=1"], "did you mean `communication.loss`?"),
        (&["--at", "5", "--set", "event=[{ kind = \"leave\", at_s = 1.0, agent = 0 }]"], "no event before the fork"),
        (&[], "--at"),
    ] {
        let error = refused(flags);
        assert!(error.contains(expected), "{flags:?}: {error}");
    }
    let over = run(&site, "parent.mcap", &["--transport", "memory", "--fork", "parent.mcap", "--at", "5"]);
    assert!(over.code == Some(2) && over.stderr.contains("another file than the recording that is forked"), "{over}");
}
