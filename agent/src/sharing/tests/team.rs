//! A team of agents that share their maps, and a world that delivers their messages.

use std::ops::Range;

use nalgebra::Point3;
use protocol::event_mask::EventMask;
use protocol::limits::{AGENT_MESSAGE_BYTES_BARE, AGENT_MESSAGE_BYTES_MAX};
use voxels::Extent;

use super::super::*;
use crate::command::{Peer, WakeCondition};
use crate::exploration_map::{CellState, Delta};
use crate::sharing::deltas::{ByOthers, DeltaBatch, Deltas, State};
use crate::sharing::map_message::Message;
use crate::sharing::outbox::{ADDRESSED_MAX, is_dense};
use crate::sharing::relay_peers::Division;

pub(super) const BUDGET: usize = AGENT_MESSAGE_BYTES_MAX;

/// A summary, updates, an acknowledgement, and one in which they arrive.
const EXCHANGE_TICKS: u64 = 4;

/// Agents with their maps, and a world that delivers their messages.
pub(super) struct SimulatedTeam {
    pub(super) maps: Vec<ExplorationMap>,
    pub(super) sharings: Vec<Sharing>,
    pub(super) inboxes: Vec<Vec<AgentMessage>>,
    /// Number of messages sent so far, those to all once for each receiver.
    pub(super) posted: usize,
    /// Cells sent so far: from, to, cell, finding.
    pub(super) delivered: Vec<(u32, u32, u32, u8)>,
    /// Whether the next messages get lost; those after them do not.
    pub(super) losses: std::vec::IntoIter<bool>,
    /// When each agent is due and whom it has seen last; else all are asked in every tick.
    pub(super) due: Option<Vec<(WakeCondition, Vec<AgentId>)>>,
}

impl SimulatedTeam {
    pub(super) fn new(agents: u32, extent: Extent, period: u32) -> Self {
        let count = agents as usize;
        Self {
            maps: vec![ExplorationMap::new(extent); count],
            sharings: (0..agents).map(|id| Sharing::new(AgentId(id), period, agents)).collect(),
            inboxes: vec![Vec::new(); count],
            posted: 0,
            delivered: Vec::new(),
            losses: Vec::new().into_iter(),
            due: None,
        }
    }

    /// Ticks with the pairs of agents in contact, from one on, in which what is begun is completed;
    /// the tick after them.
    pub(super) fn exchange(&mut self, from: u64, pairs: &[(u32, u32)]) -> u64 {
        (from..from + EXCHANGE_TICKS).for_each(|now| drop(self.tick(now, pairs, BUDGET)));
        from + EXCHANGE_TICKS
    }

