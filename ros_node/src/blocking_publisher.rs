//! Publishers with back-pressure: they wait a bounded time for their readers. Replays use them,
//! because a gap in a replay is worse than a delay.
//!
//! Invariants: at most [`WINDOW`] samples of a topic are in flight; no call blocks longer than
//! [`BLOCKING`], and the caller can do other work in between; a reader that acknowledges nothing
//! for [`READER_TIMEOUT`] delays its own topic by that much per [`WINDOW`] samples, and no other
//! topic. Best-effort readers are not waited for.

use std::time::{Duration, Instant};

use ros2_client::{Context, CreateError, Node, WriteError};
use rustdds::{QosPolicies, QosPolicyBuilder, policy};

use super::dds_topic_name;
use super::{EndpointFactory, Publisher, RosError, ThrottledWarning, endpoint_error, now, qos_profile};
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
    publisher: Publisher<Encoded>,
    full_since: Option<Instant>,
    /// Set after a replacement, until its readers have had time to match it.
    matched_at: Option<Instant>,
}

impl EndpointFactory {
    /// Creates a publisher of this topic that waits for its readers.
    ///
    /// # Errors
    /// If the middleware refuses it.
    pub fn blocking_publisher(
        &mut self,
        context: &Context,
        node: &mut Node,
        topic: &Topic,
    ) -> Result<BlockingPublisher, RosError> {
        self.pause();
        let type_name = ros2_client::MessageTypeName::new(topic.message.package, topic.message.name);
        let participant = context.domain_participant();
        let failed = |source| endpoint_error(topic, source);
        let dds_topic = participant
            .create_topic(dds_topic_name(topic), type_name.dds_msg_type(), &policies(topic), rustdds::TopicKind::NoKey)
            .map_err(|source| failed(CreateError::from(source)))?;
        let publisher = node.create_publisher(&dds_topic, None).map_err(failed)?;
        let unsent = ThrottledWarning::new(format!("{}: not sent", topic.name));
        let publisher = Publisher { publisher, topic: dds_topic, renewed: now(), unsent };
        Ok(BlockingPublisher { publisher, full_since: None, matched_at: None })
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
        if self.matched_at.is_some_and(|matched_at| now() < matched_at) {
            return PublishOutcome::Retry;
        }
        self.matched_at = None;
        match self.publisher.publisher.publish(message.clone()) {
            Ok(()) => self.full_since = None,
            Err(WriteError::WouldBlock { .. }) => {
                let since = *self.full_since.get_or_insert_with(now);
                return if since.elapsed() < READER_TIMEOUT { PublishOutcome::Retry } else { self.renew(node) };
            }
            Err(other) => self.publisher.unsent.add(&other),
        }
        PublishOutcome::Sent
    }

    /// Replaces the publisher, which abandons readers that acknowledge nothing.
    fn renew(&mut self, node: &mut Node) -> PublishOutcome {
        self.full_since = None;
        self.matched_at = Some(now() + MATCHING_TIME);
        match node.create_publisher(&self.publisher.topic, None) {
            Ok(publisher) => {
                self.publisher.publisher = publisher;
                PublishOutcome::Renewed
            }
            Err(error) => {
                self.publisher.unsent.add(&error);
                PublishOutcome::Sent
            }
        }
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
