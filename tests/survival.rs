//! Runs that survive: agents and servers that die, hang or come twice, and the run is the same as if nothing had happened.

use crate::support::processes::{Process, signal};
use crate::support::recordings::{Recording, refusals};
use crate::support::runs::{Run, Site, text};

/// A run of ten minutes of sim time in which agents meet and share their maps, and lost ones are waited for.
const FLAGS: [&str; 14] = [
    "--agents",
    "3",
    "--size",
    "30",
    "--seed",
    "7",
    "--controller",
    "dsvp",
    "--duration",
    "600",
    "--set",
    "stop_when_explored=false",
    "--set",
    "faults.on_agent_loss=wait",
];

/// Holds it back, so that it is in the middle when a test needs it to be.
const HELD_BACK: [&str; 6] = ["--rtf", "60", "--decision-timeout", "2", "--record", "run.mcap"];

const HELD: &str = "the clock is held until they are started again";

fn held_back(site: &Site) -> Run {
    let mut run = site.start(&mut site.run_sh(&[&FLAGS[..], &HELD_BACK].concat()));
    run.is_under_way();
    run
}

/// The bytes of the run without faults.
fn undisturbed(site: &Site) -> Vec<u8> {
    site.record(&[&FLAGS[..], &["--transport", "memory"]].concat()).bytes
}

/// Fails unless the run has come to the end of the undisturbed one, with the same recording.
#[track_caller]
fn assert_undisturbed(site: &Site, run: Run) {
    run.ended().with_code(0);
    assert_same(site, &undisturbed(site));
}

#[track_caller]
fn assert_same(site: &Site, whole: &[u8]) {
    let bytes = std::fs::read(site.path("run.mcap")).expect("there is a recording");
    if bytes != whole {
        panic!("{}", Recording::from_bytes(&bytes).first_difference(&Recording::from_bytes(whole)));
    }
}

/// Goes on with the run.
fn resumed(site: &Site, flags: &[&str]) -> Run {
    let file = site.path("run.mcap");
    site.start(&mut site.run_sh(&[&["--resume", text(&file)][..], flags].concat()))
}

#[test]
fn an_agent_that_is_killed_is_started_again_and_nothing_has_happened() {
    let site = Site::new();
    let mut run = held_back(&site);
    signal(run.process().member(&["agent_node", "--id 1-1"]), "KILL");
    run.process().says("agent 1 was started again and is told what it has observed so far");
    assert_undisturbed(&site, run);
}

#[test]
fn an_agent_that_hangs_for_a_while_is_waited_for() {
    let site = Site::new();
    let mut run = held_back(&site);
    let agent = run.process().member(&["agent_node", "--id 1-1"]);
    signal(agent, "STOP");
    run.process().says(HELD);
    signal(agent, "CONT");
    assert_undisturbed(&site, run);
}

#[test]
fn an_agent_that_hangs_can_be_replaced() {
    let site = Site::new();
    let mut run = held_back(&site);
    let agent = run.process().member(&["agent_node", "--id 1-1"]);
    signal(agent, "STOP");
    run.process().says(HELD);
    let successor = Process::start(site.binary("agent_node").args(["--id", "1"]));
    run.process().says("agent 1 was started again");
    signal(agent, "CONT");
    run.ended().with_code(0);
    successor.ended().with_code(0);
    // The one that was replaced may have said something that nobody wanted to hear any more, which is counted.
    let (recording, whole) = (site.recording("run.mcap"), Recording::from_bytes(&undisturbed(&site)));
    recording.assert_begins(&whole, 1);
    assert_eq!(recording.result_digest(), whole.result_digest());
}

