//! What a recording says about its run.
//!
//! Reads whole recordings and such that end in the middle of a record, up to there.

use std::path::Path;

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use msgs::{cdr, maes_msgs, topics};
use thiserror::Error;

use crate::setup::SCENARIO_ATTACHMENT;

/// Longest record that is read, bytes, unless the file is longer: a damaged length must not fill the memory.
const RECORD_BYTES_MAX: usize = 1 << 26;

/// Why a recording cannot be described.
#[derive(Debug, Error)]
pub enum InfoError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Read {
        /// The file.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is no MCAP file.
    #[error("{file}: no MCAP recording: {source}")]
    NoMcap {
        /// The file.
        file: String,
        /// What the reader says.
        source: mcap::McapError,
    },
    /// The file is an MCAP file of something else.
    #[error("{file}: not a recording of this simulator: it has no attachment {SCENARIO_ATTACHMENT}")]
    OtherRecording {
        /// The file.
        file: String,
    },
}

/// What a recording holds, as far as it can be read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Info {
    /// The scenario.
    pub scenario: String,
    /// Messages by topic.
    pub messages: std::collections::BTreeMap<String, u64>,
    /// The last digest.
    pub digest: Option<maes_msgs::Digest>,
    /// What agents were told of the run.
    pub told: Option<maes_msgs::Scenario>,
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
pub fn read(file: &Path) -> Result<Info, InfoError> {
    let name = file.display().to_string();
    let bytes = std::fs::read(file).map_err(|source| InfoError::Read { file: name.clone(), source })?;
    let mut info = Info::default();
    let mut has_scenario = false;
    let mut topics_by_channel = std::collections::BTreeMap::new();
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(bytes.len().max(RECORD_BYTES_MAX));
    let mut reader = LinearReader::new_with_options(options);
    let mut position = 0;
    while let Some(event) = reader.next_event() {
        let record = match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let end = bytes.len().min(position + wanted);
                let part = &bytes[position..end];
                reader.insert(part.len()).copy_from_slice(part);
                reader.notify_read(part.len());
                position = end;
                continue;
            }
            Ok(LinearReadEvent::Record { data, opcode }) => mcap::parse_record(opcode, data),
            Err(source) => Err(source),
        };
        match record {
            Ok(Record::Attachment { header, data, .. }) if header.name == SCENARIO_ATTACHMENT => {
                has_scenario = true;
                info.scenario = String::from_utf8_lossy(&data).into_owned();
            }
            Ok(Record::Channel(channel)) => {
                topics_by_channel.insert(channel.id, channel.topic);
            }
            Ok(Record::Message { header, data }) => {
                if let Some(topic) = topics_by_channel.get(&header.channel_id) {
                    *info.messages.entry(topic.clone()).or_default() += 1;
                    if *topic == topics::digest().name {
                        info.digest = cdr::decode(&data).ok();
                    } else if *topic == topics::result().name {
                        info.result = cdr::decode(&data).ok();
                    } else if *topic == topics::progress().name {
                        info.progress.extend(cdr::decode(&data));
                    } else if *topic == topics::scenario().name {
                        info.told = cdr::decode(&data).ok();
                    }
                }
            }
            Ok(_) => {}
            Err(source) if position == 0 || info == Info::default() => {
                return Err(InfoError::NoMcap { file: name, source });
            }
            Err(source) => {
                info.damage = Some(format!("damaged or cut off before byte {position}: {source}"));
                break;
            }
        }
    }
    if !has_scenario {
        return Err(InfoError::OtherRecording { file: name });
    }
    Ok(info)
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
            let hex = crate::digest::Digest(digest.digest);
            text += &format!("tick: {}\ndigest: {hex}", digest.tick);
        }
        None => text += "digest: none",
    }
    text
}