    /// One tick with the pairs of agents in contact; the bytes of the updates that each of them
    /// sent.
    pub(super) fn tick(&mut self, now: u64, pairs: &[(u32, u32)], budget: usize) -> Vec<usize> {
        let mut sent = vec![0; self.maps.len()];
        let mut posted = Vec::new();
        for agent in 0..self.maps.len() as u32 {
            let index = agent as usize;
            let contacts = contacts(agent, pairs);
            let in_contact: Vec<AgentId> = contacts.iter().map(|contact| contact.agent).collect();
            if let Some(due) = &self.due {
                let (wake, seen) = &due[index];
                let has_met = in_contact.iter().any(|agent| !seen.contains(agent));
                let events =
                    [(has_met, EventMask::FIRST_CONTACT), (!self.inboxes[index].is_empty(), EventMask::MESSAGE)];
                let events = events
                    .into_iter()
                    .filter(|&(has, _)| has)
                    .fold(EventMask::empty(), |events, (_, event)| events | event);
                if !wake.is_met(Tick(now), events) {
                    continue;
                }
            }
            let received = std::mem::take(&mut self.inboxes[index]);
            let report = self.sharings[index].incoming(&mut self.maps[index], &received);
            assert_eq!(report.refused, []);
            check_deltas(&self.sharings[index], &self.maps[index], &contacts, (Tick(now), budget));
            let messages = self.sharings[index].outgoing(&self.maps[index], &contacts, Tick(now), budget);
            let bytes: usize = messages.iter().map(|message| message.data.len() + AGENT_MESSAGE_BYTES_BARE).sum();
            assert!(bytes <= budget);
            sent[index] =
                messages.iter().filter(|message| message.data[1] == 1).map(|message| message.data.len()).sum();
            if let Some(due) = &mut self.due {
                due[index] = (self.sharings[index].next_wake(&contacts, Tick(now)), in_contact.clone());
            }
            for AgentMessage { peer, kind, data } in messages {
                let receivers = if let Peer::One(to) = peer { vec![to] } else { in_contact.clone() };
                let extent = self.maps[index].extent();
                let message = map_message::decode(&data, extent, self.maps.len() as u32).unwrap();
                let (named, delta) = match message {
                    Message::Summary { .. } => (receivers.clone(), Delta::default()),
                    Message::Update { receivers, delta, .. } => (receivers, delta),
                    Message::Acknowledgement(acknowledgement) => (acknowledgement.agents(), Delta::default()),
                };
                self.posted += receivers.len();
                for &receiver in &receivers {
                    // A broadcast for many reaches all.
                    let is_named = named.contains(&receiver);
                    assert!(is_named || peer == Peer::Broadcast && named.len() > ADDRESSED_MAX);
                    if is_named {
                        let findings = delta.findings(extent);
                        self.delivered.extend(findings.map(|(cell, finding)| (agent, receiver.0, cell, finding as u8)));
                    }
                    if !self.losses.next().unwrap_or(false) {
                        posted.push((
                            receiver,
                            AgentMessage { peer: Peer::One(AgentId(agent)), kind, data: data.clone() },
                        ));
                    }
                }
            }
        }
        for (receiver, message) in posted {
            self.inboxes[receiver.index()].push(message);
        }
        sent
    }

    pub(super) fn sent_cells(&self, from: u32, to: u32) -> Vec<u32> {
        let of_pair = self.delivered.iter().filter(|delivered| (delivered.0, delivered.1) == (from, to));
        let mut cells: Vec<u32> = of_pair.map(|delivered| delivered.2).collect();
        cells.sort_unstable();
        cells
    }

    pub(super) fn states(&self, agent: usize) -> Vec<CellState> {
        let map = &self.maps[agent];
        map.extent().cells().map(|cell| map.state(cell)).collect()
    }

    pub(super) fn wake(&self, agent: u32, pairs: &[(u32, u32)], now: u64) -> WakeCondition {
        self.sharings[agent as usize].next_wake(&contacts(agent, pairs), Tick(now))
    }
}

/// Compares the delta for peers that are sent all of the journal with what a search cell by cell
/// finds.
fn check_deltas(sharing: &Sharing, map: &ExplorationMap, contacts: &[Contact], (now, budget): (Tick, usize)) {
    let mut sharing = sharing.clone();
    for contact in contacts {
        peer(&mut sharing.peers, contact.agent).until = map.journal_len();
    }
    for (budget, cell_bits) in [(BUDGET, 2), (budget, 2), (500, 40)] {
        let delegates = sharing.delegates(contacts, now);
        for uses_relay_peers in [false, true] {
            let state = State {
                peers: &sharing.peers,
                provenances: &sharing.provenances,
                delegates: &delegates,
                uses_relay_peers,
            };
            assert_eq!(
                deltas::deltas(&state, contacts, budget, cell_bits),
                plain_deltas(&state, contacts, budget, cell_bits)
            );
        }
    }
}

