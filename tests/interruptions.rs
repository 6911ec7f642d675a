//! Interrupted runs: their recordings are readable, and no process is left.

use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use msgs::ids::Tick;

use crate::network_attacks::has_fixes;
use crate::support::lock;
use crate::support::memory::{Play, honest};
use crate::support::processes::{Process, signal, signal_group};
use crate::support::recordings::Recording;
use crate::support::runs::{Run, Site, scenario};

/// A run of ten minutes of sim time.
const LONG: [&str; 10] =
    ["--agents", "3", "--size", "30", "--seed", "7", "--duration", "600", "--set", "stop_when_explored=false"];

/// Paces the run, which then takes a minute: enough for a busy machine to interrupt it.
const PACED: [&str; 4] = ["--rtf", "10", "--record", "run.mcap"];

fn paced(site: &Site, flags: &[&str]) -> Run {
    // One of an earlier run would be under way already.
    drop(std::fs::remove_file(site.path("run.mcap")));
    let mut run = site.start(&mut site.run_sh(&[&LONG[..], &PACED, flags].concat()));
    run.is_under_way(&site.path("run.mcap"));
    run
}

fn undisturbed(site: &Site) -> Recording {
    Recording::from_bytes(&site.record(&[&LONG[..], &["--transport", "memory"]].concat()).bytes)
}

/// Fails unless a run was interrupted before its end, with a result and all messages up to there.
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
        let mut run = paced(&site, &[]);
        signal(run.process().pid(), name);
        assert_interrupted(&site, run, &whole);
    }
}

#[test]
fn terminal_signal_ends_a_run_with_a_result() {
    let site = Site::new();
    let mut run = paced(&site, &[]);
    signal_group(run.process().pid(), "INT");
    assert_interrupted(&site, run, &undisturbed(&site));
}

#[test]
fn signal_ends_an_in_memory_run() {
    let site = Site::new();
    let mut run = paced(&site, &["--transport", "memory"]);
    signal(run.process().pid(), "INT");
    assert_interrupted(&site, run, &undisturbed(&site));
}

#[test]
fn second_signal_ends_at_once() {
    let site = Site::new();
    let mut run = paced(&site, &[]);
    signal(run.process().pid(), "INT");
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    site.recording("run.mcap").assert_begins(&undisturbed(&site), 0);
}

/// [`Run::ended`] fails if a process is left.
#[test]
fn signal_during_startup_ends_all_processes() {
    let site = Site::new();
    for words in [&["sim_server", "run"][..], &["agent_node", "--id 0"], &["agent_node", "--id 2"]] {
        let mut run = site.start(&mut site.run_sh(&[&LONG[..], &PACED].concat()));
        run.process().waits_for_member(words);
        signal(run.process().pid(), "INT");
        run.ended().with_code(130);
    }
}

