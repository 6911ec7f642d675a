//! The ROS 2 client of both processes: one participant, publishers that never block, and an inbox
//! that multiplexes subscriptions and services.
//!
//! The transports of `sim_server` and `agent_node` build on this crate; those files and this crate
//! are the only ones that name the ROS client.
//!
//! Invariants: publishing returns at once, whatever readers do: a message that cannot be sent is
//! counted, reported and dropped, because the protocol resends. A dead reader blocks its own topic
//! for at most `RENEWAL_PERIOD`.
//!
//! The client's background task ("spinner") is never started, because it would subscribe `/clock`
//! under a second type. This crate therefore answers the parameter services itself, and the
//! simulation protocol alone tells which processes have joined.

mod action;
mod blocking_publisher;
mod discovery;
mod inbox;
mod loopback;
mod parameters;
mod services;
mod static_peers;
mod subscription_tracker;
mod type_hash;

pub mod join_secret;
pub mod process_guard;
pub mod ros_env;
pub mod rosout;
pub mod suspension;

use std::fmt;
use std::net::{Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

use crate::ros_env::{DiscoveryRange, RosEnv};
use msgs::message::Message;
use msgs::printable;
use msgs::topics::{self, Durability, Reliability};
use ros2_client::qos::{self, QosProfile, WhenFull};
use ros2_client::{
    Context, CreateError, MessageTypeName, Name, Node, NodeCreateError, NodeName, NodeOptions, Subscription, WriteError,
};
use rustdds::{DomainParticipant, DomainParticipantBuilder};
use serde::Serialize;
use thiserror::Error;

pub use action::{Goal, StepsEvent};
pub use blocking_publisher::{BlockingPublisher, PublishOutcome};
use inbox::{Decoded, take};
pub use inbox::{Inbox, Sample, own_source, source_of};
pub use parameters::Shared as SharedParameters;
pub use subscription_tracker::{SubscriptionTracker, dds_topic_name};

/// Participant ids of a machine that every new participant announces itself to: loopback has no
/// multicast, so the middleware sends to the ports of the first twelve ids
/// (`SPDP_LOCALHOST_PEER_COUNT`). Participants with higher ids learn of each other only through
/// these, or not at all.
const DISCOVERABLE_IDS: u16 = 12;

/// How many of these ids agents leave free, for processes that all others must discover: the server
/// and tools. So agents, which need the server and not each other, do not hear of each other: a
/// team of N exchanges N introductions, and not N times 12.
const RESERVED_IDS: u16 = DISCOVERABLE_IDS;

/// The same with the published DDS library, where an agent occupies these ids while it joins, and a
/// tool that joins just then gets none of them.
const RESERVED_IDS_PUBLISHED: u16 = 2;

/// Minimum wall time between two replacements of a publisher whose window is full.
const RENEWAL_PERIOD: Duration = Duration::from_secs(1);

/// Minimum wall time between two warnings about one subject.
const REPORT_PERIOD: Duration = Duration::from_secs(5);

/// Endpoints created without a pause. The middleware announces endpoints one by one from bounded
/// queues and never announces what does not fit.
const ENDPOINTS_PER_BATCH: usize = 32;

/// Wall time to announce one batch of endpoints, several times what the middleware needs.
const ANNOUNCEMENT_TIME: Duration = Duration::from_millis(10);

/// The same with participants of another middleware: what their sockets lose on a busy machine is
/// sent again before the next announcements, which otherwise arrive out of order (`discovery`).
const ANNOUNCEMENT_TIME_FOREIGN: Duration = Duration::from_millis(100);

/// Wall time for such participants to receive the first announcement, which is of the topic that
/// names the nodes of this process.
const NODES_TOPIC_TIME_FOREIGN: Duration = Duration::from_millis(250);

/// Wall time for messages in flight at the end: several repair rounds of 10 ms.
const LINGER: Duration = Duration::from_millis(200);

/// The same with observers: their nodes have more in flight and may read more slowly.
const LINGER_OBSERVED: Duration = Duration::from_secs(1);

/// Why this process cannot join a ROS network.
#[derive(Debug, Error)]
pub enum RosError {
    /// `ROS_AUTOMATIC_DISCOVERY_RANGE` is OFF.
    #[error("{0}: no process can be found without discovery; set ROS_AUTOMATIC_DISCOVERY_RANGE to LOCALHOST or SUBNET")]
    DiscoveryOff(RosEnv),
    /// A name in `ROS_STATIC_PEERS` has no address.
    #[error(
        "ROS_STATIC_PEERS: {peer}: {reason}; expected names or IPv4 addresses of machines, separated by semicolons"
    )]
    StaticPeer { peer: String, reason: String },
    /// The middleware failed to create a participant.
    #[error("joining {env}: {source} (a machine has room for 120 processes in a domain)")]
    Participant { env: RosEnv, source: CreateError },
    /// The middleware failed to create a node.
    #[error("making the ROS node {name}: {source}")]
    Node { name: String, source: NodeCreateError },
    /// The middleware failed to create an endpoint.
    #[error("making an endpoint of {topic}: {source}")]
    Endpoint {
        /// Topic or service, with its type.
        topic: String,
        source: CreateError,
    },
    /// The limit of open files is too low.
    #[error("this many agents need {wanted} open files, but the limit is {allowed}; raise it with `ulimit -n`")]
    OpenFiles { wanted: u64, allowed: u64 },
}

