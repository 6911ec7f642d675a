//! This process in a ROS network: its context, its nodes, and the factory of its endpoints. Each is
//! of the middleware that the environment names.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use msgs::message::Message;
use msgs::topics::Topic;
use rustdds::{DomainParticipant, StatusEvented};
use serde::Serialize;

use super::inbox::{self, Decoded, Inbox, Sample, SubscriptionId};
use super::ros_env::{DiscoveryRange, Middleware, RosEnv};
#[cfg(feature = "zenoh")]
use super::zenoh;
use super::{RosError, ThrottledWarning, dds};

/// Endpoints created without a pause. The middleware announces endpoints one by one from bounded
/// queues and never announces what does not fit.
const ENDPOINTS_PER_BATCH: usize = 32;

/// This process in a ROS network.
#[derive(Clone)]
pub struct Context {
    pub(super) network: Network,
    /// Events of discovery so far.
    events: Arc<AtomicU64>,
}

/// The network of a middleware.
#[derive(Clone)]
pub(super) enum Network {
    Dds(ros2_client::Context),
    #[cfg(feature = "zenoh")]
    Zenoh(zenoh::Session),
}

/// A node of this process.
pub struct Node {
    inner: NodeOf,
}

enum NodeOf {
    Dds(Box<ros2_client::Node>),
    #[cfg(feature = "zenoh")]
    Zenoh(zenoh::Node),
}

/// Joins the network that the environment names; the endpoints of the process come from the
/// factory.
///
/// Over DDS a process that `is_discovered_by_all` takes one of the first participant ids of its
/// machine, which every other process announces itself to. Under `LOCALHOST` the sockets of this
/// process reach the loopback device only.
///
/// # Errors
/// If discovery is off, this build does not have the middleware, or that fails to join.
pub fn join(env: &RosEnv, is_discovered_by_all: bool) -> Result<(Context, EndpointFactory), RosError> {
    if env.range == DiscoveryRange::Off {
        return Err(RosError::DiscoveryOff(env.clone()));
    }
    let (network, announcement_time) = match env.middleware {
        Middleware::Dds => {
            let (context, announcement_time) = dds::join(env, is_discovered_by_all)?;
            (Network::Dds(context), announcement_time)
        }
        #[cfg(feature = "zenoh")]
        Middleware::Zenoh => (Network::Zenoh(zenoh::Session::open(env)?), Duration::ZERO),
    };
    let context = Context { network, events: Arc::default() };
    Ok((context.clone(), EndpointFactory { made: 0, context, announcement_time }))
}

/// Creates a node without the client's parameter services and log; its log is
/// [`Rosout`](super::rosout::Rosout).
///
/// # Errors
/// If the middleware fails to create it.
pub fn node(context: &Context, name: &str) -> Result<Node, RosError> {
    let inner = match &context.network {
        Network::Dds(context) => NodeOf::Dds(Box::new(dds::node(context, name)?)),
        #[cfg(feature = "zenoh")]
        Network::Zenoh(session) => NodeOf::Zenoh(session.node(name)?),
    };
    Ok(Node { inner })
}

impl Context {
    /// The participants that publish a topic, as in [`Sample::source`].
    pub fn publishers(&self, topic: &Topic) -> Vec<[u8; 16]> {
        match &self.network {
            Network::Dds(context) => {
                let name = dds::topic_name(&topic.name);
                let writers = context.domain_participant().discovered_writers();
                let of_topic = writers.iter().filter(|writer| *writer.publication_topic_data.topic_name() == name);
                of_topic.map(|writer| inbox::participant_of(writer.publication_topic_data.key.to_bytes())).collect()
            }
            #[cfg(feature = "zenoh")]
            Network::Zenoh(session) => session.publishers(&topic.name),
        }
    }

    /// How many events of discovery there were; as long as it stays the same, so do the endpoints
    /// of others. `None`: the middleware does not say.
    pub(super) fn discovery_events(&self) -> Option<u64> {
        match &self.network {
            Network::Dds(context) => {
                let listener = context.domain_participant().status_listener();
                let new = std::iter::from_fn(|| listener.try_recv_status()).count() as u64;
                Some(self.events.fetch_add(new, Ordering::Relaxed) + new)
            }
            #[cfg(feature = "zenoh")]
            Network::Zenoh(_) => None,
        }
    }

    /// Whether others receive answers of services that take more than
    /// [`ANSWER_BYTES_MAX`](msgs::service::ANSWER_BYTES_MAX): over DDS, not without the fixes of
    /// the DDS library.
    pub fn sends_long_answers(&self) -> bool {
        match &self.network {
            Network::Dds(_) => dds::has_fixes(),
            #[cfg(feature = "zenoh")]
            Network::Zenoh(_) => true,
        }
    }

