//! Publishers with back-pressure: they wait a bounded time for their readers. Replays use them,
//! because a gap in a replay is worse than a delay.
//!
//! Invariants: at most [`WINDOW`] samples of a topic are in flight; no call blocks longer than
//! [`BLOCKING`], and the caller can do other work in between; a reader that acknowledges nothing
//! for [`READER_TIMEOUT`] delays its own topic by that much per [`WINDOW`] samples, and no other
//! topic; a reader that acknowledges something in that time loses nothing, whatever others do.
//! Best-effort readers are not waited for.
//!
//! Over Zenoh the connection to each process has a window instead, and a call waits for room in it
//! until Zenoh closes the connection to a process that takes nothing.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use ros2_client::{CreateError, WriteError};
use rustdds::{GUID, QosPolicies, QosPolicyBuilder, policy};

use super::dds::{self, endpoint_error, qos_profile};
use super::network::Network;
#[cfg(feature = "zenoh")]
use super::zenoh;
use super::{EndpointFactory, Node, RosError, ThrottledWarning};
use msgs::cdr::Encoded;
use msgs::topics::{Reliability, Topic};
use system::wall_clock::now;

/// Maximum samples of a topic in flight: several times what readers keep, but few enough that large
/// samples do not fill memory or need thousands of repairs, which are slow.
const WINDOW: i32 = 1024;

/// Maximum wall time that one call waits for room in the window.
const BLOCKING: rustdds::Duration = rustdds::Duration::from_millis(20);

/// Wall time without an acknowledgement after which a reader is abandoned: several times what a
/// large sample takes on a busy machine.
const READER_TIMEOUT: Duration = Duration::from_secs(2);

/// Wall time for readers to match a new publisher.
const MATCHING_TIME: Duration = Duration::from_millis(100);

/// Outcome of [`BlockingPublisher::publish`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PublishOutcome {
    /// The message was sent, or counted as not sent.
    Sent,
    /// The window is full: publish the message again.
    Retry,
    /// The publisher was replaced, and the new one holds nothing for late readers yet: publish the
    /// message again.
    Renewed,
}

/// A publisher of encoded messages that waits for its readers.
pub struct BlockingPublisher {
    writer: Writer,
    unsent: ThrottledWarning,
}

enum Writer {
    Dds(DdsWriter),
    #[cfg(feature = "zenoh")]
    Zenoh(zenoh::Writer),
}

struct DdsWriter {
    publisher: ros2_client::Publisher<Encoded>,
    topic: rustdds::Topic,
    /// Of the readers since the window is full.
    progress: Option<ReaderProgress<GUID>>,
    /// Set after a replacement, until its readers have had time to match it.
    matched_at: Option<Instant>,
}

impl EndpointFactory {
    /// Creates a publisher of this topic that waits for its readers.
    ///
    /// # Errors
    /// If the middleware refuses it.
    pub fn blocking_publisher(&mut self, node: &mut Node, topic: &Topic) -> Result<BlockingPublisher, RosError> {
        let writer = match &self.context.network {
            Network::Dds(_) => {
                self.pause();
                Writer::Dds(DdsWriter::new(&self.context.participant(), node.dds(), topic)?)
            }
            #[cfg(feature = "zenoh")]
            Network::Zenoh(_) => Writer::Zenoh(node.zenoh().blocking_writer(topic)?),
        };
        Ok(BlockingPublisher { writer, unsent: ThrottledWarning::new(format!("{}: not sent", topic.name)) })
    }
}

/// The QoS policies of the topic, with a window of [`WINDOW`] samples.
fn policies(topic: &Topic) -> QosPolicies {
    let limits = policy::ResourceLimits { max_samples: WINDOW, max_instances: 1, max_samples_per_instance: WINDOW };
    let mut window = QosPolicyBuilder::new().resource_limits(limits);
    if topic.qos.reliability == Reliability::Reliable {
        window = window.reliability(policy::Reliability::Reliable { max_blocking_time: BLOCKING });
    }
    QosPolicies::from(qos_profile(&topic.qos)).modify_by(&window.build())
}

