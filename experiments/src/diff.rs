//! What two recordings do not have in common: a key of their scenarios, and the first message.
//!
//! Invariant: two recordings of one run are the same whatever they were called, whoever looked on and whoever disturbed.
//!
//! This module reads no file and prints nothing.

use sim_server::comparison::{Comparison, Difference};
use sim_server::difference::Field;
use sim_server::recording::{End, Recording};
use sim_server::session::Checker;
use sim_server::setup::SCENARIO_ATTACHMENT;

/// What was found about two recordings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verdict {
    /// Whether the files are the same, byte for byte.
    pub same_bytes: bool,
    /// The first key of the scenarios that differs.
    pub scenario: Option<Field>,
    /// Whether everything else that they hold beside messages is the same: the map.
    pub same_documents: bool,
    /// How many messages are the same, from the start on.
    pub messages: u64,
    /// What there is to say about the messages.
    pub said: Said,
    /// The first counter of refusals that differs.
    pub refusals: Option<Field>,
}

/// What was found about the messages of two recordings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Said {
    /// They are the same.
    Same,
    /// The first one that is not.
    Different(Box<Difference>),
    /// They are the same as far as a recording goes that has no end.
    Shorter {
        /// Whether it is the first one.
        is_first: bool,
        /// How it ends.
        end: End,
    },
}

impl Verdict {
    /// Whether they are recordings of the same run.
    #[must_use]
    pub fn is_same_run(&self) -> bool {
        self.said == Said::Same && self.scenario.is_none() && self.same_documents
    }
}

/// Compares two recordings.
#[must_use]
pub fn diff(first: &Recording, second: &Recording) -> Verdict {
    let mut comparison = Comparison::new(first);
    let mut messages = second.messages();
    for message in messages.by_ref() {
        comparison.take(&message.channel.topic, message.tick(), &message.data);
    }
    let second_end = messages.end().cloned().unwrap_or(End::Missing);
    let is_first_shorter = comparison.is_closed();
    if !comparison.is_done() {
        comparison.end();
    }
    let said = match comparison.difference() {
        None if is_first_shorter => Said::Shorter { is_first: true, end: end_of(first) },
        None => Said::Same,
        // All of the second one is in the first, which has more.
        Some(difference) if second_end != End::Whole && difference.is_lack() => {
            Said::Shorter { is_first: false, end: second_end }
        }
        Some(difference) => Said::Different(Box::new(difference.clone())),
    };
    let rest = |recording: &Recording| {
        let mut documents = recording.attachments().clone();
        documents.remove(SCENARIO_ATTACHMENT);
        documents
    };
    Verdict {
        same_bytes: first.bytes() == second.bytes(),
        scenario: scenarios(&first.scenario(), &second.scenario()),
        same_documents: rest(first) == rest(second),
        messages: comparison.compared(),
        said,
        refusals: comparison.refusals().cloned(),
    }
}

fn end_of(recording: &Recording) -> End {
    let mut messages = recording.messages();
    messages.by_ref().for_each(drop);
    messages.end().cloned().unwrap_or(End::Missing)
}

/// The first key of two scenarios that differs, if one does.
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

/// What people are told of two recordings.
#[must_use]
pub fn text(verdict: &Verdict, first: &Recording, second: &Recording) -> String {
    let Verdict { messages, .. } = verdict;
    let (one, two) = (first.file(), second.file());
    let values = |field: &Field| format!("  {one}: {}\n  {two}: {}", field.before, field.now);
    let mut lines = Vec::new();
    if let Some(field) = &verdict.scenario {
        lines.push(format!("their scenarios differ: {}\n{}", field.name, values(field)));
    }
    if !verdict.same_documents {
        lines.push("their maps differ".to_owned());
    }
    match &verdict.said {
        Said::Different(difference) => {
            let place = difference.place();
            let name = &difference.field.name;
            lines.push(format!("first difference: {place}: {name}\n{}", values(&difference.field)));
        }
        Said::Shorter { is_first, end } => {
            let shorter = if *is_first { one } else { two };
            lines.push(format!("the same as far as {shorter} goes, {messages} messages; it is {end}"));
        }
        Said::Same if verdict.same_bytes => lines.push(format!("the same run: the same bytes, {messages} messages")),
        Said::Same if verdict.scenario.is_none() && verdict.same_documents => {
            lines.push(format!("the same run: {messages} messages are the same"));
        }
        Said::Same => lines.push(format!("{messages} messages are the same")),
    }
    if let Some(field) = &verdict.refusals {
        lines.push(format!("what was refused differs, which is not of the run: {}\n{}", field.name, values(field)));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(first: &str, second: &str) -> Option<String> {
        scenarios(first, second).map(|field| field.to_string())
    }

    #[test]
    fn the_first_key_of_a_scenario_that_differs_is_named() {
        let text = "seed = 7\n[agents]\ncount = 3\n[agents.set]\nx = 1\n";
        assert_eq!(named(text, text), None);
        assert_eq!(named(text, &text.replace('3', "4")).unwrap(), "agents.count was 3 and is 4");
        assert_eq!(named(text, &text.replace("x = 1", "")).unwrap(), "agents.set.x was 1 and is not set");
        assert_eq!(named(text, &format!("{text}y = 2\n")).unwrap(), "agents.set.y was not set and is 2");
        assert_eq!(named(text, &format!("{text}\n")).unwrap(), "the text was one and is another");
    }
}
