//! A team of agents that share their maps, and a world that delivers their messages.

use std::ops::Range;

use msgs::limits::{PARCEL_BYTES_BARE, PARCEL_BYTES_MAX};
use msgs::maes_msgs::Wake as Events;
use nalgebra::Point3;
use voxels::Extent;

use super::super::*;
use crate::command::Trigger;
use crate::exploration_map::{CellState, Delta};
use crate::sharing::hubs::Division;
use crate::sharing::map_message::Message;
use crate::sharing::news::{ByOthers, Found, News, State};
use crate::sharing::outbox::{ADDRESSED_MAX, is_crowd};

pub(super) const BUDGET: usize = PARCEL_BYTES_MAX;

/// A summary, updates, a completion, and one in which they arrive.
const EXCHANGE_TICKS: u64 = 4;

/// Agents with their maps, and a world that delivers their messages.
pub(super) struct Team {
    pub(super) maps: Vec<ExplorationMap>,
    pub(super) sharings: Vec<Sharing>,
    pub(super) inboxes: Vec<Vec<ReceivedMessage>>,
    /// Number of messages sent so far, those to all once for each receiver.
    pub(super) posted: usize,
    /// Cells sent so far: from, to, cell, finding.
    pub(super) delivered: Vec<(u32, u32, u32, u8)>,
    /// Whether the next messages get lost; those after them do not.
    pub(super) losses: std::vec::IntoIter<bool>,
    /// When each agent is due and whom it has seen last; else all are asked in every tick.
    pub(super) due: Option<Vec<(Trigger, Vec<AgentId>)>>,
}

