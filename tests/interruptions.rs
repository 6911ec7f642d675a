//! Runs that do not come to their end: what is left is readable, and nobody is left behind.

use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use msgs::ids::Tick;

use crate::support::lock;
use crate::support::memory::{Play, honest};
use crate::support::processes::{Process, signal, signal_group};
use crate::support::recordings::Recording;
use crate::support::runs::{Run, Site, scenario};

/// A run of ten minutes of sim time.
const LONG: [&str; 10] =
    ["--agents", "3", "--size", "30", "--seed", "7", "--duration", "600", "--set", "stop_when_explored=false"];

/// Holds it back, so that it is in the middle when a test needs it to be.
const HELD_BACK: [&str; 4] = ["--rtf", "20", "--record", "run.mcap"];

fn held_back(site: &Site, flags: &[&str]) -> Run {
    let mut run = site.start(&mut site.run_sh(&[&LONG[..], &HELD_BACK, flags].concat()));
    run.is_under_way();
    run
}

fn undisturbed(site: &Site) -> Recording {
    Recording::from_bytes(&site.record(&[&LONG[..], &["--transport", "memory"]].concat()).bytes)
}

/// Fails unless a run was interrupted in the middle and has kept everything up to there.
#[track_caller]
fn assert_interrupted(site: &Site, run: Run, whole: &Recording) {
    let ended = run.ended().with_code(130);
    let recording = site.recording("run.mcap");
    let result = recording.result();
    assert_eq!(result.reason, "interrupted", "{ended}");
    assert!((1..30_000).contains(&result.tick), "in the middle: {result:?}");
    assert_eq!(ended.digest(), recording.result_digest());
    recording.assert_begins(whole, 1);
}

#[test]
fn signals_end_a_run_with_a_result() {
    let site = Site::new();
    let whole = undisturbed(&site);
    for name in ["INT", "TERM", "HUP"] {
        let mut run = held_back(&site, &[]);
        signal(run.process().pid(), name);
        assert_interrupted(&site, run, &whole);
    }
}

#[test]
fn a_signal_of_the_terminal_ends_a_run_with_a_result() {
    let site = Site::new();
    let mut run = held_back(&site, &[]);
    signal_group(run.process().pid(), "INT");
    assert_interrupted(&site, run, &undisturbed(&site));
}

#[test]
fn a_run_in_memory_is_interrupted_in_the_same_way() {
    let site = Site::new();
    let mut run = held_back(&site, &["--transport", "memory"]);
    signal(run.process().pid(), "INT");
    assert_interrupted(&site, run, &undisturbed(&site));
}

#[test]
fn a_second_signal_ends_everything_at_once() {
    let site = Site::new();
    let mut run = held_back(&site, &[]);
    signal(run.process().pid(), "INT");
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    site.recording("run.mcap").assert_begins(&undisturbed(&site), 0);
}

/// Whenever a signal comes: nobody is left behind, which is looked at when a process ends.
#[test]
fn a_signal_while_processes_are_being_started_ends_them_all() {
    let site = Site::new();
    for words in [&["sim_server", "run"][..], &["agent_node", "--id 0"], &["agent_node", "--id 2"]] {
        let mut run = site.start(&mut site.run_sh(&[&LONG[..], &HELD_BACK].concat()));
        run.process().waits_for_member(words);
        signal(run.process().pid(), "INT");
        run.ended().with_code(130);
    }
}

#[test]
fn a_server_that_waits_for_agents_can_be_interrupted() {
    let site = Site::new();
    let mut server = site.binary("sim_server");
    server.arg("run").arg(scenario("default.toml")).args(["--record", "run.mcap"]);
    let mut run = site.start(&mut server);
    run.process().says("waiting for agents: 0, 1, 2, 3, 4");
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let result = site.recording("run.mcap").result();
    assert_eq!((result.reason.as_str(), result.tick), ("interrupted", 0));
}

#[test]
fn agents_that_wait_for_a_server_can_be_interrupted() {
    let site = Site::new();
    for name in ["INT", "TERM"] {
        let mut agent = Process::start(site.binary("agent_node").args(["--id", "0-2"]));
        // It has to get as far as to handle signals, and nothing tells when it has.
        agent.handles(name);
        signal(agent.pid(), name);
        agent.ended().with_code(0);
    }
}

