//! The ROS 2 client of both processes: one participant, publishers that never block, an inbox that
//! multiplexes subscriptions and services, and Unix sockets for what a tick waits for.
//!
//! The transports of `sim_server` and `agent_node` build on this crate, which alone names the
//! libraries of the middleware: DDS (`ros2-client` over RustDDS), and with the feature `zenoh` also
//! Zenoh in the format of `rmw_zenoh`. The environment chooses one of them for the whole process.
//!
//! Invariants: publishing returns at once, whatever readers do: a message that cannot be sent is
//! counted, reported and dropped, because the protocol resends. This crate answers the parameter
//! services itself, and the simulation protocol alone shows which processes have joined.

mod action;
mod blocking_publisher;
mod dds;
mod discovery;
mod inbox;
mod loopback;
mod network;
mod parameters;
mod services;
mod static_peers;
mod subscription_tracker;
mod type_hash;
mod unix_sockets;
#[cfg(feature = "zenoh")]
mod zenoh;

pub mod join_secret;
pub mod process_guard;
pub mod ros_env;
pub mod rosout;
pub mod suspension;

use std::fmt;
use std::time::{Duration, Instant};

use crate::ros_env::RosEnv;
use msgs::printable;
use ros2_client::{CreateError, NodeCreateError};
use system::wall_clock::now;
use thiserror::Error;

pub use action::{Goal, StepsEvent};
pub use blocking_publisher::{Acknowledgements, BlockingPublisher, PublishOutcome};
pub use dds::has_fixes as has_dds_fixes;
pub use inbox::{Inbox, Sample, SubscriptionId, own_source};
pub use network::{Context, EndpointFactory, Node, Publisher, join, node};
pub use parameters::SharedParameters;
pub use subscription_tracker::SubscriptionTracker;
pub use unix_sockets::{Connected, MessageKind, SocketSample, Sockets};

/// Minimum wall time between two warnings about one subject.
const REPORT_PERIOD: Duration = Duration::from_secs(5);

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
    /// The Zenoh session cannot be opened.
    #[error("joining {env}: {reason}")]
    Session { env: RosEnv, reason: String },
    /// Zenoh failed to create a node or an endpoint.
    #[error("making {name} over Zenoh: {reason}")]
    ZenohEndpoint {
        /// The node, or the topic or service with its type.
        name: String,
        reason: String,
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
            tracing::warn!("{}", printable::line(&line));
        }
    }
}

/// Waits for messages in flight, longer if there are observers. Call it before endpoints are
/// dropped: samples of a dropped endpoint are not repaired.
#[expect(clippy::disallowed_methods, reason = "the ROS client does not report acknowledgements")]
pub fn linger(has_observers: bool) {
    std::thread::sleep(if has_observers { LINGER_OBSERVED } else { LINGER });
}