/// Open files of a process with a participant, with a margin.
const FILES: u64 = 256;

/// Open files per agent: four for each of two subscriptions, two for each of four publishers.
const FILES_PER_AGENT: u64 = 16;

/// Open files of the publishers of an agent that is being replaced, and for how many agents at a
/// time there are some.
const FILES_PER_REPLACED: u64 = 8;
const REPLACED_MAX: u32 = 100;

/// Open files that the endpoints of this many agents need.
fn open_files(agents: u32) -> u64 {
    FILES + FILES_PER_AGENT * u64::from(agents) + FILES_PER_REPLACED * u64::from(agents.min(REPLACED_MAX))
}

/// Raises this process's limit of open files to what the endpoints of this many agents need.
///
/// # Errors
/// If the system does not allow it.
pub fn allow_open_files(agents: u32) -> Result<(), RosError> {
    let wanted = open_files(agents);
    match rlimit::increase_nofile_limit(wanted) {
        Ok(allowed) if allowed < wanted => Err(RosError::OpenFiles { wanted, allowed }),
        // A system that does not report its limit fails when it is reached.
        Ok(_) | Err(_) => Ok(()),
    }
}

/// Joins the network that the environment names; the endpoints of the process come from the
/// factory.
///
/// A process that `is_discovered_by_all` takes one of the first participant ids of its machine,
/// which every other process announces itself to; other processes leave `RESERVED_IDS` of them
/// free. Under `LOCALHOST` the sockets of this process reach the loopback device only.
///
/// # Errors
/// If discovery is off or the middleware fails to create a participant.
#[expect(clippy::disallowed_methods, reason = "no event marks that an endpoint was announced")]
pub fn join(env: &RosEnv, is_discovered_by_all: bool) -> Result<(Context, EndpointFactory), RosError> {
    let peers = static_peers::destinations(env)?;
    type_hash::announce();
    let participant = |first_id| {
        let builder = static_peers::announce_to(DomainParticipantBuilder::new(env.domain_id), &peers);
        let builder = first_participant_id(builder, first_id);
        match env.range {
            DiscoveryRange::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
            DiscoveryRange::Off | DiscoveryRange::Subnet | DiscoveryRange::SystemDefault => builder,
        }
        .build()
    };
    if env.range == DiscoveryRange::Off {
        return Err(RosError::DiscoveryOff(env.clone()));
    }
    let joined = if is_discovered_by_all {
        participant(0)
    } else if has_dds_fixes() {
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
        eprintln!("{env}: packets of other machines are not kept away, which takes Linux 5.7 or later: {error}");
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
        eprintln!(
            "{env}: {number} participants joined before this one, and not all of them may discover it; start it before \
             them, or set another ROS_DOMAIN_ID"
        );
    }
    let participant = context.domain_participant();
    Ok((context, EndpointFactory { made: 0, participant, announcement_time }))
}

