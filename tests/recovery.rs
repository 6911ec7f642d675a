//! Recovery: with killed, hanging and duplicate agents and with killed servers, the run is the
//! undisturbed one.

use crate::support::processes::{Process, signal};
use crate::support::recordings::{Recording, refusals};
use crate::support::runs::{Run, Site, text};

/// A run of ten minutes of sim time in which agents share their maps, and lost agents are awaited.
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

/// Paces a run that a test lets end by itself.
pub(crate) const PACED: [&str; 6] = ["--rtf", "60", "--decision-timeout", "2", "--record", "run.mcap"];

/// Paces a run that a test interrupts.
const SLOW: [&str; 6] = ["--rtf", "10", "--decision-timeout", "2", "--record", "run.mcap"];

const HELD: &str = "the clock is held until they are started again";

pub(crate) fn started(site: &Site, pace: &[&str]) -> Run {
    let mut run = site.start(&mut site.run_sh(&[&FLAGS[..], pace].concat()));
    run.is_under_way(&site.path("run.mcap"));
    run
}

/// The recording of the run without faults.
fn undisturbed(site: &Site) -> Vec<u8> {
    site.record(&[&FLAGS[..], &["--transport", "memory"]].concat()).bytes
}

/// Fails unless the run ends with the recording of the undisturbed one.
#[track_caller]
pub(crate) fn assert_undisturbed(site: &Site, run: Run) {
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

/// Resumes the run.
fn resumed(site: &Site, flags: &[&str]) -> Run {
    let file = site.path("run.mcap");
    site.start(&mut site.run_sh(&[&["--resume", text(&file)][..], flags].concat()))
}

#[test]
fn killed_agent_is_restarted() {
    let site = Site::new();
    let mut run = started(&site, &PACED);
    signal(run.process().member(&["agent_node", "--id 1-1"]), "KILL");
    run.process().says("agent 1 was started again; its observation log is replayed to it");
    assert_undisturbed(&site, run);
}

#[test]
fn hanging_agent_is_awaited() {
    let site = Site::new();
    let mut run = started(&site, &PACED);
    let agent = run.process().member(&["agent_node", "--id 1-1"]);
    signal(agent, "STOP");
    run.process().says(HELD);
    signal(agent, "CONT");
    assert_undisturbed(&site, run);
}

#[test]
fn hanging_agent_can_be_replaced() {
    let site = Site::new();
    let mut run = started(&site, &PACED);
    let agent = run.process().member(&["agent_node", "--id 1-1"]);
    signal(agent, "STOP");
    run.process().says(HELD);
    let replacement = Process::start(site.binary("agent_node").args(["--id", "1"]));
    run.process().says("agent 1 was started again");
    signal(agent, "CONT");
    run.ended().with_code(0);
    replacement.ended().with_code(0);
    // A late message of the replaced process may have been refused and counted, so the counters may
    // differ.
    let (recording, whole) = (site.recording("run.mcap"), Recording::from_bytes(&undisturbed(&site)));
    recording.assert_begins(&whole, 1);
    assert_eq!(recording.result_digest(), whole.result_digest());
}

#[test]
fn duplicate_of_a_live_agent_is_refused() {
    let site = Site::new();
    let mut run = started(&site, &SLOW);
    let second = Process::start(site.binary("agent_node").args(["--id", "1"])).ended().with_code(5);
    assert_eq!(second.stderr, "error: agent 1 was refused by the server: agent 1 is taken by another process");
    run.process().says("refused: agent 1 is taken by another process");
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let (recording, whole) = (site.recording("run.mcap"), Recording::from_bytes(&undisturbed(&site)));
    recording.assert_begins(&whole, 1);
    assert_eq!(refusals(&recording.result()).into_keys().collect::<Vec<_>>(), ["refused_id_taken"]);
}

#[test]
fn replacement_must_run_the_same_controller() {
    let site = Site::new();
    let mut run = started(&site, &PACED);
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
fn killed_server_is_resumed_twice() {
    let site = Site::new();
    let whole = undisturbed(&site);
    let mut run = started(&site, &SLOW);
    signal(run.process().member(&["sim_server", "run"]), "KILL");
    run.ended().with_code(137);

    let mut run = resumed(&site, &["--rtf", "60"]);
    run.process().says("; the run continues from there");
    run.process().says("x real time");
    signal(run.process().member(&["sim_server", "run"]), "KILL");
    run.ended().with_code(137);
    site.recording("run.mcap").assert_begins(&Recording::from_bytes(&whole), 0);

    let ended = resumed(&site, &[]).ended().with_code(0);
    assert_eq!(ended.digest(), Recording::from_bytes(&whole).result_digest());
    assert_same(&site, &whole);
}

#[test]
fn resume_refuses_changed_scenarios() {
    let site = Site::new();
    let whole = undisturbed(&site);
    let file = site.file("run.mcap", &whole);
    let refused = |arguments: &[&str], says: &str| {
        let before = std::fs::read(&file).expect("it is there");
        let ended = Process::start(site.binary("sim_server").arg("run").args(arguments)).ended().with_code(2);
        assert!(ended.stderr.starts_with("error: ") && ended.stderr.contains(says), "{ended}");
        assert_eq!(std::fs::read(&file).expect("it is there"), before, "{arguments:?}");
    };
    refused(&["--resume", "run.mcap"], "run.mcap: its run has ended in tick 30000: nothing to resume");
    refused(&["--resume", "nowhere.mcap"], "nowhere.mcap: No such file");
    std::fs::write(&file, &whole[..whole.len() / 2]).expect("it can be cut");
    let stays = "only [execution] and [views] may be set: ";
    refused(&["--resume", "run.mcap", "--seed", "8"], &format!("{stays}seed = 7 would be seed = 8"));
    refused(&["--resume", "run.mcap", "--duration", "700"], &format!("{stays}duration_s = 600.0 would be"));
}

#[test]
fn resume_refuses_changed_controllers() {
    let site = Site::new();
    let whole = undisturbed(&site);
    let file = site.file("run.mcap", &whole[..whole.len() / 2]);
    let mut server = site.binary("sim_server");
    let mut run = site.start(server.args(["run", "--resume", text(&file)]));
    run.process().says("waiting for agents: 0, 1, 2");
    let agents = Process::start(site.binary("agent_node").args(["--id", "0-2", "--controller", "rbw"]));
    let ended = run.ended().with_code(2);
    assert!(ended.stderr.contains("agent 0 runs rbw, and dsvp in the recording that is resumed"), "{ended}");
    agents.ended().with_code(0);
    assert_eq!(std::fs::read(&file).expect("it is there"), whole[..whole.len() / 2], "it is left as it was");
}
