//! Agents that are missing, die, hang, or claim what is taken: one documented outcome each.

use crate::support::processes::{Ended, Process, signal};
use crate::support::recordings::{Recording, counter, refusals};
use crate::support::runs::{Run, Site, scenario};

/// A run of ten minutes of sim time.
const LONG: [&str; 10] =
    ["--agents", "3", "--size", "30", "--seed", "7", "--duration", "600", "--set", "stop_when_explored=false"];

/// Holds it back, so that it is in the middle when a test needs it to be; decisions may take long enough for agents that live.
const HELD_BACK: [&str; 6] = ["--rtf", "40", "--decision-timeout", "4", "--record", "run.mcap"];

const DROP: [&str; 2] = ["--set", "faults.on_agent_loss=drop"];

/// Starts the run and waits until it is under way.
fn held_back(site: &Site, flags: &[&str]) -> Run {
    let mut run = site.start(&mut site.run_sh(&[&LONG[..], &HELD_BACK, flags].concat()));
    run.is_under_way();
    run
}

/// The whole run, without faults.
fn undisturbed(site: &Site, flags: &[&str]) -> Recording {
    let whole = site.record(&[&LONG[..], flags, &["--transport", "memory"]].concat());
    Recording::from_bytes(&whole.bytes)
}

/// Fails unless a run was given up because of agent 1, and says so everywhere.
#[track_caller]
fn assert_given_up(site: &Site, ended: &Ended) {
    assert_eq!(ended.code, Some(4), "{ended}");
    assert_eq!(ended.stdout, "", "a run that was given up has no result to print\n{ended}");
    let recording = site.recording("run.mcap");
    let result = recording.result();
    let reason = format!("no answer within 4 s to tick {} from: 1", result.tick);
    assert_eq!(result.reason, reason);
    assert!(ended.stderr.lines().any(|line| line == format!("error: {reason}")), "{ended}");
    recording.assert_begins(&undisturbed(site, &[]), 1);
}

/// Fails unless a run went on to its end without agent 1, and says so everywhere.
#[track_caller]
fn assert_went_on(site: &Site, ended: &Ended) {
    assert_eq!(ended.code, Some(0), "{ended}");
    assert!(ended.stderr.contains(" from: 1; the run goes on without"), "{ended}");
    let recording = site.recording("run.mcap");
    let result = recording.result();
    assert_eq!((result.reason.as_str(), result.tick), ("duration", 30_000));
    assert_eq!(counter(&result, "agents_dropped"), 1, "{:?}", result.counters);
    let commands = |agent: u32| recording.of::<msgs::maes_msgs::Command>(&format!("/agent_{agent}/command"));
    let last_tick = |agent| commands(agent).last().map_or(0, |command| command.tick);
    assert!(last_tick(1) < last_tick(0).min(last_tick(2)), "the others went on");
}

#[test]
fn an_agent_that_is_missing_at_the_start_is_named() {
    let site = Site::new();
    let mut server = site.binary("sim_server");
    server.arg("run").arg(scenario("default.toml")).args(["--agents", "3", "--size", "30", "--record", "run.mcap"]);
    let mut run = site.start(server.args(["--join-timeout", "8"]));
    run.process().says("waiting for agents: 0, 1, 2");
    let agent = Process::start(site.binary("agent_node").args(["--id", "1"]));
    let ended = run.ended().with_code(3);
    let reason = "agents missing after 8 s: 0, 2";
    assert!(ended.stderr.lines().any(|line| line == format!("error: {reason}")), "{ended}");
    assert_eq!(ended.stdout, "");
    let result = site.recording("run.mcap").result();
    assert_eq!((result.reason.as_str(), result.tick), (reason, 0));
    // The one that was there is told that the run is over.
    agent.ended().with_code(0);
}

#[test]
fn an_agent_that_is_killed_ends_the_run() {
    let site = Site::new();
    let mut run = held_back(&site, &[]);
    signal(run.process().member(&["agent_node", "--id 1-1"]), "KILL");
    assert_given_up(&site, &run.ended());
}