#[test]
fn a_server_that_waits_for_an_answer_can_be_interrupted() {
    let site = Site::new();
    let mut run = held_back(&site, &["--decision-timeout", "1000"]);
    signal(run.process().member(&["agent_node", "--id 1-1"]), "STOP");
    signal(run.process().pid(), "INT");
    assert_interrupted(&site, run, &undisturbed(&site));
}

/// It has not looked for longer than an agent may take to answer, which is not the agents' fault.
#[test]
fn a_run_that_was_stopped_for_a_while_goes_on() {
    let site = Site::new();
    let slow = ["--transport", "memory", "--chaos-delay-ms", "50", "--decision-timeout", "1"];
    let mut run = site.start(&mut site.run_sh(&[&LONG[..], &slow].concat()));
    run.is_under_way();
    signal(run.process().pid(), "STOP");
    assert!(!run.process().says_within("anything", Duration::from_millis(1500)));
    signal(run.process().pid(), "CONT");
    assert_eq!(run.ended().with_code(0).digest(), undisturbed(&site).result_digest());
}

/// Their connections do not survive it: who goes on would be deaf, and be waited for in vain.
#[test]
fn processes_that_were_stopped_for_a_while_end_and_say_why() {
    let site = Site::new();
    let (mut server, mut agent) = (site.binary("sim_server"), site.binary("agent_node"));
    server.arg("run").arg(scenario("default.toml"));
    agent.args(["--id", "0"]);
    for mut command in [server, agent] {
        let mut process = Process::start(&mut command);
        process.handles("CONT");
        signal(process.pid(), "STOP");
        signal(process.pid(), "CONT");
        let ended = process.ended().with_code(1);
        assert!(ended.stderr.contains("error: this process was stopped for a while"), "{ended}");
    }
}

#[test]
fn the_recording_of_a_server_that_is_killed_is_readable() {
    let site = Site::new();
    let whole = undisturbed(&site);
    let mut run = held_back(&site, &[]);
    let server = run.process().member(&["sim_server", "run"]);
    // What people were told is on the disk a moment later, and is there to stay.
    run.process().waits_until(|| site.recording("run.mcap").digests().len() >= 20);
    let before = site.recording("run.mcap");
    signal(server, "KILL");
    let ended = run.ended();
    assert_eq!(ended.code, Some(137), "the exit code of the script is that of the server\n{ended}");
    let after = site.recording("run.mcap");
    assert!(after.messages.len() >= before.messages.len());
    assert!(after.is_beginning_of(&whole), "what is left is how the run begins");

    let info = Process::start(site.binary("sim_server").args(["info", "run.mcap"])).ended().with_code(0);
    assert!(info.stdout.contains("no result: the run did not come to its end"), "{info}");
    assert_eq!(info.digest().len(), 64);
}

#[test]
fn agents_whose_server_is_killed_can_be_ended() {
    let site = Site::new();
    let mut server = site.binary("sim_server");
    server.arg("run").arg(scenario("default.toml")).args(["--agents", "1", "--size", "30", "--rtf", "20"]);
    let mut run = site.start(&mut server);
    run.process().says("waiting for agents: 0");
    let agent = Process::start(site.binary("agent_node").args(["--id", "0"]));
    run.is_under_way();
    signal(run.process().pid(), "KILL");
    assert_eq!(run.ended().code, None);
    signal(agent.pid(), "TERM");
    agent.ended().with_code(0);
}

#[test]
fn agents_whose_server_is_killed_end() {
    let site = Site::new();
    let mut server = site.binary("sim_server");
    server.arg("run").arg(scenario("default.toml")).args(["--agents", "1", "--size", "30", "--rtf", "20"]);
    let mut run = site.start(&mut server);
    run.process().says("waiting for agents: 0");
    let agent = Process::start(site.binary("agent_node").args(["--id", "0", "--server-timeout", "3"]));
    run.is_under_way();
    signal(run.process().pid(), "KILL");
    assert_eq!(run.ended().code, None);
    let ended = agent.ended().with_code(1);
    assert!(ended.stderr.contains("has said nothing for 3 s; it seems to be gone"), "{ended}");
}