#[test]
fn an_agent_that_comes_twice_is_refused_once_the_first_one_has_shown_that_it_is_there() {
    let site = Site::new();
    let mut run = held_back(&site);
    let second = Process::start(site.binary("agent_node").args(["--id", "1"])).ended().with_code(5);
    assert_eq!(second.stderr, "error: agent 1 was refused by the server: agent 1 is taken by another process");
    run.process().says("refused: agent 1 is taken by another process");
    run.ended().with_code(0);
    let (recording, whole) = (site.recording("run.mcap"), Recording::from_bytes(&undisturbed(&site)));
    recording.assert_begins(&whole, 1);
    assert_eq!(refusals(&recording.result()).into_keys().collect::<Vec<_>>(), ["refused_id_taken"]);
}

#[test]
fn a_successor_has_to_run_the_same() {
    let site = Site::new();
    let mut run = held_back(&site);
    let agent = run.process().member(&["agent_node", "--id 1-1"]);
    signal(agent, "STOP");
    run.process().says(HELD);
    let other =
        Process::start(site.binary("agent_node").args(["--id", "1", "--controller", "rbw"])).ended().with_code(5);
    assert!(other.stderr.contains("agent 1 is to be run again by \"dsvp\", and not by \"rbw\""), "{other}");
    signal(agent, "CONT");
    run.ended().with_code(0);
}

#[test]
fn a_run_whose_server_is_killed_goes_on_even_twice() {
    let site = Site::new();
    let whole = undisturbed(&site);
    let mut run = held_back(&site);
    signal(run.process().member(&["sim_server", "run"]), "KILL");
    run.ended().with_code(137);

    let mut run = resumed(&site, &["--rtf", "60"]);
    run.process().says("; the run goes on from there");
    run.is_under_way();
    signal(run.process().member(&["sim_server", "run"]), "KILL");
    run.ended().with_code(137);
    site.recording("run.mcap").assert_begins(&Recording::from_bytes(&whole), 0);

    let ended = resumed(&site, &[]).ended().with_code(0);
    assert_eq!(ended.digest(), Recording::from_bytes(&whole).result_digest());
    assert_same(&site, &whole);
}

#[test]
fn a_run_goes_on_as_it_was_or_not_at_all() {
    let site = Site::new();
    let whole = undisturbed(&site);
    let file = site.file("run.mcap", &whole);
    let refused = |arguments: &[&str], says: &str| {
        let before = std::fs::read(&file).expect("it is there");
        let ended = Process::start(site.binary("sim_server").arg("run").args(arguments)).ended().with_code(2);
        assert!(ended.stderr.starts_with("error: ") && ended.stderr.contains(says), "{ended}");
        assert_eq!(std::fs::read(&file).expect("it is there"), before, "{arguments:?}");
    };
    refused(&["--resume", "run.mcap"], "run.mcap: its run has ended in tick 30000; there is nothing to go on with");
    refused(&["--resume", "nowhere.mcap"], "nowhere.mcap: No such file");
    std::fs::write(&file, &whole[..whole.len() / 2]).expect("it can be cut");
    let stays = "only [execution] and [views] may be set: ";
    refused(&["--resume", "run.mcap", "--seed", "8"], &format!("{stays}seed = 7 would be seed = 8"));
    refused(&["--resume", "run.mcap", "--duration", "700"], &format!("{stays}duration_s = 600.0 would be"));
}

#[test]
fn a_run_goes_on_with_the_controllers_that_it_had() {
    let site = Site::new();
    let whole = undisturbed(&site);
    let file = site.file("run.mcap", &whole[..whole.len() / 2]);
    let mut server = site.binary("sim_server");
    let mut run = site.start(server.args(["run", "--resume", text(&file)]));
    run.process().says("waiting for agents: 0, 1, 2");
    let agents = Process::start(site.binary("agent_node").args(["--id", "0-2", "--controller", "rbw"]));
    let ended = run.ended().with_code(2);
    assert!(ended.stderr.contains("agent 0 runs rbw, and dsvp in the run that is to go on"), "{ended}");
    agents.ended().with_code(0);
    assert_eq!(std::fs::read(&file).expect("it is there"), whole[..whole.len() / 2], "it is left as it was");
}