#[test]
fn server_waiting_for_agents_is_interruptible() {
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
fn agents_waiting_for_a_server_are_interruptible() {
    let site = Site::new();
    for name in ["INT", "TERM"] {
        let mut agent = Process::start(site.binary("agent_node").args(["--id", "0-2"]));
        agent.handles(name);
        signal(agent.pid(), name);
        agent.ended().with_code(0);
    }
}

#[test]
fn server_waiting_for_a_reply_is_interruptible() {
    let site = Site::new();
    let mut run = paced(&site, &["--decision-timeout", "1000"]);
    signal(run.process().member(&["agent_node", "--id 1-1"]), "STOP");
    signal(run.process().pid(), "INT");
    assert_interrupted(&site, run, &undisturbed(&site));
}

/// The time for which the server was suspended does not count as time without a reply.
#[test]
fn suspended_in_memory_run_continues() {
    let site = Site::new();
    let slow = ["--transport", "memory", "--chaos-delay-ms", "50", "--decision-timeout", "1", "--record", "run.mcap"];
    let mut run = site.start(&mut site.run_sh(&[&LONG[..], &slow].concat()));
    run.is_under_way(&site.path("run.mcap"));
    signal(run.process().pid(), "STOP");
    assert!(!run.process().says_within("anything", Duration::from_millis(1500)));
    signal(run.process().pid(), "CONT");
    assert_eq!(run.ended().with_code(0).digest(), undisturbed(&site).result_digest());
}

/// With the fixes, DDS connections survive a suspension: the run continues, and is the same.
#[test]
fn suspended_processes_continue() {
    if !has_fixes() {
        return;
    }
    let site = Site::new();
    let mut run = paced(&site, &["--decision-timeout", "60"]);
    for words in [&["agent_node", "--id 1-1"][..], &["sim_server", "run"], &["agent_node", "--id 2-2"]] {
        let member = run.process().member(words);
        let before = site.recording("run.mcap").digests().len();
        signal(member, "STOP");
        assert!(!run.process().says_within("nothing like this", Duration::from_secs(2)));
        signal(member, "CONT");
        // Digests come once a second of sim time: the process serves its run again.
        run.process().waits_until(|| site.recording("run.mcap").digests().len() >= before + 50);
    }
    assert_eq!(run.ended().with_code(0).digest(), undisturbed(&site).result_digest());
}

/// Without them a continued process would receive nothing.
#[test]
fn suspended_processes_end_with_an_error() {
    if ros_node::has_dds_fixes() {
        return;
    }
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
fn recording_of_a_killed_server_is_readable() {
    let site = Site::new();
    let whole = undisturbed(&site);
    let mut run = paced(&site, &[]);
    let server = run.process().member(&["sim_server", "run"]);
    // Messages in the file stay there whatever becomes of the server.
    run.process().waits_until(|| site.recording("run.mcap").digests().len() >= 20);
    let before = site.recording("run.mcap");
    signal(server, "KILL");
    let ended = run.ended();
    assert_eq!(ended.code, Some(137), "the exit code of the script is that of the server\n{ended}");
    let after = site.recording("run.mcap");
    assert!(after.messages.len() >= before.messages.len());
    assert!(after.is_beginning_of(&whole), "what is left is how the run begins");

    let info = Process::start(site.binary("maes").args(["info", "run.mcap"])).ended().with_code(0);
    assert!(info.stdout.contains("no result: the run did not come to its end"), "{info}");
    assert_eq!(info.digest().len(), 64);
}

#[test]
fn agents_of_a_killed_server_can_be_terminated() {
    let site = Site::new();
    let mut server = site.binary("sim_server");
    server.arg("run").arg(scenario("default.toml")).args(["--agents", "1", "--size", "30"]).args(PACED);
    let mut run = site.start(&mut server);
    run.process().says("waiting for agents: 0");
    let agent = Process::start(site.binary("agent_node").args(["--id", "0"]));
    run.is_under_way(&site.path("run.mcap"));
    signal(run.process().pid(), "KILL");
    assert_eq!(run.ended().code, None);
    signal(agent.pid(), "TERM");
    agent.ended().with_code(0);
}

#[test]
fn agents_of_a_killed_server_time_out() {
    let site = Site::new();
    let mut server = site.binary("sim_server");
    server.arg("run").arg(scenario("default.toml")).args(["--agents", "1", "--size", "30"]).args(PACED);
    let mut run = site.start(&mut server);
    run.process().says("waiting for agents: 0");
    let agent = Process::start(site.binary("agent_node").args(["--id", "0", "--server-timeout", "3"]));
    run.is_under_way(&site.path("run.mcap"));
    signal(run.process().pid(), "KILL");
    assert_eq!(run.ended().code, None);
    let ended = agent.ended().with_code(1);
    assert!(ended.stderr.contains("has been silent for 3 s; it seems to be gone"), "{ended}");
}

/// At each progress report, the file holds the messages of the report before.
#[test]
fn recording_keeps_up_with_progress() {
    let site = Site::new();
    let mut play = Play::new(
        "seed = 7\nduration_s = 60.0\nstop_when_explored = false\n[map]\nkind = \"spheres\"\nsize = 20\n\
         [agents]\ncount = 2\n[execution]\nrtf = 20.0\n[recording]\nposes_period_ticks = 1\n",
    );
    let file = site.path("run.mcap");
    play.record = Some(file.clone());
    let reports = Arc::new(Mutex::new(Vec::new()));
    let ticks = Arc::clone(&reports);
    play.watch = Box::new(move |world| {
        let mut ticks = lock(&ticks);
        if let Some(&Tick(last)) = ticks.last() {
            let recorded = Recording::read(&file).messages.last().map_or(0, |message| message.tick);
            assert!(recorded >= last, "recorded up to tick {recorded}, reported tick {last}");
        }
        ticks.push(world.tick());
    });
    let played = play.with(|mut end, ids, is_over| {
        agent_node::host::run(&mut end, &honest(u64::from(ids[0].0), ids), is_over).expect("agents are welcome");
    });
    assert_eq!(played.outcome().result.tick, 3000);
    assert!(lock(&reports).len() >= 3, "a run of three seconds has several progress reports");
}

/// Wraps a command so that no file can grow beyond so many kilobytes, as on a full disk.
fn on_a_full_disk(site: &Site, kilobytes: u32, command: &Command) -> Command {
    let mut limited = site.command("bash");
    limited.arg("-c").arg(format!("trap '' XFSZ; ulimit -f {kilobytes}; exec \"$@\"")).arg("bash");
    limited.arg(command.get_program()).args(command.get_args());
    limited
}

#[test]
fn full_disk_ends_the_run() {
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
fn unwritable_recording_prevents_the_run() {
    let site = Site::new();
    for transport in ["ros2", "memory"] {
        let flags = [&LONG[..], &["--transport", transport, "--record", "nowhere/run.mcap"]].concat();
        let ended = site.start(&mut site.run_sh(&flags)).ended().with_code(1);
        assert_eq!(ended.stderr.lines().count(), 1, "{ended}");
        let expected = "error: recording nowhere/run.mcap: No such file or directory";
        assert!(ended.stderr.starts_with(expected), "{ended}");
    }
}

/// As with a pipe into `head`.
#[test]
fn closed_output_pipes_are_tolerated() {
    let site = Site::new();
    for transport in ["ros2", "memory"] {
        let run_sh = site.run_sh(&[&LONG[..], &["--transport", transport, "--record", "run.mcap"]].concat());
        let mut closed = site.command("bash");
        // A pipe whose reader has ended before the first write.
        closed.arg("-c").arg("exec 3> >(:); wait $!; exec \"$@\" >&3 2>&3").arg("bash");
        site.start(closed.arg(run_sh.get_program()).args(run_sh.get_args())).ended().with_code(0);
        assert_eq!(site.recording("run.mcap").result(), undisturbed(&site).result(), "{transport}");
    }
}
