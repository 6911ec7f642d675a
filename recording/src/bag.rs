//! The `metadata.yaml` of a rosbag2 folder with a single recording.
//!
//! `ros2 bag` opens a recording directly; tools that expect a folder need this file beside it. It
//! has version 8 of the format, the last one with the numbers of QoS policies: every distribution
//! since Humble reads it. Version 9 has their names instead, which those before Jazzy do not know.
//!
//! This module writes no file.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::RangeInclusive;

use crate::Recording;

/// The name of the file in its folder.
pub const FILE_NAME: &str = "metadata.yaml";

/// A topic of a bag.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BagTopic {
    pub name: String,
    /// Its type, such as `maes_msgs/msg/Command`.
    pub type_name: String,
    /// Offered QoS profiles, as rosbag2 writes them up to version 8.
    pub offered_qos: String,
    /// Hash of the type (REP-2016), or empty.
    pub type_hash: String,
    /// Number of its messages.
    pub messages: u64,
}

/// The metadata of a bag that holds this recording alone, under `file_name`.
#[must_use]
pub fn metadata(recording: &Recording, file_name: &str) -> String {
    let mut topics: BTreeMap<String, BagTopic> = BTreeMap::new();
    let (mut first_ns, mut last_ns) = (u64::MAX, 0);
    for message in recording.messages() {
        (first_ns, last_ns) = (first_ns.min(message.time_ns), last_ns.max(message.time_ns));
        let channel = &message.channel;
        let topic = topics.entry(channel.topic.clone()).or_insert_with(|| BagTopic {
            name: channel.topic.clone(),
            type_name: channel.type_name.clone(),
            offered_qos: channel.offered_qos.clone(),
            type_hash: channel.type_hash.clone(),
            messages: 0,
        });
        topic.messages += 1;
    }
    text(&topics.into_values().collect::<Vec<_>>(), first_ns.min(last_ns)..=last_ns, file_name)
}

/// The metadata of a bag with these topics, in the order of their names, and stamps in ns.
///
/// # Panics
/// Never: writing to a string succeeds.
#[must_use]
pub fn text(topics: &[BagTopic], stamps_ns: RangeInclusive<u64>, file_name: &str) -> String {
    let (first_ns, duration_ns) = (stamps_ns.start(), stamps_ns.end() - stamps_ns.start());
    let count: u64 = topics.iter().map(|topic| topic.messages).sum();
    let span = |indent: &str| {
        format!(
            "{indent}duration:\n{indent}  nanoseconds: {duration_ns}\n{indent}starting_time:\n\
             {indent}  nanoseconds_since_epoch: {first_ns}\n"
        )
    };
    let mut text = "rosbag2_bagfile_information:\n  version: 8\n  storage_identifier: mcap\n".to_owned();
    text += &span("  ");
    let written = (|| {
        writeln!(text, "  message_count: {count}\n  topics_with_message_count:")?;
        for BagTopic { name, type_name, offered_qos, type_hash, messages } in topics {
            writeln!(text, "    - topic_metadata:\n        name: {}", quoted(name))?;
            writeln!(text, "        type: {}\n        serialization_format: cdr", quoted(type_name))?;
            writeln!(text, "        offered_qos_profiles: {}", quoted(offered_qos))?;
            writeln!(text, "        type_description_hash: {}", quoted(type_hash))?;
            writeln!(text, "      message_count: {messages}")?;
        }
        let path = quoted(file_name);
        writeln!(text, "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {path}")?;
        write!(text, "  files:\n    - path: {path}\n{}      message_count: {count}", span("      "))?;
        write!(text, "\n  custom_data: {{}}\n  ros_distro: \"\"")
    })();
    written.expect("a text can be written to");
    text
}

/// A string as YAML, of which JSON is a subset.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
