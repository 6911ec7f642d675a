//! Publishers that wait for those who listen, but not for ever: for what is played, where a gap is worse than a delay.
//!
//! Invariants: at most [`WINDOW`] samples of a topic are under way; no call takes longer than [`BLOCKING`], and whoever calls can
//! do something else in between; a reader that acknowledges nothing for [`PATIENCE`] holds its topic up for that long in every
//! [`WINDOW`] samples, and no other topic. Readers that ask for best effort are not waited for.

use std::time::{Duration, Instant};

use ros2_client::{Context, CreateError, Node, WriteError};
use rustdds::{QosPolicies, QosPolicyBuilder, policy};

use super::audience::dds_name;
use super::{Outlet, RosError, Tally, Workshop, endpoint_error, now, qos_profile};
use msgs::cdr::Encoded;
use msgs::topics::{Reliability, Topic};

/// Samples of a topic that are under way at the most: several times what readers keep, and not so many that large ones fill the
/// memory or are lost by the thousand, for what is lost is repaired slowly.
const WINDOW: i32 = 1024;

/// Wall time that one call waits for room.
const BLOCKING: rustdds::Duration = rustdds::Duration::from_millis(20);

/// Wall time without room after which a reader is given up.
const PATIENCE: Duration = Duration::from_millis(500);

/// Wall time that the readers of a new publisher get to find it.
const FINDING: Duration = Duration::from_millis(100);

/// What became of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sent {
    /// It is under way.
    Yes,
    /// There is no room yet: it is to be published again.
    NotYet,
    /// There is a new publisher, which keeps nothing for late readers yet: it is to be published again.
    Anew,
}

/// A publisher of encoded messages that waits for its readers.
pub struct PatientOutlet {
    outlet: Outlet<Encoded>,
    full_since: Option<Instant>,
    /// Until when the readers of a new publisher look for it.
    found_at: Option<Instant>,
}

impl Workshop {
    /// A publisher of this topic that waits for its readers.
    ///
    /// # Errors
    /// If the middleware refuses it.
    pub fn patient_outlet(
        &mut self,
        context: &Context,
        node: &mut Node,
        topic: &Topic,
    ) -> Result<PatientOutlet, RosError> {
        self.pause();
        let type_name = ros2_client::MessageTypeName::new(topic.message.package, topic.message.name);
        let participant = context.domain_participant();
        let failed = |source| endpoint_error(topic, source);
        let dds_topic = participant
            .create_topic(dds_name(topic), type_name.dds_msg_type(), &policies(topic), rustdds::TopicKind::NoKey)
            .map_err(|source| failed(CreateError::from(source)))?;
        let publisher = node.create_publisher(&dds_topic, None).map_err(failed)?;
        let unsent = Tally::new(format!("{}: not sent", topic.name));
        let outlet = Outlet { publisher, topic: dds_topic, renewed: now(), unsent };
        Ok(PatientOutlet { outlet, full_since: None, found_at: None })
    }
}

/// Those of the topic, with a window.
fn policies(topic: &Topic) -> QosPolicies {
    let limits = policy::ResourceLimits { max_samples: WINDOW, max_instances: 1, max_samples_per_instance: WINDOW };
    let mut window = QosPolicyBuilder::new().resource_limits(limits);
    if topic.qos.reliability == Reliability::Reliable {
        window = window.reliability(policy::Reliability::Reliable { max_blocking_time: BLOCKING });
    }
    QosPolicies::from(qos_profile(&topic.qos)).modify_by(&window.build())
}

impl PatientOutlet {
    /// Publishes a message, if there is room. What the middleware refuses altogether is counted as not sent.
    pub fn publish(&mut self, node: &mut Node, message: &Encoded) -> Sent {
        if self.found_at.is_some_and(|found_at| now() < found_at) {
            return Sent::NotYet;
        }
        self.found_at = None;
        match self.outlet.publisher.publish(message.clone()) {
            Ok(()) => self.full_since = None,
            Err(WriteError::WouldBlock { .. }) => {
                let since = *self.full_since.get_or_insert_with(now);
                return if since.elapsed() < PATIENCE { Sent::NotYet } else { self.renew(node) };
            }
            Err(other) => self.outlet.unsent.add(&other),
        }
        Sent::Yes
    }

    /// Leaves behind those who do not acknowledge anything.
    fn renew(&mut self, node: &mut Node) -> Sent {
        self.full_since = None;
        self.found_at = Some(now() + FINDING);
        match node.create_publisher(&self.outlet.topic, None) {
            Ok(publisher) => {
                self.outlet.publisher = publisher;
                Sent::Anew
            }
            Err(error) => {
                self.outlet.unsent.add(&error);
                Sent::Yes
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::topics;

    #[test]
    fn the_policies_are_those_of_the_topic_with_a_window() {
        for topic in topics::all(1) {
            let (plain, patient) = (QosPolicies::from(qos_profile(&topic.qos)), policies(&topic));
            assert_eq!((patient.durability(), patient.history()), (plain.durability(), plain.history()), "{topic}");
            assert_eq!(patient.is_reliable(), plain.is_reliable(), "{topic}");
            assert_eq!(patient.resource_limits().map(|limits| limits.max_samples), Some(WINDOW), "{topic}");
            assert!(i32::try_from(topic.qos.depth).is_ok_and(|depth| depth <= WINDOW), "{topic}");
        }
    }
}
