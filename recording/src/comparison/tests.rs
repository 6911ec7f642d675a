use super::*;
use msgs::maes_msgs::{Command, Counter, Observation};
use msgs::topics::Topic;

use crate::SCENARIO_ATTACHMENT;
use crate::recorder::{Document, Recorder};

type Recorded = (Topic, Tick, Vec<u8>);

fn observation(tick: u64, x: f64) -> Recorded {
    let mut observation = Observation { agent: 3, tick, ..Observation::default() };
    observation.position.x = x;
    (topics::observation(AgentId(3)), Tick(tick), cdr::encode(&observation))
}

fn command(tick: u64) -> Recorded {
    (topics::command(AgentId(3)), Tick(tick), cdr::encode(&Command { agent: 3, tick, ..Command::default() }))
}

fn result(counters: &[(&str, u64)]) -> Recorded {
    let counters = counters.iter().map(|&(name, value)| Counter { name: name.to_owned(), value }).collect();
    (topics::result(), Tick(9), cdr::encode(&maes_msgs::Result { tick: 9, counters, ..maes_msgs::Result::default() }))
}

/// A recording of these messages; without an end record if open.
fn recording(messages: &[Recorded], is_open: bool) -> Recording {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let documents = [Document { name: SCENARIO_ATTACHMENT, media_type: "", data: b"" }];
    let mut recorder = Recorder::create(&file, &documents).unwrap();
    recorder.publish().unwrap();
    for (topic, tick, data) in messages {
        recorder.write(topic, *tick, data).unwrap();
    }
    if is_open {
        recorder.save_provisionally().unwrap();
        drop(recorder);
    } else {
        recorder.finish().unwrap();
    }
    Recording::open(&file).unwrap()
}

/// The comparison of these messages with a recording.
fn compared<'a>(recording: &'a Recording, now: &[Recorded]) -> Comparison<'a> {
    let mut comparison = Comparison::new(recording);
    for (topic, tick, data) in now {
        comparison.take(&topic.name, *tick, data);
    }
    comparison.end();
    comparison
}

fn found(before: &[Recorded], now: &[Recorded]) -> Option<String> {
    compared(&recording(before, false), now).difference().map(Difference::to_string)
}

#[test]
fn first_different_field_is_named() {
    let before = [observation(1, 1.5), command(1), observation(2, 1.5)];
    assert_eq!(found(&before, &before), None);
    let now = [observation(1, 1.5), command(1), observation(2, 1.75)];
    let words = "tick 2, agent 3, /agent_3/observation: position.x was 1.5 and is 1.75";
    assert_eq!(found(&before, &now).unwrap(), words);
}

#[test]
fn missing_and_surplus_messages_are_named() {
    let whole = [observation(1, 0.0), command(1), observation(2, 0.0)];
    let (part, gap) = ([observation(1, 0.0), command(1)], [observation(1, 0.0), observation(2, 0.0)]);
    let (o2, c1) = ("/agent_3/observation of tick 2", "/agent_3/command of tick 1");
    let at_2 = "tick 2, agent 3, /agent_3/observation: the message";
    let at_1 = "tick 1, agent 3, /agent_3/command: the message";
    assert_eq!(found(&whole, &part).unwrap(), format!("{at_2} was {o2} and is none"));
    assert_eq!(found(&part, &whole).unwrap(), format!("{at_2} was none and is {o2}"));
    assert_eq!(found(&whole, &gap).unwrap(), format!("{at_1} was {c1} and is {o2}"));
    assert_eq!(found(&gap, &whole).unwrap(), format!("{at_1} was {o2} and is {c1}"));
}

#[test]
fn messages_after_an_open_end_are_no_difference() {
    let open = recording(&[observation(1, 0.0)], true);
    let comparison = compared(&open, &[observation(1, 0.0), command(1)]);
    assert_eq!((comparison.difference(), comparison.is_closed(), comparison.compared()), (None, true, 1));
}

#[test]
fn visualisation_messages_are_ignored() {
    let view = (topics::info(), Tick(1), vec![0, 1, 0, 0]);
    assert_eq!(found(&[view, command(1)], &[command(1)]), None);
}

#[test]
fn counted_messages_are_those_of_the_run() {
    let view = (topics::info(), Tick(1), vec![0, 1, 0, 0]);
    let transforms = |tick| (topics::tf(), Tick(tick), cdr::encode(&TFMessage::default()));
    let messages = [view, command(1), transforms(3), transforms(10), observation(10, 0.5)];
    for is_open in [false, true] {
        let recording = recording(&messages, is_open);
        let of_run = compared(&recording, &messages);
        assert_eq!((of_run.difference(), of_run.compared(), of_run.left_out()), (None, 3, 2));
    }
}

#[test]
fn only_refusal_counters_are_ignored() {
    let before = recording(&[result(&[("scans", 5), ("refused_wrong_tick", 0)])], false);
    let disturbed = compared(&before, &[result(&[("scans", 5), ("refused_wrong_tick", 2)])]);
    assert_eq!(disturbed.difference(), None);
    assert_eq!(disturbed.refusals().unwrap().to_string(), "counters.refused_wrong_tick was 0 and is 2");
    let renamed = recording(&[result(&[("parcels_sent", 5), ("parcel_bytes_delivered_kind_1", 3)])], false);
    let now = [result(&[("message_bytes_delivered_kind_1", 3), ("messages_sent", 5)])];
    assert_eq!(compared(&renamed, &now).difference(), None);
    let other = compared(&before, &[result(&[("scans", 6), ("refused_wrong_tick", 0)])]);
    assert_eq!(other.difference().unwrap().to_string(), "tick 9, /sim/result: counters.scans was 5 and is 6");
}

/// Tools keep the order of times and of the messages of a topic, and not that of topics.
#[test]
fn order_of_topics_within_a_tick_is_ignored() {
    let now = [observation(1, 0.0), observation(1, 0.5), command(1), observation(2, 0.0), command(2)];
    let sorted = [command(1), observation(1, 0.0), observation(1, 0.5), command(2), observation(2, 0.0)];
    assert_eq!(found(&sorted, &now), None);
    let swapped = [observation(1, 0.5), observation(1, 0.0), command(1), observation(2, 0.0), command(2)];
    let words = "tick 1, agent 3, /agent_3/observation: position.x was 0.5 and is 0.0";
    assert_eq!(found(&swapped, &now).unwrap(), words);
    let later = [observation(1, 0.0), observation(1, 0.5), observation(2, 0.0), command(1), command(2)];
    assert!(found(&later, &now).is_some());
}