impl BlockingPublisher {
    /// Publishes a message if the window has room. A message that the middleware refuses for
    /// another reason is counted as not sent.
    pub fn publish(&mut self, node: &mut Node, message: &Encoded) -> PublishOutcome {
        let published = match &mut self.writer {
            Writer::Dds(writer) => writer.publish(node.dds(), message),
            #[cfg(feature = "zenoh")]
            Writer::Zenoh(writer) => writer.publish(message).map(|()| PublishOutcome::Sent),
        };
        published.unwrap_or_else(|reason| {
            self.unsent.add(&reason);
            PublishOutcome::Sent
        })
    }

    /// Begins to wait until the readers have acknowledged what was published. Publish nothing until
    /// the wait is over.
    pub fn acknowledgements(&self) -> Acknowledgements {
        let progress = match &self.writer {
            Writer::Dds(writer) => Some((writer.publisher.guid(), ReaderProgress::new(now()))),
            #[cfg(feature = "zenoh")]
            Writer::Zenoh(_) => None,
        };
        Acknowledgements { progress }
    }
}

/// A wait for the acknowledgements of the readers of a topic.
pub struct Acknowledgements {
    /// `None`: there is nothing to wait for.
    progress: Option<(GUID, ReaderProgress<GUID>)>,
}

impl Acknowledgements {
    /// Whether some reader still has to acknowledge something, and has acknowledged something in
    /// the last two seconds.
    pub fn are_awaited(&mut self) -> bool {
        let Some((writer, progress)) = &mut self.progress else { return false };
        progress.update(unacknowledged(*writer), now());
        progress.is_awaited(now())
    }

    /// The number of readers that have not acknowledged everything.
    #[must_use]
    pub fn missing_readers(&self) -> usize {
        self.progress.as_ref().map_or(0, |(_, progress)| progress.behind().count())
    }
}

/// The number of samples that each reliable reader of a writer has not acknowledged. The published
/// DDS library does not say; then there are none.
fn unacknowledged(writer: GUID) -> BTreeMap<GUID, u64> {
    /// What the published library has: a glob import shadows it.
    #[allow(dead_code, reason = "the copy with the fixes has the function")]
    fn unacknowledged(_: GUID) -> BTreeMap<GUID, u64> {
        BTreeMap::new()
    }
    {
        #[allow(
            unused_imports,
            clippy::wildcard_imports,
            reason = "only the copy with the fixes has the function"
        )]
        use rustdds::*;
        unacknowledged(writer)
    }
}

/// What the readers of a topic have acknowledged since a moment after which nothing is published.
struct ReaderProgress<R> {
    begun: Instant,
    /// Samples that a reader lacks, and when it lacked more.
    readers: BTreeMap<R, (u64, Instant)>,
}

impl<R: Ord> ReaderProgress<R> {
    fn new(begun: Instant) -> Self {
        Self { begun, readers: BTreeMap::new() }
    }

    /// Takes note of what each reader lacks now.
    fn update(&mut self, missing: BTreeMap<R, u64>, now: Instant) {
        let mut before = std::mem::take(&mut self.readers);
        self.readers = missing
            .into_iter()
            .map(|(reader, missing)| {
                let since = match before.remove(&reader) {
                    Some((lacked, since)) if missing >= lacked => since,
                    Some(_) => now,
                    None => self.begun,
                };
                (reader, (missing, since))
            })
            .collect();
    }

    /// The readers that lack something, with the time of their last acknowledgement.
    fn behind(&self) -> impl Iterator<Item = Instant> {
        self.readers.values().filter(|(missing, _)| *missing > 0).map(|&(_, since)| since)
    }

    /// Whether a reader that lacks something has acknowledged something of late.
    fn is_awaited(&self, now: Instant) -> bool {
        self.behind().any(|since| now.duration_since(since) < READER_TIMEOUT)
    }
}

