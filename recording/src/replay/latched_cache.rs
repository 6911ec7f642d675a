//! Cache of the latched messages of a topic for late readers: the last message per subject.

use std::collections::{BTreeMap, BTreeSet};

use msgs::cdr::Encoded;
use msgs::message::Message;
use msgs::tf2_msgs::TFMessage;
use msgs::topics::{Durability, Topic};
use msgs::visualization_msgs::Marker;

/// The subject of a message, which a later message on it replaces: `ns` and `id` of a marker, the
/// first child frame of transforms, and one subject for everything else.
type Subject = (String, i32);

/// The last message per subject of a latched topic, of which the publisher itself keeps only the
/// last few.
#[derive(Debug)]
pub struct LatchedCache {
    topic: Topic,
    /// Messages that the present publisher has published.
    published: u64,
    /// By subject: the sequence number of the message, 0 if its publisher was replaced, and the
    /// message.
    last: BTreeMap<Subject, (u64, Encoded)>,
    /// Subjects to be retransmitted.
    missing: BTreeSet<Subject>,
}

impl LatchedCache {
    /// An empty cache, or `None` for a topic that is not latched.
    #[must_use]
    pub fn for_topic(topic: &Topic) -> Option<Self> {
        let is_latched = topic.qos.durability == Durability::TransientLocal;
        is_latched.then(|| Self { topic: topic.clone(), published: 0, last: BTreeMap::new(), missing: BTreeSet::new() })
    }

    /// Records a published message.
    pub fn record_published(&mut self, message: &Encoded) {
        let subject = self.subject(message);
        self.published += 1;
        self.missing.remove(&subject);
        self.last.insert(subject, (self.published, message.clone()));
    }

    fn subject(&self, message: &Encoded) -> Subject {
        // Undecodable messages share one subject.
        if self.topic.message == Marker::TYPE {
            message.decode::<Marker>().map(|marker| (marker.ns, marker.id)).unwrap_or_default()
        } else if self.topic.message == TFMessage::TYPE {
            let first = message.decode::<TFMessage>().ok().and_then(|message| message.transforms.into_iter().next());
            (first.map(|transform| transform.child_frame_id).unwrap_or_default(), 0)
        } else {
            Subject::default()
        }
    }

    /// The publisher was replaced; the new one keeps nothing.
    pub fn publisher_replaced(&mut self) {
        self.published = 0;
        self.last.values_mut().for_each(|(number, _)| *number = 0);
    }

    /// A reader has joined: messages that the publisher no longer keeps must be retransmitted.
    pub fn reader_joined(&mut self) {
        let kept_from = self.published.saturating_sub(u64::from(self.topic.qos.depth)) + 1;
        let lost = self.last.iter().filter(|(_, (number, _))| *number < kept_from).map(|(subject, _)| subject.clone());
        self.missing.extend(lost);
    }

    /// The next message to retransmit, until it is recorded as published.
    #[must_use]
    pub fn next_missing(&self) -> Option<&Encoded> {
        let subject = self.missing.first()?;
        self.last.get(subject).map(|(_, message)| message)
    }

    /// All messages, in the order of publication.
    #[must_use]
    pub fn into_messages(self) -> Vec<Encoded> {
        let mut messages: Vec<_> = self.last.into_values().collect();
        messages.sort_by_key(|(number, _)| *number);
        messages.into_iter().map(|(_, message)| message).collect()
    }
}