/// Lets the search for a free participant id begin at this one, which the DDS library can with the
/// fixes of `contrib/rustdds` only.
fn first_participant_id(builder: DomainParticipantBuilder, id: u16) -> DomainParticipantBuilder {
    /// What the published library does, which has no such method: a method of the type itself comes
    /// before one of a trait.
    trait WithoutFirstId: Sized {
        #[allow(dead_code, reason = "the copy with the fixes has the method")]
        fn first_participant_id(self, _id: u16) -> Self {
            self
        }
    }
    impl WithoutFirstId for DomainParticipantBuilder {}
    builder.first_participant_id(id)
}

/// UDP port of a participant's unicast discovery traffic (RTPS 2.5, section 9.6.2.3).
fn discovery_port(domain_id: u16, participant_id: u16) -> u16 {
    7400 + 250 * domain_id + 10 + 2 * participant_id
}

/// Creates a node without the client's parameter services and log; its log is [`rosout::Rosout`].
///
/// # Errors
/// If the middleware fails to create it.
pub fn node(context: &Context, name: &str) -> Result<Node, RosError> {
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    NodeName::new("/", name)
        .map_err(|error| NodeCreateError::BadParameter(error.to_string()))
        .and_then(|node_name| context.new_node(node_name, options))
        .map_err(|source| RosError::Node { name: name.to_owned(), source })
}

/// Creates the endpoints of a process, with a pause after every `ENDPOINTS_PER_BATCH`.
pub struct EndpointFactory {
    made: usize,
    participant: DomainParticipant,
    announcement_time: Duration,
}

impl EndpointFactory {
    /// Creates a publisher of this topic.
    ///
    /// # Errors
    /// If the middleware fails to create it.
    pub fn publisher<M: Message + Clone>(
        &mut self,
        node: &mut Node,
        topic: &topics::Topic,
    ) -> Result<Publisher<M>, RosError> {
        self.pause();
        let dds_topic = dds_topic(node, topic)?;
        let publisher = node.create_publisher(&dds_topic, None).map_err(|source| endpoint_error(topic, source))?;
        let unsent = ThrottledWarning::new(format!("{}: not sent", topic.name));
        Ok(Publisher { publisher, topic: dds_topic, renewed: now(), unsent })
    }

    /// Adds a subscription of this topic to the inbox, which yields `convert(sample)`.
    ///
    /// # Errors
    /// If the middleware fails to create it.
    pub fn subscribe<M: Message + 'static, T>(
        &mut self,
        node: &mut Node,
        topic: &topics::Topic,
        inbox: &mut Inbox<T>,
        convert: impl Fn(Sample<M>) -> T + 'static,
    ) -> Result<(), RosError> {
        self.pause();
        let dds_topic = dds_topic(node, topic)?;
        let subscription: Subscription<Decoded<M>> =
            node.create_subscription(&dds_topic, None).map_err(|source| endpoint_error(topic, source))?;
        inbox.add(Box::new(move |context| take(&subscription, context).map(&convert)));
        Ok(())
    }

    #[expect(clippy::disallowed_methods, reason = "no event marks that an endpoint was announced")]
    fn pause(&mut self) {
        self.made += 1;
        if self.made.is_multiple_of(ENDPOINTS_PER_BATCH) {
            std::thread::sleep(self.announcement_time);
        }
    }
}

fn dds_topic(node: &Node, topic: &topics::Topic) -> Result<rustdds::Topic, RosError> {
    let name = Name::parse(&topic.name)
        .map_err(|error| endpoint_error(topic, CreateError::BadParameter { reason: error.to_string() }))?;
    let type_name = MessageTypeName::new(topic.message.package, topic.message.name);
    node.create_topic(&name, type_name, &qos_profile(&topic.qos)).map_err(|source| endpoint_error(topic, source))
}

