//! What late readers of a topic have to be told: of each thing that it is about, what was said last.

use std::collections::{BTreeMap, BTreeSet};

use msgs::cdr::Encoded;
use msgs::message::Message;
use msgs::tf2_msgs::TFMessage;
use msgs::topics::{Durability, Topic};
use msgs::visualization_msgs::Marker;

/// What a message is about. A later one about the same takes its place: a marker is about its `ns` and `id`, transforms are about
/// their first frame, and everything else is about the same.
type Subject = (String, i32);

/// The last message about each thing, of a topic whose late readers get what the publisher still keeps.
#[derive(Debug)]
pub struct LatchedCache {
    topic: Topic,
    /// How many messages the present publisher has published.
    said: u64,
    /// By subject: the number of the message, which is 0 if the publisher that has said it is gone, and the message.
    last: BTreeMap<Subject, (u64, Encoded)>,
    /// What has to be said again.
    missing: BTreeSet<Subject>,
}

impl LatchedCache {
    /// Of a topic with late readers, before anything is said.
    #[must_use]
    pub fn for_topic(topic: &Topic) -> Option<Self> {
        let is_latched = topic.qos.durability == Durability::TransientLocal;
        is_latched.then(|| Self { topic: topic.clone(), said: 0, last: BTreeMap::new(), missing: BTreeSet::new() })
    }

    /// Notes that a message has been published.
    pub fn record_published(&mut self, message: &Encoded) {
        let subject = self.subject(message);
        self.said += 1;
        self.missing.remove(&subject);
        self.last.insert(subject, (self.said, message.clone()));
    }

    fn subject(&self, message: &Encoded) -> Subject {
        // What cannot be read is about the same as everything else that cannot.
        if self.topic.message == Marker::TYPE {
            message.decode::<Marker>().map(|marker| (marker.ns, marker.id)).unwrap_or_default()
        } else if self.topic.message == TFMessage::TYPE {
            let first = message.decode::<TFMessage>().ok().and_then(|message| message.transforms.into_iter().next());
            (first.map(|transform| transform.child_frame_id).unwrap_or_default(), 0)
        } else {
            Subject::default()
        }
    }

    /// There is a new publisher, which has said nothing yet.
    pub fn publisher_replaced(&mut self) {
        self.said = 0;
        self.last.values_mut().for_each(|(number, _)| *number = 0);
    }

    /// A new reader has come: what the publisher does not keep for it any more has to be said again.
    pub fn reader_joined(&mut self) {
        let kept_from = self.said.saturating_sub(u64::from(self.topic.qos.depth)) + 1;
        let lost = self.last.iter().filter(|(_, (number, _))| *number < kept_from).map(|(subject, _)| subject.clone());
        self.missing.extend(lost);
    }

    /// The next message that has to be said again, as it is now, until it is noted.
    #[must_use]
    pub fn next_missing(&self) -> Option<&Encoded> {
        let subject = self.missing.first()?;
        self.last.get(subject).map(|(_, message)| message)
    }

    /// Everything that is on it, in the order in which it was said.
    #[must_use]
    pub fn into_messages(self) -> Vec<Encoded> {
        let mut messages: Vec<_> = self.last.into_values().collect();
        messages.sort_by_key(|(number, _)| *number);
        messages.into_iter().map(|(_, message)| message).collect()
    }
}
