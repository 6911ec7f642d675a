//! Publishers with back-pressure: they wait a bounded time for their readers. Replays use them,
//! because a gap in a replay is worse than a delay.
//!
//! Invariants: at most [`WINDOW`] samples of a topic are in flight; no call blocks longer than
//! [`BLOCKING`], and the caller can do other work in between; a reader that acknowledges nothing
//! for [`READER_TIMEOUT`] delays its own topic by that much per [`WINDOW`] samples, and no other
//! topic. Best-effort readers are not waited for.
//!
//! Over Zenoh the connection to each process has a window instead, and a call waits for room in it
//! until Zenoh closes the connection to a process that takes nothing.

use std::time::{Duration, Instant};

use ros2_client::{CreateError, WriteError};
use rustdds::{QosPolicies, QosPolicyBuilder, policy};

use super::dds::{self, endpoint_error, qos_profile};
use super::network::Network;
#[cfg(feature = "zenoh")]
use super::zenoh;
use super::{EndpointFactory, Node, RosError, ThrottledWarning, now};
use msgs::cdr::Encoded;
use msgs::topics::{Reliability, Topic};

/// Maximum samples of a topic in flight: several times what readers keep, but few enough that large
/// samples do not fill memory or need thousands of repairs, which are slow.
const WINDOW: i32 = 1024;

/// Maximum wall time that one call waits for room in the window.
const BLOCKING: rustdds::Duration = rustdds::Duration::from_millis(20);

/// Wall time with a full window after which the unresponsive readers are abandoned.
const READER_TIMEOUT: Duration = Duration::from_millis(500);

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
    full_since: Option<Instant>,
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
        Ok(DdsWriter { publisher, topic: dds_topic, full_since: None, matched_at: None })
    }

    fn publish(&mut self, node: &mut ros2_client::Node, message: &Encoded) -> Result<PublishOutcome, String> {
        if self.matched_at.is_some_and(|matched_at| now() < matched_at) {
            return Ok(PublishOutcome::Retry);
        }
        self.matched_at = None;
        match self.publisher.publish(message.clone()) {
            Ok(()) => self.full_since = None,
            Err(WriteError::WouldBlock { .. }) => {
                let since = *self.full_since.get_or_insert_with(now);
                return if since.elapsed() < READER_TIMEOUT { Ok(PublishOutcome::Retry) } else { self.renew(node) };
            }
            Err(other) => return Err(other.to_string()),
        }
        Ok(PublishOutcome::Sent)
    }

    /// Replaces the publisher, which abandons readers that acknowledge nothing.
    fn renew(&mut self, node: &mut ros2_client::Node) -> Result<PublishOutcome, String> {
        self.full_since = None;
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
