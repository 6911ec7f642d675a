//! Summary of a recording.
//!
//! Truncated recordings are summarised up to the truncation. Control characters are escaped, so
//! that no name in a recording can imitate the digest.

use std::collections::BTreeMap;
use std::path::Path;

use msgs::ids::{AgentId, Tick};
use msgs::stage::Stage;
use msgs::{maes_msgs, printable, topics};

use crate::recording::{End, Recording, RecordingError};

/// The summary of a recording, as far as it can be read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Info {
    /// Scenario as TOML.
    pub scenario: String,
    /// The messages, by topic.
    pub messages: BTreeMap<String, Traffic>,
    pub digest: Option<maes_msgs::Digest>,
    /// The scenario as announced to agents.
    pub announced: Option<maes_msgs::Scenario>,
    /// Progress messages, in order.
    pub progress: Vec<maes_msgs::Progress>,
    /// The stages that commands name, in order: agent, tick and stage.
    pub stages: Vec<(AgentId, Tick, Stage)>,
    /// The result, if the run ended.
    pub result: Option<maes_msgs::Result>,
    /// Where and why reading stopped, unless at the end.
    pub damage: Option<String>,
}

/// The messages of a topic.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Number of messages.
    pub count: u64,
    /// Bytes of all of them as they are sent, without the headers of a transport.
    pub bytes: u64,
}

/// Summarises a file.
///
/// # Errors
/// If it cannot be opened or is no recording.
pub fn read(file: &Path) -> Result<Info, RecordingError> {
    Recording::open(file).map(|recording| of(&recording))
}

/// Summarises a recording.
#[must_use]
pub fn of(recording: &Recording) -> Info {
    let mut info = Info { scenario: recording.scenario().into_owned(), ..Info::default() };
    let mut messages = recording.messages();
    for message in &mut messages {
        let topic = &message.channel.topic;
        let traffic = info.messages.entry(topic.clone()).or_default();
        traffic.count += 1;
        let added = if message.channel.lacks_stage { maes_msgs::Command::UNDIGESTED_BYTES } else { 0 };
        traffic.bytes += (message.data.len() - added) as u64;
        if *topic == topics::digest().name {
            info.digest = message.decode().ok();
        } else if *topic == topics::result().name {
            info.result = message.decode().ok();
        } else if *topic == topics::progress().name {
            info.progress.extend(message.decode());
        } else if *topic == topics::scenario().name {
            info.announced = message.decode().ok();
        } else if topic.starts_with("/agent_")
            && topic.ends_with("/command")
            && let Ok(maes_msgs::Command { agent, tick, stage, .. }) = message.decode()
            && let Ok(Some(stage)) = Stage::from_wire(stage)
        {
            info.stages.push((AgentId(agent), Tick(tick), stage));
        }
    }
    if let Some(end @ (End::CutOff { .. } | End::Damage { .. })) = messages.end() {
        info.damage = Some(end.to_string());
    }
    info
}

/// A line for each fork that the run goes back to.
fn forks(scenario: &str) -> String {
    let scenario: toml::Table = scenario.parse().unwrap_or_default();
    let events = scenario.get("event").and_then(toml::Value::as_array).into_iter().flatten();
    let fork = |event: &toml::Value| {
        let parent = event.get("parent")?.as_str()?;
        let (at_s, set) = (event.get("at_s")?, event.get("set")?);
        let line = format!("forked at {at_s} s from the run with digest {parent}: {set}");
        Some(format!("\n{}\n", printable::line(&line)))
    };
    events.filter_map(fork).collect()
}

/// The summary as text; the last line is the digest.
#[must_use]
pub fn text(info: &Info) -> String {
    let mut text = format!("scenario:\n{}\nmessages:\n", printable::text(&info.scenario));
    text += &format!("{:>10} {:>12}\n", "number", "bytes");
    for (topic, Traffic { count, bytes }) in &info.messages {
        text += &format!("{count:>10} {bytes:>12} {}\n", printable::line(topic));
    }
    text += &forks(&info.scenario);
    match &info.result {
        Some(result) => text += &format!("\nresult:\n{}\n", crate::terminal::result_table(result)),
        None => text += "\nno result: the run did not come to its end\n",
    }
    if let Some(damage) = &info.damage {
        text += &format!("{}\n", printable::line(damage));
    }
    match &info.digest {
        Some(digest) => {
            let hex = simulation::digest::Digest(digest.digest);
            text += &format!("tick: {}\ndigest: {hex}", digest.tick);
        }
        None => text += "digest: none",
    }
    text
}
