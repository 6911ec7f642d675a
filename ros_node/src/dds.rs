//! The participant of this process in a DDS network, and its publishers.
//!
//! Invariant: publishing returns at once, whatever readers do. A dead reader blocks its own topic
//! for at most [`RENEWAL_PERIOD`].
//!
//! The client's background task ("spinner") is never started, because it would subscribe `/clock`
//! under a second type.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use msgs::topics::{self, Durability, Reliability};
use ros2_client::qos::{self, QosProfile, WhenFull};
use ros2_client::{
    Context, CreateError, MessageTypeName, Name, Node, NodeCreateError, NodeName, NodeOptions, WriteError,
};
use rustdds::DomainParticipantBuilder;
use serde::Serialize;

use super::ros_env::{DiscoveryRange, RosEnv};
use super::{RosError, discovery, loopback, static_peers, type_hash};
use system::wall_clock::now;

/// Wall time between two announcements of this participant. Others list a process that was killed
/// for five times as long; with the published DDS library, which announces every 10 s, for 50 s.
const PRESENCE_PERIOD: Duration = Duration::from_secs(2);

/// Participant ids of a machine that every new participant announces itself to: loopback has no
/// multicast, so the middleware sends to the ports of the first twelve ids
/// (`SPDP_LOCALHOST_PEER_COUNT`). Participants with higher ids learn of each other only through
/// these, or not at all.
pub(super) const DISCOVERABLE_IDS: u16 = 12;

/// How many of these ids agents leave free, for processes that all others must discover: the server
/// and tools. So agents, which need the server and not each other, do not hear of each other: a
/// team of N exchanges N introductions, and not N times 12.
const RESERVED_IDS: u16 = DISCOVERABLE_IDS;

/// The same with the published DDS library, where an agent occupies these ids while it joins, and a
/// tool that joins just then gets none of them.
const RESERVED_IDS_PUBLISHED: u16 = 2;

/// Minimum wall time between two replacements of a publisher whose window is full.
const RENEWAL_PERIOD: Duration = Duration::from_secs(1);

/// Wall time to announce one batch of endpoints, several times what the middleware needs.
const ANNOUNCEMENT_TIME: Duration = Duration::from_millis(10);

/// The same with participants of another middleware: what their sockets lose on a busy machine is
/// sent again before the next announcements, which otherwise arrive out of order (`discovery`).
const ANNOUNCEMENT_TIME_FOREIGN: Duration = Duration::from_millis(100);

/// Wall time for such participants to receive the first announcement, which is of the topic that
/// names the nodes of this process.
const NODES_TOPIC_TIME_FOREIGN: Duration = Duration::from_millis(250);

