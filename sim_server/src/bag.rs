//! The `metadata.yaml` of a rosbag2 bag with one recording.
//!
//! `ros2 bag` opens a recording directly; tools that expect a folder need this file beside it. It
//! has version 5 of the format, which every distribution since Humble reads.
//!
//! This module writes no file.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;

use crate::recording::{Channel, Recording};

/// The metadata of a bag that holds this recording alone, under `file_name`.
///
/// # Panics
/// Never: writing to a string succeeds.
#[must_use]
pub fn metadata(recording: &Recording, file_name: &str) -> String {
    let mut topics: BTreeMap<String, (Arc<Channel>, u64)> = BTreeMap::new();
    let (mut first_ns, mut last_ns, mut count) = (u64::MAX, 0, 0_u64);
    for message in recording.messages() {
        (first_ns, last_ns) = (first_ns.min(message.time_ns), last_ns.max(message.time_ns));
        count += 1;
        topics.entry(message.channel.topic.clone()).or_insert_with(|| (Arc::clone(&message.channel), 0)).1 += 1;
    }
    let first_ns = first_ns.min(last_ns);
    let span = |indent: &str| {
        format!(
            "{indent}duration:\n{indent}  nanoseconds: {}\n{indent}starting_time:\n{indent}  nanoseconds_since_epoch: {first_ns}\n",
            last_ns - first_ns
        )
    };
    let mut text = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n".to_owned();
    text += &span("  ");
    let written = (|| {
        writeln!(text, "  message_count: {count}\n  topics_with_message_count:")?;
        for (channel, messages) in topics.values() {
            let Channel { topic, type_name, offered_qos, .. } = channel.as_ref();
            writeln!(text, "    - topic_metadata:\n        name: {}", quoted(topic))?;
            writeln!(text, "        type: {}\n        serialization_format: cdr", quoted(type_name))?;
            writeln!(text, "        offered_qos_profiles: {}", quoted(offered_qos))?;
            writeln!(text, "      message_count: {messages}")?;
        }
        let path = quoted(file_name);
        writeln!(text, "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {path}")?;
        write!(text, "  files:\n    - path: {path}\n{}      message_count: {count}", span("      "))
    })();
    written.expect("a text can be written to");
    text
}

/// A string as YAML, of which JSON is a subset.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
