//! Sends updates and completions.
//!
//! Invariant: an exchange is completed with those alone that have been sent all that they lack, but
//! for what others send them.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use msgs::limits::PARCEL_BYTES_MAX;

use super::agent_set::AgentSet;
use super::map_message::{self, Completed, Completion};
use super::news::{self, Found, State};
use super::outbox::Outbox;
use super::peer::{Peer, peer};
use super::{Hub, Sharing, position};
use crate::exploration_map::ExplorationMap;
use crate::observation::Contact;

/// Capacity of an inbox, bytes; the server drops what does not fit.
pub(super) const INBOX_BYTES: usize = 64 * PARCEL_BYTES_MAX;

/// Nothing is started with fewer bytes left than this: a tick later the runs are longer.
pub(super) const BUDGET_MIN: usize = 1024;

impl Sharing {
    pub(super) fn send_updates(
        &mut self,
        outbox: &mut Outbox<'_>,
        map: &ExplorationMap,
        deputies: &[AgentId],
        now: Tick,
    ) {
        let contacts = outbox.contacts;
        let uses_hubs = self.hub != Hub::HasPassedOn;
        while outbox.budget >= BUDGET_MIN {
            let state = State { peers: &self.peers, provenances: &self.provenances, deputies, uses_hubs };
            let Some(Found { news, by_others, end }) = news::batch(&state, map, contacts, outbox.budget) else {
                return;
            };
            for (receiver, deputy) in by_others.deputies {
                peer(&mut self.peers, receiver).rest_from.insert(deputy);
            }
            by_others.hubs.iter().for_each(|hub| peer(&mut self.peers, hub).is_hub = true);
            by_others.left_to_hubs.iter().for_each(|agent| peer(&mut self.peers, agent).is_left_to_hubs = true);
            for (receivers, data) in news {
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
    let mut completed: BTreeMap<(usize, bool), Vec<(Completed, &AgentSet)>> = BTreeMap::new();
    let mut left_to_hubs = Vec::new();
    for Contact { agent, .. } in outbox.contacts {
        let Some(peer) = peers.get(agent.index()).filter(|peer| is_done(peer)) else {
            continue;
        };
        if peer.is_left_to_hubs {
            left_to_hubs.push(*agent);
            continue;
        }
        let one = Completed { receiver: *agent, summary: peer.summary, updates: peer.updates_sent };
        completed.entry((peer.until, peer.is_hub)).or_default().push((one, &peer.rest_from));
    }
    let completion = |((until, is_for_hubs), receivers): ((usize, bool), Vec<_>)| {
        Completion::new(&receivers, (position(until), is_for_hubs), position_known)
    };
    let completions: Vec<Completion> = completed.into_iter().map(completion).collect();
    left_to_hubs.into_iter().for_each(|agent| peer(peers, agent).is_open = false);
    for completion in completions {
        let agents = completion.agents();
        if outbox.send(&agents, map_message::encode_completion(&completion).into()) {
            agents.iter().for_each(|&agent| peer(peers, agent).is_open = false);
        }
    }
}
