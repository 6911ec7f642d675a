//! Recordings are played on ROS 2 topics, and a node of a real ROS 2 (rclpy on Fast DDS) hears and controls them.
//!
//! What it does is in `replay.py`.

use std::fmt::Write;

use msgs::topics;

use crate::support::processes::{Process, signal};
use crate::support::recordings::Recording;
use crate::support::runs::{Site, text};
use crate::support::{python, root};

/// A run of two agents.
const FLAGS: [&str; 10] =
    ["--transport", "memory", "--agents", "2", "--size", "40", "--duration", "20", "--set", "stop_when_explored=false"];

/// Records a run with these views.
fn record(site: &Site, name: &str, views: &str) -> Recording {
    let views = format!("views.record=[{views}]");
    let flags = ["--set", &views, "--set", "views.unexplored_period_ticks=1"];
    let outcome = site.record(&[&FLAGS[..], &flags].concat());
    site.file(name, &outcome.bytes);
    Recording::from_bytes(&outcome.bytes)
}

/// Starts to play a recording.
fn replay(site: &Site, flags: &[&str]) -> Process {
    python::prepare_ros();
    Process::start(site.binary("maes").args(["replay", "run.mcap"]).args(flags))
}

/// Begins a play of `replay.py`.
fn begin(site: &Site, play: &[&str]) -> Process {
    python::prepare_ros();
    let mut command = site.command("bash");
    command.args(python::in_ros()).arg("python3").arg(root().join("tests/replay.py")).args(play);
    Process::start(&mut command)
}

/// Carries one out.
fn carry_out(site: &Site, play: &[&str]) {
    let player = begin(site, play).ended().with_code(0);
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
fn everything_is_heard_as_it_stands_in_the_file_and_a_late_reader_sees_all_that_holds() {
    let site = Site::new();
    let views = "\"odom\", \"points\", \"path\", \"unexplored\", \"contacts\", \"info\"";
    let recording = record(&site, "run.mcap", views);
    // What the file does not hold of the scenery is made as the run would have recorded it.
    let with_scenery = record(&site, "scenery.mcap", "\"map\", \"tf_static\"");
    let scenery = |topic: &str| ["/sim/map", "/tf_static"].contains(&topic);
    assert!(!recording.messages.iter().any(|message| scenery(&message.topic)));
    let made: Vec<_> = with_scenery.messages.iter().filter(|message| scenery(&message.topic)).collect();
    let unexplored = recording.messages.iter().filter(|message| message.topic == "/sim/unexplored").count();
    assert!(unexplored > topics::unexplored().qos.depth as usize, "{unexplored} are not more than are kept");
    let expected = site.file("expected.txt", lines(made.iter().copied().chain(&recording.messages)));

    let mut listener = begin(&site, &["everything", text(&expected)]);
    listener.prints("ready");
    let replay = replay(&site, &["--paused", "--rate", "max"]);
    listener.prints("everything 1001");
    listener.ended().with_code(0);
    carry_out(&site, &["late", text(&expected)]);
    let ended = replay.ended().with_code(130);
    assert_eq!(ended.stdout, format!("replayed {} messages, 20.00 s", recording.messages.len() + made.len()));
}

#[test]
fn it_is_paused_and_stepped_by_services() {
    let site = Site::new();
    record(&site, "run.mcap", "");
    let flags = ["--paused", "--rate", "0.001", "--start", "10.5", "--end", "12"];
    let replay = replay(&site, &flags);
    carry_out(&site, &["steps"]);
    let ended = replay.ended().with_code(0);
    assert!(ended.stdout.ends_with(" messages, 1.50 s"), "{ended}");
}

#[test]
fn a_reader_that_is_stopped_does_not_hold_it_up_for_ever() {
    let site = Site::new();
    record(&site, "run.mcap", "");
    let replay = replay(&site, &["--paused", "--rate", "max", "--loop"]);
    let mut reader = begin(&site, &["hold"]);
    reader.prints("holds");
    signal(reader.pid(), "STOP");
    carry_out(&site, &["play"]);
    // Several times as many ticks as may be under way.
    let mut replay = replay;
    let messages = |line: &str| line.split(" | ").nth(2)?.split(' ').next()?.parse::<u64>().ok();
    while messages(&replay.says(" messages")).is_none_or(|messages| messages < 3000) {}
    signal(replay.pid(), "INT");
    replay.ended().with_code(130);
}

#[test]
fn a_run_beside_a_replay_is_the_same() {
    let site = Site::new();
    let recording = record(&site, "run.mcap", "");
    let mut replay = replay(&site, &["--rate", "20", "--loop"]);
    replay.says("x real time");
    // The same run, over ROS, in the same domain.
    let flags: Vec<&str> = FLAGS[2..].to_vec();
    let beside = site.record(&flags);
    assert_eq!(beside.digest(), recording.result_digest());
    signal(replay.pid(), "INT");
    replay.ended().with_code(130);
}

#[test]
fn what_cannot_be_played_is_told_in_one_line() {
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
    refused(&["run.mcap", "--exclude", "/*"], "no message of it is to be played");
    refused(&["run.mcap", "--start", "-1"], "--start -1");
    refused(&["run.mcap", "--start", "5", "--end", "5"], "--end 5: expected");
    refused(&["run.mcap", "--start", "21"], "it goes up to 20 s");
}

#[test]
fn a_damaged_recording_is_played_up_to_the_damage() {
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