impl DdsWriter {
    fn new(
        participant: &rustdds::DomainParticipant,
        node: &mut ros2_client::Node,
        topic: &Topic,
    ) -> Result<Self, RosError> {
        let type_name = ros2_client::MessageTypeName::new(topic.message.package, topic.message.name);
        let failed = |source| endpoint_error(topic, source);
        let dds_topic = participant
            .create_topic(
                dds::topic_name(&topic.name),
                type_name.dds_msg_type(),
                &policies(topic),
                rustdds::TopicKind::NoKey,
            )
            .map_err(|source| failed(CreateError::from(source)))?;
        let publisher = node.create_publisher(&dds_topic, None).map_err(failed)?;
        Ok(DdsWriter { publisher, topic: dds_topic, progress: None, matched_at: None })
    }

    fn publish(&mut self, node: &mut ros2_client::Node, message: &Encoded) -> Result<PublishOutcome, String> {
        if self.matched_at.is_some_and(|matched_at| now() < matched_at) {
            return Ok(PublishOutcome::Retry);
        }
        self.matched_at = None;
        match self.publisher.publish(message.clone()) {
            Ok(()) => self.progress = None,
            Err(WriteError::WouldBlock { .. }) => {
                let progress = self.progress.get_or_insert_with(|| ReaderProgress::new(now()));
                progress.update(unacknowledged(self.publisher.guid()), now());
                let is_new = progress.begun.elapsed() < READER_TIMEOUT;
                return if is_new || progress.is_awaited(now()) { Ok(PublishOutcome::Retry) } else { self.renew(node) };
            }
            Err(other) => return Err(other.to_string()),
        }
        Ok(PublishOutcome::Sent)
    }

    /// Replaces the publisher, which abandons readers that acknowledge nothing.
    fn renew(&mut self, node: &mut ros2_client::Node) -> Result<PublishOutcome, String> {
        self.progress = None;
        self.matched_at = Some(now() + MATCHING_TIME);
        self.publisher = node.create_publisher(&self.topic, None).map_err(|error| error.to_string())?;
        Ok(PublishOutcome::Renewed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::topics;

    #[test]
    fn readers_are_awaited_as_long_as_they_acknowledge() {
        let begun = now();
        let at = |seconds: f64| begun + Duration::from_secs_f64(seconds);
        let mut progress = ReaderProgress::new(begun);
        let missing = |slow, dead| BTreeMap::from([("slow", slow), ("dead", dead)]);
        progress.update(missing(3, 1), at(0.1));
        assert!(progress.is_awaited(at(1.9)) && !progress.is_awaited(at(2.0)));
        progress.update(missing(2, 1), at(1.9));
        progress.update(missing(2, 1), at(3.8));
        assert!(progress.is_awaited(at(3.8)), "one of them");
        progress.update(missing(1, 1), at(3.8));
        progress.update(missing(0, 1), at(5.7));
        assert!(!progress.is_awaited(at(5.7)), "the other one is given up");
        assert_eq!(progress.behind().count(), 1);
        progress.update(BTreeMap::from([("slow", 0)]), at(5.8));
        assert_eq!(progress.behind().count(), 0, "a reader that has gone lacks nothing");
    }

    #[test]
    fn policies_add_a_window_to_the_topic() {
        for topic in topics::all(1) {
            let (plain, windowed) = (QosPolicies::from(qos_profile(&topic.qos)), policies(&topic));
            assert_eq!((windowed.durability(), windowed.history()), (plain.durability(), plain.history()), "{topic}");
            assert_eq!(windowed.is_reliable(), plain.is_reliable(), "{topic}");
            assert_eq!(windowed.resource_limits().map(|limits| limits.max_samples), Some(WINDOW), "{topic}");
            assert!(i32::try_from(topic.qos.depth).is_ok_and(|depth| depth <= WINDOW), "{topic}");
        }
    }
}
