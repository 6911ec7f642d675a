//! Replay of recordings on ROS 2 topics, with a node of a real ROS 2 (rclpy on Fast DDS) that
//! receives and controls it.
//!
//! The node is `replay.py`.

use std::fmt::Write;

use msgs::topics;

use crate::support::processes::{Process, signal};
use crate::support::recordings::Recording;
use crate::support::runs::{Site, text};
use crate::support::{python, root};

/// A run of two agents.
const FLAGS: [&str; 10] =
    ["--transport", "memory", "--agents", "2", "--size", "40", "--duration", "20", "--set", "stop_when_explored=false"];

/// Records a run with these visualisation topics.
fn record(site: &Site, name: &str, views: &str) -> Recording {
    let views = format!("views.record=[{views}]");
    let flags = ["--set", &views, "--set", "views.unexplored_period_ticks=1"];
    let outcome = site.record(&[&FLAGS[..], &flags].concat());
    site.file(name, &outcome.bytes);
    Recording::from_bytes(&outcome.bytes)
}

/// Starts a replay.
fn replay(site: &Site, flags: &[&str]) -> Process {
    python::prepare_ros();
    Process::start(site.binary("maes").args(["replay", "run.mcap"]).args(flags))
}

/// Starts a scene of `replay.py`.
fn begin(site: &Site, scene: &[&str]) -> Process {
    python::prepare_ros();
    let mut command = site.command("bash");
    command.args(python::in_ros()).arg("python3").arg(root().join("tests/replay.py")).args(scene);
    Process::start(&mut command)
}

/// Runs a scene to its end.
fn execute(site: &Site, scene: &[&str]) {
    let player = begin(site, scene).ended().with_code(0);
    assert!(player.stdout.contains("done"), "{player}");
}

/// The messages of a recording as lines for `replay.py`.
fn lines<'a>(messages: impl Iterator<Item = &'a crate::support::recordings::Message>) -> String {
    let mut lines = String::new();
    for message in messages {
        let topic = topics::named(&message.topic).expect("a topic of a run");
        write!(lines, "{} {} ", message.topic, topic.message).expect("texts can be written");
        message.data.iter().for_each(|byte| write!(lines, "{byte:02x}").expect("texts can be written"));
        lines.push('\n');
    }
    lines
}

#[test]
fn replay_publishes_every_message_and_latches() {
    let site = Site::new();
    let views = "\"odom\", \"points\", \"path\", \"unexplored\", \"contacts\", \"info\"";
    let recording = record(&site, "run.mcap", views);
    // Static topics that the file lacks are generated as the run would have recorded them.
    let with_statics = record(&site, "statics.mcap", "\"map\", \"tf_static\"");
    let statics = |topic: &str| ["/sim/map", "/tf_static"].contains(&topic);
    assert!(!recording.messages.iter().any(|message| statics(&message.topic)));
    let made: Vec<_> = with_statics.messages.iter().filter(|message| statics(&message.topic)).collect();
    let unexplored = recording.messages.iter().filter(|message| message.topic == "/sim/unexplored").count();
    assert!(unexplored > topics::unexplored().qos.depth as usize, "{unexplored} are not more than the depth");
    let expected = site.file("expected.txt", lines(made.iter().copied().chain(&recording.messages)));

    let mut listener = begin(&site, &["everything", text(&expected)]);
    listener.prints("ready");
    let replay = replay(&site, &["--paused", "--rate", "max"]);
    listener.prints("everything 1001");
    listener.ended().with_code(0);
    execute(&site, &["late", text(&expected)]);
    let ended = replay.ended().with_code(130);
    assert_eq!(ended.stdout, format!("replayed {} messages, 20.00 s", recording.messages.len() + made.len()));
}

#[test]
fn replay_at_full_speed_loses_no_tail() {
    let site = Site::new();
    let recording = record(&site, "run.mcap", "\"odom\", \"path\", \"map\", \"unexplored\", \"info\"");
    let bytes: usize = recording.messages.iter().map(|message| message.data.len()).sum();
    assert!(bytes > 4_000_000, "{bytes} bytes are sent in no time");
    let expected = site.file("expected.txt", lines(recording.messages.iter()));
    for rate in ["max", "50"] {
        let mut listener = begin(&site, &["tail", text(&expected)]);
        listener.prints("ready");
        let ended = replay(&site, &["--rate", rate, "--exclude", "/tf_static"]).ended().with_code(0);
        assert!(!ended.stderr.contains("warning"), "{ended}");
        listener.prints(&format!("received {}", recording.messages.len()));
        listener.ended().with_code(0);
    }
}