#[test]
fn an_agent_that_hangs_ends_the_run() {
    let site = Site::new();
    let mut run = held_back(&site, &[]);
    signal(run.process().member(&["agent_node", "--id 1-1"]), "STOP");
    assert_given_up(&site, &run.ended());
}

#[test]
fn an_agent_that_is_killed_is_dropped_if_the_scenario_says_so() {
    let site = Site::new();
    let mut run = held_back(&site, &DROP);
    signal(run.process().member(&["agent_node", "--id 1-1"]), "KILL");
    assert_went_on(&site, &run.ended());
}

#[test]
fn an_agent_that_hangs_is_dropped_and_stays_so() {
    let site = Site::new();
    let mut run = held_back(&site, &DROP);
    let agent = run.process().member(&["agent_node", "--id 1-1"]);
    signal(agent, "STOP");
    run.process().says("the run goes on without");
    signal(agent, "CONT");
    assert_went_on(&site, &run.ended());
}

#[test]
fn a_process_that_dies_with_all_its_agents_ends_the_run() {
    let site = Site::new();
    let mut run = held_back(&site, &["--agents-per-process", "2"]);
    signal(run.process().member(&["agent_node", "--id 0-1"]), "KILL");
    let ended = run.ended().with_code(4);
    let reason = site.recording("run.mcap").result().reason;
    // They need not both be due in the same tick.
    assert!(reason.contains(" from: 0") || reason.contains(" from: 1"), "{ended}");
}

#[test]
fn an_id_belongs_to_the_first_process_that_claims_it() {
    let site = Site::new();
    let mut run = held_back(&site, &[]);

    let claim = Process::start(site.binary("agent_node").args(["--id", "1"])).ended().with_code(5);
    assert_eq!(claim.stderr, "error: agent 1 was refused by the server: agent 1 is taken by another process");
    let stranger = Process::start(site.binary("agent_node").args(["--id", "1-3"])).ended().with_code(5);
    assert!(stranger.stderr.starts_with("error: agent "), "{stranger}");
    let second = Process::start(&mut site.run_sh(&LONG)).ended().with_code(2);
    assert!(second.stderr.starts_with("error: a run is under way in ROS domain "), "{second}");

    signal(run.process().pid(), "INT");
    let ended = run.ended().with_code(130);
    assert!(ended.stderr.contains("refused: agent 1 is taken by another process"), "{ended}");
    let recording = site.recording("run.mcap");
    let result = recording.result();
    assert_eq!(refusals(&result).into_keys().collect::<Vec<_>>(), ["refused_id_taken"], "{:?}", result.counters);
    recording.assert_begins(&undisturbed(&site, &[]), 1);
}

#[test]
fn an_id_that_does_not_take_part_is_refused() {
    let site = Site::new();
    let mut run = held_back(&site, &[]);
    let mut stranger = Process::start(site.binary("agent_node").args(["--id", "3"]));
    stranger.handles("TERM");
    signal(stranger.pid(), "TERM");
    // Nobody listens to the topics of agent 3, so that it is not even refused; but it can be ended.
    stranger.ended().with_code(0);
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
}

#[test]
fn a_second_server_in_a_network_is_refused_and_disturbs_nobody() {
    let site = Site::new();
    let mut run = held_back(&site, &[]);
    site.file("second.mcap", "an older recording");
    let mut second = site.binary("sim_server");
    second.arg("run").arg(scenario("default.toml")).args(["--agents", "3", "--record", "second.mcap"]);
    let second = Process::start(&mut second).ended().with_code(1);
    assert!(second.stderr.contains("error: another server is in this network, with run "), "{second}");
    assert_eq!(second.stdout, "");
    assert_eq!(std::fs::read_to_string(site.path("second.mcap")).expect("it is there"), "an older recording");

    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let recording = site.recording("run.mcap");
    assert_eq!(refusals(&recording.result()).len(), 0, "{:?}", recording.result().counters);
    recording.assert_begins(&undisturbed(&site, &[]), 1);
}
