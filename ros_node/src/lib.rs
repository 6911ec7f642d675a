//! The ROS client as the links use it: one participant, publishers that never wait, subscriptions that are waited for together.
//!
//! Behind the feature `ros`: what the links of `sim_server` and `agent_node` have in common. Those and this one, with the folders
//! beside them, are the only ones that know the ROS client.
//!
//! Invariants: publishing returns at once, whatever readers do: a message that cannot be sent is counted, told about and
//! dropped, for the protocol sends again; a reader that has died holds up its own topic for `RENEWAL_PERIOD` at the most.
//!
//! Not done here: the client's own background task ("spinner") is never started, because it would subscribe `/clock` under a
//! second type; so the services of parameters are our own, and who is there is known from the protocol alone.

mod action;
mod inbox;
mod meeting;
mod parameters;
mod patient;
mod services;

pub mod audience;
pub mod ros_env;
pub mod rosout;
pub mod stopped;

use std::fmt;
use std::net::{Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

use crate::ros_env::{DiscoveryRange, RosEnv};
use msgs::message::Message;
use msgs::topics::{self, Durability, Reliability};
use ros2_client::qos::{self, QosProfile, WhenFull};
use ros2_client::{
    Context, CreateError, MessageTypeName, Name, Node, NodeCreateError, NodeName, NodeOptions, Publisher, Subscription,
    WriteError,
};
use rustdds::{DomainParticipant, DomainParticipantBuilder};
use serde::Serialize;
use thiserror::Error;

pub use action::{Goal, StepsEvent};
use inbox::{Decoded, take};
pub use inbox::{Inbox, Sample, own_source, source_of};
pub use parameters::Shared as SharedParameters;
pub use patient::{PatientOutlet, Sent};

/// Participants of a machine that are told of every other one at its start: besides multicast, which loopback does not have,
/// the middleware sends to the ports of the first twelve (`SPDP_LOCALHOST_PEER_COUNT`). The others hear of each other only
/// from these, or not at all.
const FIRST_IDS: u16 = 12;

/// How many of the first numbers are left to processes that must be found by all others, but may start after them.
const FIRST_IDS_LEFT: u16 = 2;

/// Wall time after which the link may replace a publisher with a full window again.
const RENEWAL_PERIOD: Duration = Duration::from_secs(1);

/// Wall time between two reports about one topic.
const REPORT_PERIOD: Duration = Duration::from_secs(5);

/// Endpoints that are made in one go. The middleware announces them one by one and has bounded queues for what is to be
/// announced; what does not fit is never announced.
const ENDPOINTS_IN_A_ROW: usize = 32;

/// Wall time that the middleware gets to announce them, several times what it needs.
const ANNOUNCEMENT: Duration = Duration::from_millis(10);

/// Wall time that messages under way are given at the end: some rounds of repair, which are 10 ms apart.
const LINGER: Duration = Duration::from_millis(200);

/// The same if somebody looks on: nodes of people have more under way, and may be slower to take it in.
const LINGER_WATCHED: Duration = Duration::from_secs(1);

/// Why this process does not take part in a ROS network.
#[derive(Debug, Error)]
pub enum RosError {
    /// It is told not to look for anybody.
    #[error("{0}: without discovery nobody would be found; set ROS_AUTOMATIC_DISCOVERY_RANGE to LOCALHOST or SUBNET")]
    DiscoveryOff(RosEnv),
    /// The middleware does not start.
    #[error("joining {env}: {source} (a machine has room for 120 processes in a domain)")]
    Participant {
        /// The network.
        env: RosEnv,
        /// What the middleware says.
        source: CreateError,
    },
    /// A node cannot be made.
    #[error("making the ROS node {name}: {source}")]
    Node {
        /// The node.
        name: String,
        /// What the middleware says.
        source: NodeCreateError,
    },
    /// A publisher or a subscription cannot be made.
    #[error("making an endpoint of {topic}: {source}")]
    Endpoint {
        /// The topic and its type.
        topic: String,
        /// What the middleware says.
        source: CreateError,
    },
    /// The system does not allow as many open files as the endpoints need.
    #[error("{wanted} open files are needed for so many agents, but the limit is {allowed}; see `ulimit -n`")]
    OpenFiles {
        /// How many are needed.
        wanted: u64,
        /// How many there may be.
        allowed: u64,
    },
}

/// Open files of a process with a participant, and some to spare.
const FILES: u64 = 256;

/// Open files for each agent: four for each of two subscriptions, two for each of four publishers, and as many again for
/// publishers that are being replaced.
const FILES_PER_AGENT: u64 = 24;

/// Raises the limit of open files of this process as far as endpoints for this many agents need it.
///
/// # Errors
/// If the system does not allow as many.
pub fn allow_open_files(agents: u32) -> Result<(), RosError> {
    let wanted = FILES + FILES_PER_AGENT * u64::from(agents);
    match rlimit::increase_nofile_limit(wanted) {
        Ok(allowed) if allowed < wanted => Err(RosError::OpenFiles { wanted, allowed }),
        // A system that does not tell its limit says so when it is reached.
        Ok(_) | Err(_) => Ok(()),
    }
}

/// Joins the network that the environment names.
///
/// A process that `is_met_by_all` is one that every other process must find, whoever starts first: it takes one of the first
/// numbers on its machine, and the others leave some of them free.
///
/// # Errors
/// If discovery is off, or the middleware does not start.
pub fn join(env: &RosEnv, is_met_by_all: bool) -> Result<Context, RosError> {
    let participant = || {
        let builder = DomainParticipantBuilder::new(env.domain_id);
        match env.range {
            DiscoveryRange::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
            DiscoveryRange::Off | DiscoveryRange::Subnet | DiscoveryRange::SystemDefault => builder,
        }
        .build()
    };
    if env.range == DiscoveryRange::Off {
        return Err(RosError::DiscoveryOff(*env));
    }
    let joined = if is_met_by_all {
        participant()
    } else {
        // A participant takes the first number whose port is free.
        let taken: Vec<UdpSocket> = (0..FIRST_IDS_LEFT)
            .filter_map(|id| UdpSocket::bind((Ipv4Addr::UNSPECIFIED, discovery_port(env.domain_id, id))).ok())
            .collect();
        let joined = participant();
        drop(taken);
        joined.or_else(|_| participant())
    };
    let context = joined
        .map_err(CreateError::from)
        .inspect(meeting::meet)
        .and_then(Context::from_domain_participant)
        .map_err(|source| RosError::Participant { env: *env, source })?;
    let number = context.domain_participant().participant_id();
    if is_met_by_all && number >= FIRST_IDS {
        eprintln!(
            "{env}: {number} other processes were here first, so not all of them may find this one; start it before them, \
             or set another ROS_DOMAIN_ID"
        );
    }
    Ok(context)
}

/// The UDP port at which a participant is told about others, as RTPS defines it.
fn discovery_port(domain_id: u16, participant_id: u16) -> u16 {
    7400 + 250 * domain_id + 10 + 2 * participant_id
}

/// A node without the parameter services of the client; its log is [`rosout::Rosout`].
///
/// # Errors
/// If the middleware refuses it.
pub fn node(context: &Context, name: &str) -> Result<Node, RosError> {
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    NodeName::new("/", name)
        .map_err(|error| NodeCreateError::BadParameter(error.to_string()))
        .and_then(|node_name| context.new_node(node_name, options))
        .map_err(|source| RosError::Node { name: name.to_owned(), source })
}

/// Makes endpoints, not too many at a time.
#[derive(Default)]
pub struct Workshop {
    made: usize,
    /// Who tells which callers of services hear the answers.
    participant: Option<DomainParticipant>,
}

impl Workshop {
    /// For a process that offers services.
    pub fn of(context: &Context) -> Self {
        Workshop { made: 0, participant: Some(context.domain_participant()) }
    }

    /// A publisher of this topic.
    ///
    /// # Errors
    /// If the middleware refuses it.
    pub fn outlet<M: Message + Clone>(
        &mut self,
        node: &mut Node,
        topic: &topics::Topic,
    ) -> Result<Outlet<M>, RosError> {
        self.pause();
        let dds_topic = dds_topic(node, topic)?;
        let publisher = node.create_publisher(&dds_topic, None).map_err(|source| endpoint_error(topic, source))?;
        let unsent = Tally::new(format!("{}: not sent", topic.name));
        Ok(Outlet { publisher, topic: dds_topic, renewed: now(), unsent })
    }

    /// Adds a subscription of this topic to the inbox. `convert` makes of each sample what the inbox gives out.
    ///
    /// # Errors
    /// If the middleware refuses it.
    pub fn inlet<M: Message + 'static, T>(
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

    #[expect(clippy::disallowed_methods, reason = "nothing tells when the middleware has announced an endpoint")]
    fn pause(&mut self) {
        self.made += 1;
        if self.made.is_multiple_of(ENDPOINTS_IN_A_ROW) {
            std::thread::sleep(ANNOUNCEMENT);
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

/// A publisher that never waits.
///
/// The middleware keeps a sample until every reliable reader has acknowledged it, and refuses new ones when it keeps 8192. A
/// reader that was killed or stopped acknowledges nothing, and the middleware believes in it for up to 50 s. So a publisher
/// that is refused is replaced by a new one, with a window of its own; living readers find it in a moment.
pub struct Outlet<M: Serialize> {
    publisher: Publisher<M>,
    topic: rustdds::Topic,
    renewed: Instant,
    unsent: Tally,
}

impl<M: Serialize + Clone> Outlet<M> {
    /// Publishes, or counts the message as not sent.
    pub fn publish(&mut self, node: &mut Node, message: &M) {
        let Err(error) = self.publisher.publish(message.clone()) else { return };
        let error = match error {
            WriteError::WouldBlock { data } if self.renewed.elapsed() >= RENEWAL_PERIOD => {
                match self.publish_anew(node, data) {
                    Ok(()) => return,
                    Err(error) => error,
                }
            }
            WriteError::WouldBlock { .. } => "a reader does not acknowledge what it is sent".to_owned(),
            other => other.to_string(),
        };
        self.unsent.add(&error);
    }

    fn publish_anew(&mut self, node: &mut Node, message: M) -> Result<(), String> {
        self.renewed = now();
        self.publisher = node.create_publisher(&self.topic, None).map_err(|error| error.to_string())?;
        self.publisher.publish(message).map_err(|error| error.to_string())
    }
}

/// A count that people are told about now and then.
pub struct Tally {
    what: String,
    count: u64,
    reported: Option<Instant>,
}

impl Tally {
    /// Counts what the words say.
    pub fn new(what: String) -> Self {
        Tally { what, count: 0, reported: None }
    }

    /// Counts one more.
    pub fn add(&mut self, reason: &dyn fmt::Display) {
        self.count += 1;
        if self.reported.is_none_or(|reported| reported.elapsed() >= REPORT_PERIOD) {
            self.reported = Some(now());
            eprintln!("{} ({} so far): {reason}", self.what, self.count);
        }
    }
}

/// Gives messages under way a moment, and a longer one if people look on. Call it before the endpoints are dropped: what a dropped
/// one has sent is not repaired.
#[expect(
    clippy::disallowed_methods,
    reason = "the ROS client does not tell whether its messages have been acknowledged"
)]
pub fn linger(is_watched: bool) {
    std::thread::sleep(if is_watched { LINGER_WATCHED } else { LINGER });
}

/// Wall time.
#[expect(clippy::disallowed_methods, reason = "time-outs and reports are of wall time; no result hangs on them")]
pub fn now() -> Instant {
    Instant::now()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_those_of_the_rtps_standard() {
        assert_eq!(discovery_port(0, 0), 7410);
        assert_eq!(discovery_port(232, FIRST_IDS_LEFT), 65414);
    }

    #[test]
    fn without_discovery_there_is_no_network() {
        let env = RosEnv { domain_id: 3, range: DiscoveryRange::Off };
        let error = join(&env, true).err().unwrap();
        assert!(error.to_string().starts_with("ROS domain 3, range OFF: "), "{error}");
    }
}
