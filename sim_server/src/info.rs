//! What a recording says about its run.
//!
//! Reads whole recordings and such that end in the middle of a record, up to there.

use std::path::Path;

use msgs::{maes_msgs, topics};

use crate::recording::{End, Recording, RecordingError};

/// What a recording holds, as far as it can be read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Info {
    /// The scenario.
    pub scenario: String,
    /// Messages by topic.
    pub messages: std::collections::BTreeMap<String, u64>,
    /// The last digest.
    pub digest: Option<maes_msgs::Digest>,
    /// What agents were announced of the run.
    pub announced: Option<maes_msgs::Scenario>,
    /// How far it had come, from the start on.
    pub progress: Vec<maes_msgs::Progress>,
    /// The result, if the run came to its end.
    pub result: Option<maes_msgs::Result>,
    /// Where and why reading ended, if it was not the end of the file.
    pub damage: Option<String>,
}

/// Reads what a recording holds.
///
/// # Errors
/// If it cannot be opened or is no recording.
pub fn read(file: &Path) -> Result<Info, RecordingError> {
    Recording::open(file).map(|recording| of(&recording))
}

/// What a recording holds.
#[must_use]
pub fn of(recording: &Recording) -> Info {
    let mut info = Info { scenario: recording.scenario().into_owned(), ..Info::default() };
    let mut messages = recording.messages();
    for message in &mut messages {
        let topic = &message.channel.topic;
        *info.messages.entry(topic.clone()).or_default() += 1;
        if *topic == topics::digest().name {
            info.digest = message.decode().ok();
        } else if *topic == topics::result().name {
            info.result = message.decode().ok();
        } else if *topic == topics::progress().name {
            info.progress.extend(message.decode());
        } else if *topic == topics::scenario().name {
            info.announced = message.decode().ok();
        }
    }
    if let Some(end @ (End::CutOff { .. } | End::Damage { .. })) = messages.end() {
        info.damage = Some(end.to_string());
    }
    info
}

/// A description for people; the last line is the digest.
#[must_use]
pub fn text(info: &Info) -> String {
    let mut text = format!("scenario:\n{}\nmessages:\n", info.scenario);
    for (topic, count) in &info.messages {
        text += &format!("{count:>10} {topic}\n");
    }
    match &info.result {
        Some(result) => text += &format!("\nresult:\n{}\n", crate::terminal::result_table(result)),
        None => text += "\nno result: the run did not come to its end\n",
    }
    if let Some(damage) = &info.damage {
        text += &format!("{damage}\n");
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