/// What [`deltas::deltas`] is to find.
fn plain_deltas(
    state: &State<'_>,
    contacts: &[Contact],
    mut budget: usize,
    cell_bits: usize,
) -> Option<DeltaBatch<Deltas>> {
    let State { peers, provenances, delegates, uses_relay_peers } = state;
    let waits = |agent: AgentId| peers.get(agent.index()).filter(|peer| peer.cursor < peer.until);
    let waiting: Vec<AgentId> =
        contacts.iter().map(|contact| contact.agent).filter(|&agent| waits(agent).is_some()).collect();
    let is_exchanging =
        |agent: AgentId, at: usize| waits(agent).is_some_and(|peer| (peer.cursor..peer.until).contains(&at));
    let heard = |at: usize| provenances.iter().find(|provenance| provenance.positions.contains(&at));
    let knows = |agent: AgentId, at: usize| heard(at).is_some_and(|segment| peers[agent.index()].knows(segment));
    let delegate = |agent: AgentId, at: usize| {
        let reaches =
            |delegate: &AgentId| peers[delegate.index()].heard.receivers.iter().any(|contact| contact == agent);
        delegates.iter().copied().filter(|&delegate| knows(delegate, at)).find(reaches)
    };
    let is_edge = |at: usize| {
        let is_end = |range: Range<usize>| range.start == at || range.end == at;
        provenances.iter().any(|provenance| is_end(provenance.positions.clone()))
            || waiting.iter().filter_map(|&agent| waits(agent)).any(|peer| is_end(peer.cursor..peer.until))
    };
    let start = waiting.iter().filter_map(|&agent| waits(agent)).map(|peer| peer.cursor).min()?;
    let last = waiting.iter().filter_map(|&agent| waits(agent)).map(|peer| peer.until).max()?;
    let (mut at, mut deltas, mut by_others) = (start, Deltas::new(), ByOthers::default());
    while at < last {
        let end = (at + 1..=last).find(|&at| is_edge(at)).unwrap_or(last);
        let lacking = waiting.iter().copied().filter(|&agent| is_exchanging(agent, at) && !knows(agent, at));
        let (with_delegates, mut receivers): (Vec<AgentId>, Vec<AgentId>) =
            lacking.partition(|&agent| delegate(agent, at).is_some());
        let delegates_of = with_delegates.into_iter().filter_map(|agent| Some((agent, delegate(agent, at)?)));
        if is_dense(contacts) {
            let exchanging = AgentSet::of(waiting.iter().copied().filter(|&agent| is_exchanging(agent, at)));
            let all = AgentSet::of(contacts.iter().map(|contact| contact.agent));
            let division = Division::of(exchanging, all, if *uses_relay_peers { delegates } else { &[] }, peers);
            by_others.relay_peers.extend(&division.relay_peers);
            by_others.left_to_relay_peers.extend(&division.left);
            if receivers.is_empty() {
                by_others.delegates.extend(delegates_of.filter(|&(agent, _)| !division.left.contains(agent)));
            } else {
                receivers = division.receivers.iter().collect();
            }
        } else {
            by_others.delegates.extend(delegates_of);
        }
        if receivers.is_empty() {
            at = end;
            continue;
        }
        let copies = copies(receivers.len(), contacts);
        let is_begun = deltas.contains_key(&receivers);
        let bare = if is_begun { 0 } else { map_message::bare_bytes_max(receivers.len()) + AGENT_MESSAGE_BYTES_BARE };
        let taken = (end - at).min(8 * budget.saturating_sub(copies * bare) / (copies * cell_bits));
        if taken == 0 {
            break;
        }
        budget -= copies * bare + (taken * copies * cell_bits).div_ceil(8);
        deltas.entry(receivers).or_default().push(at..at + taken);
        at += taken;
    }
    (at > start).then_some(DeltaBatch { deltas, by_others, end: at })
}

pub(super) fn contacts(agent: u32, pairs: &[(u32, u32)]) -> Vec<Contact> {
    let mut others: Vec<u32> = pairs
        .iter()
        .filter_map(|&(one, other)| match agent {
            _ if agent == one => Some(other),
            _ if agent == other => Some(one),
            _ => None,
        })
        .collect();
    others.sort_unstable();
    others.into_iter().map(|agent| Contact { agent: AgentId(agent), position: Point3::origin() }).collect()
}

pub(super) fn all_pairs(agents: u32) -> Vec<(u32, u32)> {
    (0..agents).flat_map(|one| (one + 1..agents).map(move |other| (one, other))).collect()
}

pub(super) fn extent(size: u32) -> Extent {
    Extent::new([size; 3], 1.0).unwrap()
}