/// Joins the network that the environment names, whose discovery is not off, and says how long to
/// wait after each batch of endpoints.
///
/// A process that `is_discovered_by_all` takes one of the first participant ids of its machine,
/// which every other process announces itself to; other processes leave `RESERVED_IDS` of them
/// free. Under `LOCALHOST` the sockets of this process reach the loopback device only.
///
/// # Errors
/// If a static peer has no address, or the middleware fails to create a participant.
#[expect(clippy::disallowed_methods, reason = "no event marks that an endpoint was announced")]
pub(super) fn join(env: &RosEnv, is_discovered_by_all: bool) -> Result<(Context, Duration), RosError> {
    let peers = static_peers::destinations(env)?;
    type_hash::announce();
    let participant = |first_id| {
        let builder = with_fixes(DomainParticipantBuilder::new(env.domain_id), first_id, peers.clone());
        match env.range {
            DiscoveryRange::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
            DiscoveryRange::Off | DiscoveryRange::Subnet | DiscoveryRange::SystemDefault => builder,
        }
        .build()
    };
    let joined = if is_discovered_by_all {
        participant(0)
    } else if has_fixes() {
        participant(RESERVED_IDS).or_else(|_| participant(0))
    } else {
        // The middleware takes the first id whose port is free.
        let taken: Vec<UdpSocket> = (0..RESERVED_IDS_PUBLISHED)
            .filter_map(|id| UdpSocket::bind((Ipv4Addr::UNSPECIFIED, discovery_port(env.domain_id, id))).ok())
            .collect();
        let joined = participant(0);
        drop(taken);
        joined.or_else(|_| participant(0))
    };
    if env.range == DiscoveryRange::Localhost
        && let Err(error) = loopback::confine_sockets()
    {
        tracing::warn!("{env}: packets of other machines are not kept away, which takes Linux 5.7 or later: {error}");
    }
    let mut announcement_time = ANNOUNCEMENT_TIME;
    let context = joined
        .map_err(CreateError::from)
        .inspect(|participant| {
            if discovery::wait_for_discovery(participant) {
                announcement_time = ANNOUNCEMENT_TIME_FOREIGN;
            }
        })
        .and_then(Context::from_domain_participant)
        .map_err(|source| RosError::Participant { env: env.clone(), source })?;
    if announcement_time == ANNOUNCEMENT_TIME_FOREIGN {
        std::thread::sleep(NODES_TOPIC_TIME_FOREIGN);
    }
    let number = context.domain_participant().participant_id();
    if is_discovered_by_all && number >= DISCOVERABLE_IDS {
        tracing::warn!(
            "{env}: {number} participants joined before this one, and not all of them may discover it; start it before \
             them, or set another ROS_DOMAIN_ID"
        );
    }
    Ok((context, announcement_time))
}

/// Sets what the DDS library takes with the fixes of `contrib/rustdds` only: at which participant
/// id the search for a free one begins, the destinations of announcements beyond those of the
/// range, and the wall time between two announcements.
fn with_fixes(builder: DomainParticipantBuilder, first_id: u16, peers: Vec<SocketAddr>) -> DomainParticipantBuilder {
    /// What the published library does, which has no such methods: a method of the type itself
    /// comes before one of a trait.
    #[allow(dead_code, reason = "the copy with the fixes has the methods")]
    trait WithoutFixes: Sized {
        fn first_participant_id(self, _id: u16) -> Self {
            self
        }
        fn static_peers(self, _peers: Vec<SocketAddr>) -> Self {
            self
        }
        fn announcement_period(self, _period: Duration) -> Self {
            self
        }
    }
    impl WithoutFixes for DomainParticipantBuilder {}
    builder.first_participant_id(first_id).static_peers(peers).announcement_period(PRESENCE_PERIOD)
}

/// UDP port of a participant's unicast discovery traffic (RTPS 2.5, section 9.6.2.3).
pub(super) fn discovery_port(domain_id: u16, participant_id: u16) -> u16 {
    7400 + 250 * domain_id + 10 + 2 * participant_id
}

/// Creates a node, see [`super::node`].
///
/// # Errors
/// If the middleware fails to create it.
pub(super) fn node(context: &Context, name: &str) -> Result<Node, RosError> {
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    NodeName::new("/", name)
        .map_err(|error| NodeCreateError::BadParameter(error.to_string()))
        .and_then(|node_name| context.new_node(node_name, options))
        .map_err(|source| RosError::Node { name: name.to_owned(), source })
}

pub(super) fn dds_topic(node: &Node, topic: &topics::Topic) -> Result<rustdds::Topic, RosError> {
    let name = Name::parse(&topic.name)
        .map_err(|error| endpoint_error(topic, CreateError::BadParameter { reason: error.to_string() }))?;
    let type_name = MessageTypeName::new(topic.message.package, topic.message.name);
    node.create_topic(&name, type_name, &qos_profile(&topic.qos)).map_err(|source| endpoint_error(topic, source))
}

/// What the name of a ROS topic has before it in DDS.
const TOPIC_PREFIX: &str = "rt";

/// The DDS name of a ROS topic.
pub(super) fn topic_name(topic: &str) -> String {
    format!("{TOPIC_PREFIX}{topic}")
}

/// The ROS topic of a DDS name, if it is one.
pub(super) fn ros_topic(dds_name: &str) -> Option<&str> {
    dds_name.strip_prefix(TOPIC_PREFIX)
}