impl Team {
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
                let (trigger, seen) = &due[index];
                let has_met = in_contact.iter().any(|agent| !seen.contains(agent));
                let events = [(has_met, Events::FIRST_CONTACT), (!self.inboxes[index].is_empty(), Events::PARCEL)];
                let events = events.into_iter().filter(|&(has, _)| has).fold(0, |events, (_, event)| events | event);
                if !trigger.is_due(Tick(now), events) {
                    continue;
                }
            }
            let received = std::mem::take(&mut self.inboxes[index]);
            let report = self.sharings[index].incoming(&mut self.maps[index], &received);
            assert_eq!(report.refused, []);
            check_news(&self.sharings[index], &self.maps[index], &contacts, (Tick(now), budget));
            let messages = self.sharings[index].outgoing(&self.maps[index], &contacts, Tick(now), budget);
            let bytes: usize = messages.iter().map(|message| message.data.len() + PARCEL_BYTES_BARE).sum();
            assert!(bytes <= budget);
            sent[index] =
                messages.iter().filter(|message| message.data[1] == 1).map(|message| message.data.len()).sum();
            if let Some(due) = &mut self.due {
                due[index] = (self.sharings[index].next_trigger(&contacts, Tick(now)), in_contact.clone());
            }
            for AgentMessage { to, kind, data } in messages {
                let receivers = to.map_or_else(|| in_contact.clone(), |to| vec![to]);
                let extent = self.maps[index].extent();
                let message = map_message::decode(&data, extent, self.maps.len() as u32).unwrap();
                let (named, delta) = match message {
                    Message::Summary { .. } => (receivers.clone(), Delta::default()),
                    Message::Update { receivers, delta, .. } => (receivers, delta),
                    Message::Completion(completion) => (completion.agents(), Delta::default()),
                };
                self.posted += receivers.len();
                for &receiver in &receivers {
                    // A broadcast for many reaches all.
                    let is_named = named.contains(&receiver);
                    assert!(is_named || to.is_none() && named.len() > ADDRESSED_MAX);
                    if is_named {
                        let findings = delta.findings(extent);
                        self.delivered.extend(findings.map(|(cell, finding)| (agent, receiver.0, cell, finding as u8)));
                    }
                    if !self.losses.next().unwrap_or(false) {
                        posted.push((receiver, ReceivedMessage { from: AgentId(agent), kind, data: data.clone() }));
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

    pub(super) fn trigger(&self, agent: u32, pairs: &[(u32, u32)], now: u64) -> Trigger {
        self.sharings[agent as usize].next_trigger(&contacts(agent, pairs), Tick(now))
    }
}

/// Compares the news for peers that are sent all of the journal with what a search cell by cell
/// finds.
fn check_news(sharing: &Sharing, map: &ExplorationMap, contacts: &[Contact], (now, budget): (Tick, usize)) {
    let mut sharing = sharing.clone();
    for contact in contacts {
        peer(&mut sharing.peers, contact.agent).until = map.journal_len();
    }
    for (budget, cell_bits) in [(BUDGET, 2), (budget, 2), (500, 40)] {
        let deputies = sharing.deputies(contacts, now);
        for uses_hubs in [false, true] {
            let state =
                State { peers: &sharing.peers, provenances: &sharing.provenances, deputies: &deputies, uses_hubs };
            assert_eq!(
                news::news(&state, contacts, budget, cell_bits),
                plain_news(&state, contacts, budget, cell_bits)
            );
        }
    }
}

/// What [`news::news`] is to find.
fn plain_news(state: &State<'_>, contacts: &[Contact], mut budget: usize, cell_bits: usize) -> Option<Found<News>> {
    let State { peers, provenances, deputies, uses_hubs } = state;
    let waits = |agent: AgentId| peers.get(agent.index()).filter(|peer| peer.cursor < peer.until);
    let waiting: Vec<AgentId> =
        contacts.iter().map(|contact| contact.agent).filter(|&agent| waits(agent).is_some()).collect();
    let is_exchanging =
        |agent: AgentId, at: usize| waits(agent).is_some_and(|peer| (peer.cursor..peer.until).contains(&at));
    let heard = |at: usize| provenances.iter().find(|provenance| provenance.positions.contains(&at));
    let knows = |agent: AgentId, at: usize| heard(at).is_some_and(|section| peers[agent.index()].knows(section));
    let deputy = |agent: AgentId, at: usize| {
        let reaches = |deputy: &AgentId| peers[deputy.index()].heard.receivers.iter().any(|contact| contact == agent);
        deputies.iter().copied().filter(|&deputy| knows(deputy, at)).find(reaches)
    };
    let is_edge = |at: usize| {
        let is_end = |range: Range<usize>| range.start == at || range.end == at;
        provenances.iter().any(|provenance| is_end(provenance.positions.clone()))
            || waiting.iter().filter_map(|&agent| waits(agent)).any(|peer| is_end(peer.cursor..peer.until))
    };
    let start = waiting.iter().filter_map(|&agent| waits(agent)).map(|peer| peer.cursor).min()?;
    let last = waiting.iter().filter_map(|&agent| waits(agent)).map(|peer| peer.until).max()?;
    let (mut at, mut news, mut by_others) = (start, News::new(), ByOthers::default());
    while at < last {
        let end = (at + 1..=last).find(|&at| is_edge(at)).unwrap_or(last);
        let lacking = waiting.iter().copied().filter(|&agent| is_exchanging(agent, at) && !knows(agent, at));
        let (with_deputies, mut receivers): (Vec<AgentId>, Vec<AgentId>) =
            lacking.partition(|&agent| deputy(agent, at).is_some());
        let deputies_of = with_deputies.into_iter().filter_map(|agent| Some((agent, deputy(agent, at)?)));
        if is_crowd(contacts) {
            let exchanging = AgentSet::of(waiting.iter().copied().filter(|&agent| is_exchanging(agent, at)));
            let all = AgentSet::of(contacts.iter().map(|contact| contact.agent));
            let division = Division::of(exchanging, all, if *uses_hubs { deputies } else { &[] }, peers);
            by_others.hubs.extend(&division.hubs);
            by_others.left_to_hubs.extend(&division.left);
            if receivers.is_empty() {
                by_others.deputies.extend(deputies_of.filter(|&(agent, _)| !division.left.contains(agent)));
            } else {
                receivers = division.receivers.iter().collect();
            }
        } else {
            by_others.deputies.extend(deputies_of);
        }
        if receivers.is_empty() {
            at = end;
            continue;
        }
        let copies = copies(receivers.len(), contacts);
        let is_begun = news.contains_key(&receivers);
        let bare = if is_begun { 0 } else { map_message::bare_bytes_max(receivers.len()) + PARCEL_BYTES_BARE };
        let taken = (end - at).min(8 * budget.saturating_sub(copies * bare) / (copies * cell_bits));
        if taken == 0 {
            break;
        }
        budget -= copies * bare + (taken * copies * cell_bits).div_ceil(8);
        news.entry(receivers).or_default().push(at..at + taken);
        at += taken;
    }
    (at > start).then_some(Found { news, by_others, end: at })
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
