//! The messages of a command: addressed, or broadcast.

use msgs::ids::AgentId;
use msgs::shared_bytes::SharedBytes;
use protocol::limits::AGENT_MESSAGE_BYTES_BARE;
use protocol::message_type::MessageType;

use super::Totals;
use crate::command::{AgentMessage, Peer};
use crate::observation::Contact;

/// A message for more receivers than this is broadcast, and not repeated for each of them.
pub(super) const ADDRESSED_MAX: usize = 32;

/// The messages of a command, and what is left for them.
pub(super) struct Outbox<'a> {
    pub(super) budget: usize,
    pub(super) contacts: &'a [Contact],
    pub(super) totals: Totals,
    pub(super) messages: Vec<AgentMessage>,
}

impl Outbox<'_> {
    /// Sends a message to some of the contacts, if it fits.
    pub(super) fn send(&mut self, receivers: &[AgentId], data: SharedBytes) -> bool {
        let copies = copies(receivers.len(), self.contacts);
        let bytes = copies * (data.len() + AGENT_MESSAGE_BYTES_BARE);
        if bytes > self.budget {
            return false;
        }
        self.budget -= bytes;
        self.totals.messages_sent += copies as u64;
        self.totals.bytes_sent += (copies * data.len()) as u64;
        let message = |peer| AgentMessage { peer, kind: MessageType::Map.number(), data: data.clone() };
        if is_broadcast(receivers.len(), self.contacts) {
            self.messages.push(message(Peer::Broadcast));
        } else {
            self.messages.extend(receivers.iter().map(|&receiver| message(Peer::One(receiver))));
        }
        true
    }
}

/// Number of messages that it takes to send the same to so many of the contacts.
pub(super) fn copies(receivers: usize, contacts: &[Contact]) -> usize {
    if is_broadcast(receivers, contacts) { 1 } else { receivers }
}

/// Whether there are so many contacts that their knowledge is not distinguished.
pub(super) fn is_dense(contacts: &[Contact]) -> bool {
    contacts.len() > ADDRESSED_MAX
}

/// Whether a message for so many of the contacts is sent to all of them.
fn is_broadcast(receivers: usize, contacts: &[Contact]) -> bool {
    receivers == contacts.len() || receivers > ADDRESSED_MAX
}
