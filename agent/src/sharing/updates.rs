//! Sends updates and acknowledgements.
//!
//! Invariant: an exchange is completed with those alone that have been sent all that they lack, but
//! for what others send them.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use protocol::limits::AGENT_MESSAGE_BYTES_MAX;

use super::agent_set::AgentSet;
use super::deltas::{self, DeltaBatch, State};
use super::map_message::{self, Acknowledged, Acknowledgement};
use super::outbox::Outbox;
use super::peer::{Peer, peer};
use super::{RelayRole, Sharing, position};
use crate::exploration_map::ExplorationMap;
use crate::observation::Contact;

/// Capacity of an inbox, bytes; the server drops what does not fit.
pub(super) const INBOX_BYTES: usize = 64 * AGENT_MESSAGE_BYTES_MAX;

/// Nothing is started with fewer bytes left than this: a tick later the runs are longer.
pub(super) const BUDGET_MIN: usize = 1024;

impl Sharing {
    pub(super) fn send_updates(
        &mut self,
        outbox: &mut Outbox<'_>,
        map: &ExplorationMap,
        delegates: &[AgentId],
        now: Tick,
    ) {
        let contacts = outbox.contacts;
        let uses_relay_peers = self.relay_role != RelayRole::HasPassedOn;
        while outbox.budget >= BUDGET_MIN {
            let state = State { peers: &self.peers, provenances: &self.provenances, delegates, uses_relay_peers };
            let Some(DeltaBatch { deltas, by_others, end }) = deltas::batch(&state, map, contacts, outbox.budget)
            else {
                return;
            };
            for (receiver, delegate) in by_others.delegates {
                peer(&mut self.peers, receiver).rest_from.insert(delegate);
            }
            by_others.relay_peers.iter().for_each(|relay_peer| peer(&mut self.peers, relay_peer).is_relay_peer = true);
            by_others
                .left_to_relay_peers
                .iter()
                .for_each(|agent| peer(&mut self.peers, agent).is_left_to_relay_peers = true);
            for (receivers, data) in deltas {
                for receiver in &receivers {
                    let peer = peer(&mut self.peers, *receiver);
                    peer.bytes += data.len();
                    peer.updates_sent += 1;
                    peer.updated = Some(now);
                }
                outbox.send(&receivers, data);
            }
            record_sent(&mut self.peers, self.agents, contacts, end);
        }
    }
}

/// Records that the contacts have been sent everything before this position.
fn record_sent(peers: &mut Vec<Peer>, agents: u32, contacts: &[Contact], end: usize) {
    let bytes_max = INBOX_BYTES / (2 * agents.max(1) as usize);
    for contact in contacts {
        let peer = peer(peers, contact.agent);
        peer.cursor = peer.cursor.max(end.min(peer.until));
        if peer.bytes >= bytes_max {
            peer.until = peer.cursor;
        }
    }
}

/// Completes the exchanges with the contacts that have been sent all.
pub(super) fn complete(peers: &mut Vec<Peer>, outbox: &mut Outbox<'_>) {
    let position_known = |agent: AgentId| peers.get(agent.index()).map_or(0, |peer| peer.heard.known.of(agent));
    let is_done = |peer: &Peer| peer.is_open && peer.cursor >= peer.until;
    let mut completed: BTreeMap<(usize, bool), Vec<(Acknowledged, &AgentSet)>> = BTreeMap::new();
    let mut left_to_relay_peers = Vec::new();
    for Contact { agent, .. } in outbox.contacts {
        let Some(peer) = peers.get(agent.index()).filter(|peer| is_done(peer)) else {
            continue;
        };
        if peer.is_left_to_relay_peers {
            left_to_relay_peers.push(*agent);
            continue;
        }
        let one = Acknowledged { receiver: *agent, summary: peer.summary, updates: peer.updates_sent };
        completed.entry((peer.until, peer.is_relay_peer)).or_default().push((one, &peer.rest_from));
    }
    let acknowledgement = |((until, is_for_relay_peers), receivers): ((usize, bool), Vec<_>)| {
        Acknowledgement::new(&receivers, (position(until), is_for_relay_peers), position_known)
    };
    let acknowledgements: Vec<Acknowledgement> = completed.into_iter().map(acknowledgement).collect();
    left_to_relay_peers.into_iter().for_each(|agent| peer(peers, agent).is_open = false);
    for acknowledgement in acknowledgements {
        let agents = acknowledgement.agents();
        if outbox.send(&agents, map_message::encode_acknowledgement(&acknowledgement).into()) {
            agents.iter().for_each(|&agent| peer(peers, agent).is_open = false);
        }
    }
}