#[test]
fn replay_is_paused_and_stepped_by_services() {
    let site = Site::new();
    record(&site, "run.mcap", "");
    let flags = ["--paused", "--rate", "0.001", "--start", "10.5", "--end", "12"];
    let replay = replay(&site, &flags);
    execute(&site, &["steps"]);
    let ended = replay.ended().with_code(0);
    assert!(ended.stdout.ends_with(" messages, 1.50 s"), "{ended}");
}

#[test]
fn suspended_reader_does_not_block_replay() {
    let site = Site::new();
    record(&site, "run.mcap", "");
    let replay = replay(&site, &["--paused", "--rate", "max", "--loop"]);
    let mut reader = begin(&site, &["hold"]);
    reader.prints("holds");
    signal(reader.pid(), "STOP");
    execute(&site, &["play"]);
    // Several times as many messages as may be unacknowledged.
    let mut replay = replay;
    let messages = |line: &str| line.split(" | ").nth(2)?.split(' ').next()?.parse::<u64>().ok();
    while messages(&replay.says(" messages")).is_none_or(|messages| messages < 3000) {}
    signal(replay.pid(), "INT");
    replay.ended().with_code(130);
}

#[test]
fn replay_does_not_disturb_a_run() {
    let site = Site::new();
    let recording = record(&site, "run.mcap", "");
    let mut replay = replay(&site, &["--rate", "20", "--loop"]);
    replay.says("x real time");
    // The same run over ROS 2, in the same domain.
    let flags: Vec<&str> = FLAGS[2..].to_vec();
    let beside = site.record(&flags);
    assert_eq!(beside.digest(), recording.result_digest());
    signal(replay.pid(), "INT");
    replay.ended().with_code(130);
}

#[test]
fn unplayable_requests_are_refused() {
    let site = Site::new();
    record(&site, "run.mcap", "");
    let refused = |arguments: &[&str], words: &str| {
        let ended = Process::start(site.binary("maes").arg("replay").args(arguments)).ended().with_code(2);
        assert!(ended.stderr.starts_with("error: ") && ended.stderr.lines().count() == 1, "{ended}");
        assert!(ended.stderr.contains(words), "{words}\n{ended}");
    };
    site.file("text.mcap", "no recording");
    refused(&["nothing.mcap"], "nothing.mcap: No such file");
    refused(&["text.mcap"], "text.mcap: no MCAP recording");
    refused(
        &["run.mcap", "--topics", "/tf,/chatter"],
        "--topics /chatter: no such topic in run.mcap, which has /agent_0/command,",
    );
    refused(&["run.mcap", "--exclude", "/sim*,/x*"], "--exclude /x*");
    refused(&["run.mcap", "--exclude", "/*"], "no message is left to play");
    refused(&["run.mcap", "--start", "-1"], "--start -1");
    refused(&["run.mcap", "--start", "5", "--end", "5"], "--end 5: expected");
    refused(&["run.mcap", "--start", "21"], "the recording ends at 20 s");
}

#[test]
fn damaged_recording_is_played_up_to_the_damage() {
    let site = Site::new();
    let whole = record(&site, "whole.mcap", "");
    let bytes = std::fs::read(site.path("whole.mcap")).expect("there is a recording");
    let cut = &bytes[..bytes.len() * 2 / 3];
    let readable = Recording::from_bytes(cut);
    assert!(readable.is_beginning_of(&whole) && !readable.messages.is_empty());
    site.file("run.mcap", cut);
    let ended = replay(&site, &["--rate", "max", "--exclude", "/sim/map,/tf_static"]).ended().with_code(0);
    assert!(ended.stdout.starts_with(&format!("replayed {} messages, ", readable.messages.len())), "{ended}");
    assert!(ended.stderr.contains("warning: run.mcap is cut off behind byte"), "{ended}");
}
