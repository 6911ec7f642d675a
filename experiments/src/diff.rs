//! The first difference of two recordings: a key of their scenarios, and a message.
//!
//! Invariant: two recordings of one run compare as the same run whatever their file names,
//! observers and disturbances were, and whatever tool has rewritten them.
//!
//! This module reads no file.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;

use msgs::printable;
use recording::comparison::{Checker, Comparison, Difference, is_of_run};
use recording::difference::Field;
use recording::{End, MAP_ATTACHMENT, Message, Recording, SCENARIO_ATTACHMENT};

/// Messages that a thread passes on at once, each of at most some 60 kB.
const BATCH: usize = 64;

/// Batches that wait at most.
const BATCHES_AHEAD: usize = 4;

/// The comparison of two recordings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verdict {
    /// The first key of the scenarios that differs.
    pub scenario: Option<Field>,
    /// Whether all attachments except the scenario are equal: the map.
    pub same_documents: bool,
    /// Number of messages that were compared and are equal, from the start on.
    pub messages: u64,
    pub outcome: MessageOutcome,
    /// The first refusal counter that differs; it is not part of the run.
    pub refusals: Option<Field>,
}

/// The comparison of the messages of two recordings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MessageOutcome {
    /// The files are equal, byte for byte; no message was read.
    SameBytes,
    Same,
    /// The first difference.
    Different(Box<Difference>),
    /// One recording is incomplete, and equal to the other up to its end.
    Shorter {
        /// Whether the incomplete one is the first.
        is_first: bool,
        end: End,
    },
}

impl Verdict {
    /// Whether they are recordings of the same run.
    #[must_use]
    pub fn is_same_run(&self) -> bool {
        let has_same_messages = matches!(self.outcome, MessageOutcome::SameBytes | MessageOutcome::Same);
        has_same_messages && self.scenario.is_none() && self.same_documents
    }
}

/// Compares two recordings.
#[must_use]
pub fn diff(first: &Recording, second: &Recording) -> Verdict {
    if first.has_same_bytes(second) {
        return Verdict {
            scenario: None,
            same_documents: true,
            messages: 0,
            outcome: MessageOutcome::SameBytes,
            refusals: None,
        };
    }
    let mut comparison = Comparison::new(first);
    if lacks_stages(first) || lacks_stages(second) {
        comparison = comparison.without_stages();
    }
    let second_end = compare_messages(&mut comparison, second);
    let is_first_shorter = comparison.is_closed();
    if !comparison.is_done() {
        comparison.end();
    }
    let outcome = match comparison.difference() {
        None if is_first_shorter => MessageOutcome::Shorter { is_first: true, end: end_of(first) },
        None => MessageOutcome::Same,
        // The second one is a prefix of the first.
        Some(difference) if second_end != End::Whole && difference.is_lack() => {
            MessageOutcome::Shorter { is_first: false, end: second_end }
        }
        Some(difference) => MessageOutcome::Different(Box::new(difference.clone())),
    };
    let rest = |recording: &Recording| {
        let mut documents = recording.attachments().clone();
        documents.remove(SCENARIO_ATTACHMENT);
        documents
    };
    Verdict {
        scenario: scenarios(&first.scenario(), &second.scenario()),
        same_documents: rest(first) == rest(second),
        messages: comparison.compared(),
        outcome,
        refusals: comparison.refusals().cloned(),
    }
}

