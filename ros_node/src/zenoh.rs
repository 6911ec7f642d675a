//! ROS 2 over Zenoh in the format of `rmw_zenoh`, so that its nodes see those of this process as
//! their own: key expressions, attachments and liveliness tokens (`names`), the configuration of
//! the session (`config`), the graph of all nodes (`graph`), publishers and subscriptions
//! (`topics`), services as queryables (`services`).
//!
//! A process has one session. Its id identifies the process, as a participant does over DDS.
//!
//! Invariants: publishing waits for a reader at most as long as `wait_before_drop` of Zenoh says, a
//! millisecond, except on a [`Writer`] made for that; every queue of received items is bounded;
//! threads of Zenoh only put items into queues, and the thread of the [`Inbox`](super::Inbox)
//! decodes them. Shared memory, TLS and transports other than TCP are left out of the build.
//!
//! See <https://github.com/ros2/rmw_zenoh/blob/rolling/docs/design.md>.

mod attachment;
mod config;
mod graph;
mod names;
mod queue;
mod services;
mod topics;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ::zenoh::Wait;
use ::zenoh::liveliness::LivelinessToken;

use super::ros_env::RosEnv;
use super::{RosError, process_guard};
use config::RouterChecks;
use graph::Graph;
use names::{Endpoint, EndpointKind};

pub(super) use topics::Writer;

/// Wall time between two checks for a router.
const ROUTER_CHECK_PERIOD: Duration = Duration::from_secs(1);

/// The session of this process.
#[derive(Clone)]
pub(super) struct Session(Arc<ZenohState>);

struct ZenohState {
    session: ::zenoh::Session,
    domain_id: u16,
    /// Numbers of nodes and endpoints.
    next_id: AtomicU64,
    graph: Graph,
}

impl Session {
    /// Opens the session that the environment variables of `rmw_zenoh` describe. Without a router
    /// it is open all the same, and finds one that starts later.
    pub(super) fn open(env: &RosEnv) -> Result<Self, RosError> {
        let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
        let failed = |reason: String| RosError::Session { env: env.clone(), reason };
        let config = config::session(variable).map_err(failed)?;
        let attempts = config::router_check_attempts(variable).map_err(failed)?;
        let opened = ::zenoh::open(config).wait().and_then(|session| {
            let graph = Graph::new(&session, env.domain_id)?;
            Ok((session, graph))
        });
        let (session, graph) = opened.map_err(|error| failed(config::reason(&error)))?;
        if !has_router(&session, attempts) {
            tracing::warn!(
                "{env}: no Zenoh router is connected; without one, processes do not find each other: ros2 run \
                 rmw_zenoh_cpp rmw_zenohd"
            );
        }
        Ok(Session(Arc::new(ZenohState { session, domain_id: env.domain_id, next_id: AtomicU64::new(0), graph })))
    }

    /// Makes a node in the root namespace.
    pub(super) fn node(&self, name: &str) -> Result<Node, RosError> {
        let id = self.next_id();
        let names = names::Node { domain_id: self.0.domain_id, session: self.id(), id, name: name.to_owned() };
        let token = self.token(&names.token()).map_err(|error| endpoint_error(name, &error))?;
        Ok(Node { session: self.clone(), names, _token: token })
    }

    /// The id of this session, as [`Sample::source`](super::Sample::source) has it.
    pub(super) fn source(&self) -> [u8; 16] {
        self.0.session.zid().to_le_bytes()
    }

    /// The sessions of the publishers of a topic.
    pub(super) fn publishers(&self, topic: &str) -> Vec<[u8; 16]> {
        self.0.graph.publishers(topic)
    }

    /// The subscriptions of other sessions: their topics, ids and sessions.
    pub(super) fn subscriptions(&self) -> Vec<(String, [u8; 16], [u8; 16])> {
        self.0.graph.subscriptions(&self.id())
    }

    fn id(&self) -> String {
        self.0.session.zid().to_string()
    }

    fn next_id(&self) -> u64 {
        self.0.next_id.fetch_add(1, Ordering::Relaxed)
    }

    fn token(&self, key: &str) -> Result<LivelinessToken, ::zenoh::Error> {
        self.0.session.liveliness().declare_token(key).wait()
    }
}

impl Drop for ZenohState {
    fn drop(&mut self) {
        // What is still to be sent gets out, and others see at once that this process has left. If
        // that fails, they notice that the connection is closed.
        let _ = self.session.close().wait();
    }
}

/// Whether a router is connected, after this many checks.
fn has_router(session: &::zenoh::Session, most: RouterChecks) -> bool {
    let mut checks = 0;
    let check = || {
        checks += 1;
        match most {
            RouterChecks::None => Some(true),
            _ if session.info().routers_zid().wait().next().is_some() => Some(true),
            RouterChecks::AtMost(most) if checks >= most => Some(false),
            RouterChecks::AtMost(_) | RouterChecks::Forever => None,
        }
    };
    process_guard::wait_while_starting(ROUTER_CHECK_PERIOD, check).unwrap_or(false)
}

fn endpoint_error(name: &str, error: &::zenoh::Error) -> RosError {
    RosError::ZenohEndpoint { name: name.to_owned(), reason: config::reason(error) }
}

/// A node of this process.
pub(super) struct Node {
    session: Session,
    names: names::Node,
    _token: LivelinessToken,
}

impl Node {
    /// Announces an endpoint of this node: its id for others, and the token that lasts as long as
    /// it.
    fn announce(&self, kind: EndpointKind, endpoint: &Endpoint) -> Result<([u8; 16], LivelinessToken), ::zenoh::Error> {
        let key = self.names.endpoint_token(self.session.next_id(), kind, endpoint);
        Ok((names::gid(&key), self.session.token(&key)?))
    }
}