    /// The participant; only endpoints that are of DDS ask for it.
    pub(super) fn participant(&self) -> DomainParticipant {
        match &self.network {
            Network::Dds(context) => context.domain_participant(),
            #[cfg(feature = "zenoh")]
            Network::Zenoh(_) => unreachable!("{OF_ONE_NETWORK}"),
        }
    }
}

/// Why a match on the middleware of a node can leave out the others.
#[cfg(feature = "zenoh")]
const OF_ONE_NETWORK: &str = "all that a factory makes is of its own network";

impl Node {
    /// The node; only endpoints that are of DDS ask for it.
    pub(super) fn dds(&mut self) -> &mut ros2_client::Node {
        match &mut self.inner {
            NodeOf::Dds(node) => node,
            #[cfg(feature = "zenoh")]
            NodeOf::Zenoh(_) => unreachable!("{OF_ONE_NETWORK}"),
        }
    }

    /// The node; only endpoints that are of Zenoh ask for it.
    #[cfg(feature = "zenoh")]
    pub(super) fn zenoh(&mut self) -> &mut zenoh::Node {
        match &mut self.inner {
            NodeOf::Zenoh(node) => node,
            NodeOf::Dds(_) => unreachable!("{OF_ONE_NETWORK}"),
        }
    }
}

/// Creates the endpoints of a process, over DDS with a pause after every `ENDPOINTS_PER_BATCH`.
pub struct EndpointFactory {
    made: usize,
    pub(super) context: Context,
    announcement_time: Duration,
}

impl EndpointFactory {
    /// Creates a publisher of this topic.
    ///
    /// # Errors
    /// If the middleware fails to create it.
    pub fn publisher<M: Message + Clone>(&mut self, node: &mut Node, topic: &Topic) -> Result<Publisher<M>, RosError> {
        let writer = match &self.context.network {
            Network::Dds(_) => {
                self.pause();
                Writer::Dds(dds::Writer::new(node.dds(), topic)?)
            }
            #[cfg(feature = "zenoh")]
            Network::Zenoh(_) => Writer::Zenoh(node.zenoh().writer(topic)?),
        };
        Ok(Publisher { writer, unsent: ThrottledWarning::new(format!("{}: not sent", topic.name)) })
    }

    /// Adds a subscription of this topic to the inbox, which yields `convert(sample)`.
    ///
    /// # Errors
    /// If the middleware fails to create it.
    pub fn subscribe<M: Message + 'static, T>(
        &mut self,
        node: &mut Node,
        topic: &Topic,
        inbox: &mut Inbox<T>,
        convert: impl Fn(Sample<M>) -> T + 'static,
    ) -> Result<SubscriptionId, RosError> {
        Ok(match &self.context.network {
            Network::Dds(_) => {
                self.pause();
                let node = node.dds();
                let dds_topic = dds::dds_topic(node, topic)?;
                let subscription: ros2_client::Subscription<Decoded<M>> =
                    node.create_subscription(&dds_topic, None).map_err(|source| dds::endpoint_error(topic, source))?;
                inbox.add(Box::new(move |context| inbox::take(&subscription, context).map(&convert)))
            }
            #[cfg(feature = "zenoh")]
            Network::Zenoh(_) => {
                let subscription = node.zenoh().subscription(topic)?;
                inbox.add(Box::new(move |context| subscription.take(context).map(&convert)))
            }
        })
    }

    #[expect(clippy::disallowed_methods, reason = "no event marks that an endpoint was announced")]
    pub(super) fn pause(&mut self) {
        self.made += 1;
        if self.made.is_multiple_of(ENDPOINTS_PER_BATCH) {
            std::thread::sleep(self.announcement_time);
        }
    }
}

/// A publisher that never blocks.
pub struct Publisher<M: Serialize> {
    writer: Writer<M>,
    unsent: ThrottledWarning,
}

enum Writer<M: Serialize> {
    Dds(dds::Writer<M>),
    #[cfg(feature = "zenoh")]
    Zenoh(zenoh::Writer),
}

impl<M: Serialize + Clone> Publisher<M> {
    /// Publishes a message, or counts it as not sent.
    pub fn publish(&mut self, node: &mut Node, message: &M) {
        let published = match &mut self.writer {
            Writer::Dds(writer) => writer.publish(node.dds(), message),
            #[cfg(feature = "zenoh")]
            Writer::Zenoh(writer) => writer.publish(message),
        };
        if let Err(reason) = published {
            self.unsent.add(&reason);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joining_without_discovery_is_refused() {
        let env = RosEnv { domain_id: 3, range: DiscoveryRange::Off, ..RosEnv::default() };
        let error = join(&env, true).err().unwrap();
        assert!(error.to_string().starts_with("ROS domain 3, range OFF: "), "{error}");
    }
}