pub(super) fn endpoint_error(topic: &topics::Topic, source: CreateError) -> RosError {
    RosError::Endpoint { topic: topic.to_string(), source }
}

pub(super) fn qos_profile(qos: &topics::Qos) -> QosProfile {
    QosProfile::publisher_default()
        .reliability(match qos.reliability {
            Reliability::Reliable => qos::Reliability::Reliable { when_full: WhenFull::Fail },
            Reliability::BestEffort => qos::Reliability::BestEffort,
        })
        .durability(match qos.durability {
            Durability::TransientLocal => qos::Durability::TransientLocal,
            Durability::Volatile => qos::Durability::Volatile,
        })
        .history(qos::History::KeepLast { depth: qos.depth as usize })
}

/// A publisher that never blocks.
///
/// The middleware keeps a sample until every reliable reader has acknowledged it, and refuses new
/// samples at 8192. A killed or stopped reader acknowledges nothing but counts as alive for up to
/// 50 s. A publisher that is refused is therefore replaced by a new one with its own window, which
/// live readers match within milliseconds.
pub(super) struct Writer<M: Serialize> {
    publisher: ros2_client::Publisher<M>,
    topic: rustdds::Topic,
    renewed: Instant,
}

impl<M: Serialize + Clone> Writer<M> {
    pub(super) fn new(node: &mut Node, topic: &topics::Topic) -> Result<Self, RosError> {
        let dds_topic = dds_topic(node, topic)?;
        let publisher = node.create_publisher(&dds_topic, None).map_err(|source| endpoint_error(topic, source))?;
        Ok(Writer { publisher, topic: dds_topic, renewed: now() })
    }

    /// Publishes a message, or says why that is not possible.
    pub(super) fn publish(&mut self, node: &mut Node, message: &M) -> Result<(), String> {
        match self.publisher.publish(message.clone()) {
            Ok(()) => Ok(()),
            Err(WriteError::WouldBlock { data }) if self.renewed.elapsed() >= RENEWAL_PERIOD => {
                self.renew_and_publish(node, data)
            }
            Err(WriteError::WouldBlock { .. }) => Err("a reader acknowledges nothing".to_owned()),
            Err(other) => Err(other.to_string()),
        }
    }

    fn renew_and_publish(&mut self, node: &mut Node, message: M) -> Result<(), String> {
        self.renewed = now();
        self.publisher = node.create_publisher(&self.topic, None).map_err(|error| error.to_string())?;
        self.publisher.publish(message).map_err(|error| error.to_string())
    }
}

/// Whether this build has the fixes of `contrib/rustdds` in the DDS library.
pub fn has_fixes() -> bool {
    /// What the published library says, which has no constant of this name: a glob import shadows
    /// it.
    #[allow(dead_code, reason = "the copy with the fixes has the constant")]
    const MAES_FIXES: bool = false;
    {
        #[allow(
            unused_imports,
            clippy::wildcard_imports,
            reason = "only the copy with the fixes has the constant"
        )]
        use rustdds::*;
        MAES_FIXES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discovery_ports_follow_rtps() {
        assert_eq!(discovery_port(0, 0), 7410);
        assert_eq!(discovery_port(232, RESERVED_IDS_PUBLISHED), 65414);
    }

    #[test]
    fn agents_leave_the_first_ids_to_those_that_all_discover() {
        let env = RosEnv { domain_id: 29, ..RosEnv::default() };
        let joined = |is_discovered_by_all| join(&env, is_discovered_by_all).unwrap();
        let id = |(context, _): &(Context, Duration)| context.domain_participant().participant_id();
        let agents = [joined(false), joined(false)];
        let server = joined(true);
        assert!(id(&server) < DISCOVERABLE_IDS);
        let least = if has_fixes() { RESERVED_IDS } else { RESERVED_IDS_PUBLISHED };
        assert!(agents.iter().all(|agent| id(agent) >= least));
    }
}