fn endpoint_error(topic: &topics::Topic, source: CreateError) -> RosError {
    RosError::Endpoint { topic: topic.to_string(), source }
}

fn qos_profile(qos: &topics::Qos) -> QosProfile {
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
pub struct Publisher<M: Serialize> {
    publisher: ros2_client::Publisher<M>,
    topic: rustdds::Topic,
    renewed: Instant,
    unsent: ThrottledWarning,
}

impl<M: Serialize + Clone> Publisher<M> {
    /// Publishes a message, or counts it as not sent.
    pub fn publish(&mut self, node: &mut Node, message: &M) {
        let Err(error) = self.publisher.publish(message.clone()) else { return };
        let error = match error {
            WriteError::WouldBlock { data } if self.renewed.elapsed() >= RENEWAL_PERIOD => {
                match self.renew_and_publish(node, data) {
                    Ok(()) => return,
                    Err(error) => error,
                }
            }
            WriteError::WouldBlock { .. } => "a reader acknowledges nothing".to_owned(),
            other => other.to_string(),
        };
        self.unsent.add(&error);
    }

    fn renew_and_publish(&mut self, node: &mut Node, message: M) -> Result<(), String> {
        self.renewed = now();
        self.publisher = node.create_publisher(&self.topic, None).map_err(|error| error.to_string())?;
        self.publisher.publish(message).map_err(|error| error.to_string())
    }
}

/// A warning on stderr that counts its occurrences and is printed at most every `REPORT_PERIOD`.
pub struct ThrottledWarning {
    subject: String,
    count: u64,
    reported: Option<Instant>,
}

impl ThrottledWarning {
    /// `subject` opens the printed line.
    pub fn new(subject: String) -> Self {
        ThrottledWarning { subject, count: 0, reported: None }
    }

    /// Counts one occurrence; prints if it is time to.
    pub fn add(&mut self, reason: &dyn fmt::Display) {
        self.count += 1;
        if self.reported.is_none_or(|reported| reported.elapsed() >= REPORT_PERIOD) {
            self.reported = Some(now());
            let line = format!("{} ({} so far): {reason}", self.subject, self.count);
            eprintln!("{}", printable::line(&line));
        }
    }
}

/// Waits for messages in flight, longer if there are observers. Call it before endpoints are
/// dropped: samples of a dropped endpoint are not repaired.
#[expect(clippy::disallowed_methods, reason = "the ROS client does not report acknowledgements")]
pub fn linger(has_observers: bool) {
    std::thread::sleep(if has_observers { LINGER_OBSERVED } else { LINGER });
}

#[expect(clippy::disallowed_methods, reason = "time-outs and reports are of wall time; no result depends on it")]
pub fn now() -> Instant {
    Instant::now()
}

/// Whether this build has the fixes of `contrib/rustdds` in the DDS library.
pub fn has_dds_fixes() -> bool {
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
        let env = RosEnv { domain_id: 29, range: DiscoveryRange::Localhost, static_peers: Vec::new() };
        let joined = |is_discovered_by_all| join(&env, is_discovered_by_all).unwrap();
        let id = |(context, _): &(Context, EndpointFactory)| context.domain_participant().participant_id();
        let agents = [joined(false), joined(false)];
        let server = joined(true);
        assert!(id(&server) < DISCOVERABLE_IDS);
        let least = if has_dds_fixes() { RESERVED_IDS } else { RESERVED_IDS_PUBLISHED };
        assert!(agents.iter().all(|agent| id(agent) >= least));
    }

    #[test]
    fn joining_without_discovery_is_refused() {
        let env = RosEnv { domain_id: 3, range: DiscoveryRange::Off, static_peers: Vec::new() };
        let error = join(&env, true).err().unwrap();
        assert!(error.to_string().starts_with("ROS domain 3, range OFF: "), "{error}");
    }
}
