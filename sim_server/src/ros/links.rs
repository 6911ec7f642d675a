//! The Unix sockets of the server to the agents of its machine, beside the topics of the protocol.
//!
//! Invariants: what is for an agent goes to its topic as well unless all who subscribe to that are
//! connected by a socket; what a process sends for an agent that joins in another way, or that is
//! not of this run, has no effect, as on topics that the server does not subscribe to.

use std::collections::BTreeSet;

use msgs::ids::AgentId;
use msgs::maes_msgs::{JoinReply, SignedObservation};
use msgs::topics;
use ros_node::{Connected, Context, Inbox, MessageKind, SocketSample, Sockets, SubscriptionTracker};
use serde::Serialize;

use super::{Item, command, incoming, join};

/// The number of the topic of the replies to joins, before those of the observations.
const REPLIES: usize = 0;

/// The processes that are connected, and who else subscribes to what they are sent.
pub(super) struct Links {
    connected: Connected,
    /// To the replies to joins, and to the observations by agent. `None`: there are no sockets.
    subscriptions: Option<SubscriptionTracker>,
}

impl Links {
    /// Opens the socket of the server if it `is_wanted`. A server without one, which is reported,
    /// only is slower.
    pub(super) fn open(
        is_wanted: bool,
        agents: u32,
        teleoperated: &BTreeSet<AgentId>,
        own_source: [u8; 16],
        inbox: &mut Inbox<Item>,
    ) -> Self {
        let connected = Connected::default();
        let teleoperated = teleoperated.clone();
        let is_served = move |agent: AgentId| agent.0 < agents && !teleoperated.contains(&agent);
        let item = move |sample: SocketSample<'_>| if is_served(sample.agent) { item(sample) } else { Item::Handled };
        let mut open = || inbox.set_sockets(Sockets::listen(own_source, &connected)?, item.clone());
        let is_open = is_wanted
            && open()
                .inspect_err(|error| tracing::warn!("execution.unix_sockets: {error}; all messages go over ROS 2"))
                .is_ok();
        let observations = (0..agents).map(|agent| topics::observation(AgentId(agent)));
        let topics: Vec<_> = std::iter::once(topics::join_reply()).chain(observations).collect();
        Self { connected, subscriptions: is_open.then(|| SubscriptionTracker::new(&topics)) }
    }

    pub(super) fn connected(&self) -> &Connected {
        &self.connected
    }

    /// Sends the reply to a join over a socket, if its agent has one; returns whether it is to be
    /// published as well.
    pub(super) fn reply(&mut self, reply: &JoinReply, inbox: &mut Inbox<Item>, context: &Context) -> bool {
        self.send(MessageKind::JoinReply, AgentId(reply.agent), reply, REPLIES, inbox, context)
    }

    /// Sends a fragment of an observation over a socket, if its agent has one; returns whether it
    /// is to be published as well.
    pub(super) fn observe(
        &mut self,
        agent: AgentId,
        part: &SignedObservation,
        inbox: &mut Inbox<Item>,
        context: &Context,
    ) -> bool {
        self.send(MessageKind::Observation, agent, part, REPLIES + 1 + agent.index(), inbox, context)
    }

    fn send<M: Serialize>(
        &mut self,
        kind: MessageKind,
        agent: AgentId,
        message: &M,
        topic: usize,
        inbox: &mut Inbox<Item>,
        context: &Context,
    ) -> bool {
        let (Some(subscriptions), Some(sockets)) = (&mut self.subscriptions, inbox.sockets()) else { return true };
        if !sockets.send(kind, agent, message) {
            return true;
        }
        subscriptions.poll(context);
        subscriptions.has_other_subscribers(topic, &self.connected)
    }
}

fn item(sample: SocketSample<'_>) -> Item {
    let incoming = match sample.kind {
        MessageKind::Join => incoming(sample.agent, sample.decode(), join),
        MessageKind::Command => incoming(sample.agent, sample.decode(), command),
        MessageKind::JoinReply | MessageKind::Observation => return Item::Handled,
    };
    Item::Agent(Box::new(incoming))
}
