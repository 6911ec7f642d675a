//! The schemas and channels of a file, which its messages refer to.

use std::collections::BTreeMap;
use std::sync::Arc;

use mcap::records::Record;
use msgs::maes_msgs::Command;
use msgs::message::Message as _;

use super::{Channel, Message};
use crate::recorder;

/// What the messages of a file refer to, by id.
#[derive(Debug, Clone, Default)]
pub(super) struct KnownChannels {
    schemas: BTreeMap<u16, KnownSchema>,
    pub(super) channels: BTreeMap<u16, KnownChannel>,
    /// The topics whose messages are returned; `None`: all.
    pub(super) wanted: Option<fn(&str) -> bool>,
    /// Messages on other topics so far, whose content was not copied.
    pub(super) left_out: u64,
}

impl KnownChannels {
    /// Reads a record, and returns the message if it is one on a wanted topic.
    pub(super) fn read(&mut self, kind: u8, content: &[u8]) -> Result<Option<Message>, String> {
        match mcap::parse_record(kind, content).map_err(|error| error.to_string())? {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, KnownSchema::new(header.name, &data));
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let KnownSchema { name: type_name, lacks_stage } = schema;
                let value = |key| channel.metadata.get(key).cloned().unwrap_or_default();
                let is_wanted = self.wanted.is_none_or(|is_wanted| is_wanted(&channel.topic));
                let (offered_qos, type_hash) = (value(recorder::QOS_KEY), value(recorder::TYPE_HASH_KEY));
                let id = channel.id;
                let channel = Channel { topic: channel.topic, type_name, offered_qos, type_hash, lacks_stage };
                self.channels.insert(id, KnownChannel { channel: Arc::new(channel), is_wanted });
            }
            Record::Message { header, data } => {
                let known = self.channels.get(&header.channel_id);
                let known =
                    known.ok_or_else(|| format!("a message of channel {}, which is unknown", header.channel_id))?;
                if !known.is_wanted {
                    self.left_out += 1;
                    return Ok(None);
                }
                let channel = known.channel.clone();
                let mut data = data.into_owned();
                if channel.lacks_stage {
                    data.extend([Command::SAME; Command::UNDIGESTED_BYTES]);
                }
                return Ok(Some(Message { channel, time_ns: header.log_time, data }));
            }
            _ => {}
        }
        Ok(None)
    }
}

/// A channel, and whether its messages are returned.
#[derive(Debug, Clone)]
pub(super) struct KnownChannel {
    pub(super) channel: Arc<Channel>,
    is_wanted: bool,
}

/// A type of messages.
#[derive(Debug, Clone, Default)]
struct KnownSchema {
    name: String,
    lacks_stage: bool,
}

impl KnownSchema {
    fn new(name: String, definition: &[u8]) -> Self {
        let has_stage = || {
            // The definitions of the types that it contains follow behind a rule.
            let mut own = definition.split(|&byte| byte == b'\n').take_while(|line| !line.starts_with(b"==="));
            own.any(|line| line.starts_with(b"uint8 stage"))
        };
        let lacks_stage = name == Command::TYPE.to_string() && !has_stage();
        Self { name, lacks_stage }
    }
}