/// What was there when people were last told how far the run is, is in the file when they are told again.
#[test]
fn a_recording_follows_the_run_in_wall_time() {
    let site = Site::new();
    let mut play = Play::new(
        "seed = 7\nduration_s = 60.0\nstop_when_explored = false\n[map]\nkind = \"spheres\"\nsize = 20\n\
         [agents]\ncount = 2\n[execution]\nrtf = 20.0\n[recording]\nposes_period_ticks = 1\n",
    );
    let file = site.path("run.mcap");
    play.record = Some(file.clone());
    let told = Arc::new(Mutex::new(Vec::new()));
    let ticks = Arc::clone(&told);
    play.watch = Box::new(move |world| {
        let mut ticks = lock(&ticks);
        if let Some(&Tick(last)) = ticks.last() {
            let recorded = Recording::read(&file).messages.last().map_or(0, |message| message.tick);
            assert!(recorded >= last, "recorded up to tick {recorded}, people were told of tick {last}");
        }
        ticks.push(world.tick());
    });
    let played = play.with(|mut end, ids, is_over| {
        agent_node::host::run(&mut end, &honest(u64::from(ids[0].0), ids), is_over).expect("agents are welcome");
    });
    assert_eq!(played.outcome().result.tick, 3000);
    assert!(lock(&told).len() >= 3, "a run of three seconds tells people several times");
}

/// A command under which no file can grow beyond so many kilobytes, as on a disk that is full.
fn on_a_full_disk(site: &Site, kilobytes: u32, command: &Command) -> Command {
    let mut limited = site.command("bash");
    limited.arg("-c").arg(format!("trap '' XFSZ; ulimit -f {kilobytes}; exec \"$@\"")).arg("bash");
    limited.arg(command.get_program()).args(command.get_args());
    limited
}

#[test]
fn a_disk_that_is_full_ends_the_run() {
    let site = Site::new();
    let whole = undisturbed(&site);
    for transport in ["ros2", "memory"] {
        let flags = [&LONG[..], &["--transport", transport, "--record", "run.mcap"]].concat();
        let ended = site.start(&mut on_a_full_disk(&site, 48, &site.run_sh(&flags))).ended().with_code(1);
        assert!(ended.stderr.contains("error: recording run.mcap: "), "{ended}");
        assert!(ended.stderr.contains("File too large"), "the reason of the system: {ended}");
        let recording = site.recording("run.mcap");
        assert!(recording.messages.len() > 10);
        assert!(recording.is_beginning_of(&whole), "what is left is how the run begins");
    }
}

#[test]
fn a_recording_that_cannot_be_made_is_no_run() {
    let site = Site::new();
    for transport in ["ros2", "memory"] {
        for (file, reason) in [("nowhere/run.mcap", "No such file or directory"), ("/dev/full", "No space left")] {
            let flags = [&LONG[..], &["--transport", transport, "--record", file]].concat();
            let ended = site.start(&mut site.run_sh(&flags)).ended().with_code(1);
            assert_eq!(ended.stderr.lines().count(), 1, "{ended}");
            assert!(ended.stderr.starts_with(&format!("error: recording {file}: {reason}")), "{ended}");
        }
    }
}

/// As when it is piped into `head`.
#[test]
fn a_run_that_nobody_listens_to_goes_on() {
    let site = Site::new();
    for transport in ["ros2", "memory"] {
        let run_sh = site.run_sh(&[&LONG[..], &["--transport", transport, "--record", "run.mcap"]].concat());
        let mut deaf = site.command("bash");
        // A pipe whose reader has gone before anything is written to it.
        deaf.arg("-c").arg("exec 3> >(:); wait $!; exec \"$@\" >&3 2>&3").arg("bash");
        site.start(deaf.arg(run_sh.get_program()).args(run_sh.get_args())).ended().with_code(0);
        assert_eq!(site.recording("run.mcap").result(), undisturbed(&site).result(), "{transport}");
    }
}