/// Passes the messages of the second recording to the comparison, which reads the first, up to the
/// first difference. Returns where they end, as far as they were read. Most of the time goes into
/// decompression, so each file has a thread.
fn compare_messages(comparison: &mut Comparison<'_>, second: &Recording) -> End {
    let read = |batches: SyncSender<Vec<Message>>| {
        let mut messages = second.messages_on(is_of_run);
        loop {
            let batch: Vec<Message> = messages.by_ref().take(BATCH).collect();
            if batch.is_empty() || batches.send(batch).is_err() {
                return messages.end().cloned().unwrap_or(End::Missing);
            }
        }
    };
    thread::scope(|scope| {
        let (sender, batches) = sync_channel(BATCHES_AHEAD);
        let reader = scope.spawn(move || read(sender));
        for batch in &batches {
            for message in batch {
                comparison.take(&message.channel.topic, message.tick(), &message.data);
            }
            if comparison.is_done() {
                break;
            }
        }
        drop(batches);
        reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// Whether the commands of a recording have no stages: it is of an earlier build.
fn lacks_stages(recording: &Recording) -> bool {
    let command = recording.messages().find(|message| message.of_agent().is_some_and(|(_, name)| name == "command"));
    command.is_some_and(|message| message.channel.lacks_stage)
}

fn end_of(recording: &Recording) -> End {
    let mut messages = recording.messages();
    messages.by_ref().for_each(drop);
    messages.end().cloned().unwrap_or(End::Missing)
}

/// The first key of two scenarios that differs.
fn scenarios(first: &str, second: &str) -> Option<Field> {
    if first == second {
        return None;
    }
    let parsed = first.parse::<toml::Table>().ok().zip(second.parse::<toml::Table>().ok());
    let field =
        parsed.and_then(|(first, second)| key("", Some(&toml::Value::Table(first)), Some(&toml::Value::Table(second))));
    Some(field.unwrap_or_else(|| Field {
        name: "the text".to_owned(),
        before: "one".to_owned(),
        now: "another".to_owned(),
    }))
}

fn key(name: &str, first: Option<&toml::Value>, second: Option<&toml::Value>) -> Option<Field> {
    if first == second {
        return None;
    }
    if let (Some(toml::Value::Table(first)), Some(toml::Value::Table(second))) = (first, second) {
        let keys = first.keys().chain(second.keys().filter(|key| !first.contains_key(*key)));
        return keys.into_iter().find_map(|part| {
            let name = if name.is_empty() { part.clone() } else { format!("{name}.{part}") };
            key(&name, first.get(part), second.get(part))
        });
    }
    let words = |value: Option<&toml::Value>| value.map_or_else(|| "not set".to_owned(), toml::Value::to_string);
    Some(Field { name: name.to_owned(), before: words(first), now: words(second) })
}

/// The comparison as text for people.
#[must_use]
pub fn text(verdict: &Verdict, first: &Recording, second: &Recording) -> String {
    let Verdict { messages, .. } = verdict;
    let (one, two) = (first.file(), second.file());
    let values = |field: &Field| {
        format!("  {one}: {}\n  {two}: {}", printable::line(&field.before), printable::line(&field.now))
    };
    let mut lines = Vec::new();
    if let Some(field) = &verdict.scenario {
        lines.push(format!("their scenarios differ: {}\n{}", field.name, values(field)));
    }
    if !verdict.same_documents {
        lines.push(match (first.map_attachment().is_some(), second.map_attachment().is_some()) {
            (false, true) => format!("{one} has no attachment {MAP_ATTACHMENT}"),
            (true, false) => format!("{two} has no attachment {MAP_ATTACHMENT}"),
            _ => "their maps differ".to_owned(),
        });
    }
    match &verdict.outcome {
        MessageOutcome::Different(difference) => {
            let place = difference.place();
            let name = &difference.field.name;
            lines.push(printable::line(&format!("first difference: {place}: {name}")).into_owned());
            lines.push(values(&difference.field));
        }
        MessageOutcome::Shorter { is_first, end } => {
            let shorter = if *is_first { one } else { two };
            lines.push(format!(
                "the same as far as {shorter} goes, {messages} messages; it is {}",
                printable::line(&end.to_string())
            ));
        }
        MessageOutcome::SameBytes => lines.push("the same run: the same bytes".to_owned()),
        MessageOutcome::Same if verdict.scenario.is_none() && verdict.same_documents => {
            lines.push(format!("the same run: {messages} messages are the same"));
        }
        MessageOutcome::Same => lines.push(format!("{messages} messages are the same")),
    }
    if let Some(field) = &verdict.refusals {
        lines.push(format!(
            "the refusal counters differ, which are not part of the run: {}\n{}",
            field.name,
            values(field)
        ));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::ids::Tick;
    use msgs::maes_msgs::Digest;
    use msgs::{cdr, topics};
    use recording::recorder::{Document, Recorder};

    fn named(first: &str, second: &str) -> Option<String> {
        scenarios(first, second).map(|field| field.to_string())
    }

    /// A recording of these digests, with a message for observers.
    fn recording(digests: &[u8]) -> Recording {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("run.mcap");
        let documents = [Document { name: SCENARIO_ATTACHMENT, media_type: "", data: b"seed = 1" }];
        let mut recorder = Recorder::create(&file, &documents).unwrap();
        for (tick, &digest) in (0..).zip(digests) {
            let message = Digest { tick, digest: [digest; 32], ..Digest::default() };
            recorder.write(&topics::digest(), Tick(tick), &cdr::encode(&message)).unwrap();
        }
        recorder.write(&topics::info(), Tick(9), &[0, 1, 0, 0]).unwrap();
        recorder.finish().unwrap();
        Recording::open(&file).unwrap()
    }

    /// Files of one length as well.
    #[test]
    fn files_with_the_same_bytes_are_the_same_run() {
        let verdict = diff(&recording(&[1, 2, 3]), &recording(&[1, 2, 3]));
        assert_eq!((&verdict.outcome, verdict.is_same_run()), (&MessageOutcome::SameBytes, true));

        // How well a digest is compressed depends on it.
        let others: Vec<Recording> = (100..=u8::MAX).map(|digest| recording(&[1, 2, digest])).collect();
        let pair = others.windows(2).find(|pair| pair[0].length() == pair[1].length());
        let [first, second] = pair.expect("two have one length") else { unreachable!("a window of two") };
        let verdict = diff(first, second);
        assert_eq!((verdict.messages, verdict.is_same_run()), (2, false));
    }

    #[test]
    fn first_differing_key_is_named() {
        let text = "seed = 7\n[agents]\ncount = 3\n[agents.set]\nx = 1\n";
        assert_eq!(named(text, text), None);
        assert_eq!(named(text, &text.replace('3', "4")).unwrap(), "agents.count was 3 and is 4");
        assert_eq!(named(text, &text.replace("x = 1", "")).unwrap(), "agents.set.x was 1 and is not set");
        assert_eq!(named(text, &format!("{text}y = 2\n")).unwrap(), "agents.set.y was not set and is 2");
        assert_eq!(named(text, &format!("{text}\n")).unwrap(), "the text was one and is another");
    }
}
