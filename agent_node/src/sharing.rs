//! Map sharing: the protocol by which agents in contact exchange their maps.
//!
//! Each agent sends each peer every change of its map once, its own findings and those received
//! from others alike, except what the peer itself has sent, and what the peer has received from
//! others together with this agent: a message names all its receivers, and none of them is sent its
//! content again.
//!
//! A message is addressed to each of its receivers, or broadcast if they are all contacts or more
//! than `ADDRESSED_MAX`: otherwise the copies for a crowd would not fit into a command. Those that
//! are not named as receivers ignore it. Among more contacts than that, what some of them lack is
//! sent to all: who lacks what differs for each section of the journal, and with it the message.
//!
//! Exchanges take place in the ticks that are multiples of the period, as in the reference, so that
//! all agents in contact exchange at the same time. At a first contact the exchange is immediate,
//! and so it is with a peer that was out of contact in its turn. What does not fit into the
//! messages of a tick is continued in the next one.
//!
//! Delivery: a message to a contact of the observation it replies to arrives, since contact is
//! decided for the same positions. Only a full inbox loses it: one exchange leaves room there for
//! those of all others (`INBOX_BYTES`), and is continued a period later if necessary.
//!
//! **Trust.** An agent that sends each entry of its journal once cannot report more cells to a peer
//! than a journal has entries: [`CHANGES_MAX`] for each cell of the map. A sender that reports more
//! is faulty or malicious, and is barred: nothing of it is merged any more. So the cost that one
//! sender can cause in a run is bounded, and so is each observation.
//!
//! Invariants: the cost of an exchange is proportional to the changes; messages depend only on the
//! journal and on ids; a rejected message changes nothing but counters.
//!
//! This module does not schedule the agent; it states when it is due ([`Sharing::next_trigger`]).
//! Call it in committed ticks only.

mod agent_set;
mod bits;
mod decoded;
mod map_message;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use msgs::ids::{AgentId, Tick};
use msgs::limits::{PARCEL_BYTES_BARE, PARCEL_BYTES_MAX};
use msgs::maes_msgs::Wake as Events;
use msgs::shared_bytes::SharedBytes;

use crate::command::{AgentMessage, Trigger};
use crate::exploration_map::{CHANGES_MAX, ExplorationMap, with_delta};
use crate::observation::{Contact, ReceivedMessage};
use agent_set::AgentSet;
use decoded::Content;
pub use map_message::{MapMessageError, VERSION};

/// The mark of map messages; all other marks are the controllers'.
pub const MAP_MESSAGE: u8 = 1;

/// Ticks between exchanges in the reference: 5.02 s.
pub const DEFAULT_PERIOD_TICKS: u32 = 251;

/// Capacity of an inbox, bytes; the server drops what does not fit.
const INBOX_BYTES: usize = 64 * PARCEL_BYTES_MAX;

/// Nothing is started with fewer bytes left than this: a tick later the runs are longer.
const BUDGET_MIN: usize = 1024;

/// A message for more receivers than this is broadcast, and not repeated for each of them.
const ADDRESSED_MAX: usize = 32;

/// The state of an agent's exchanges with its peers.
#[derive(Debug, Clone)]
pub struct Sharing {
    own: AgentId,
    period: u64,
    agents: u32,
    /// By agent; those beyond the end have exchanged nothing.
    peers: Vec<Peer>,
    provenances: Vec<Provenance>,
    totals: Totals,
}

/// The state of the exchanges with one peer.
#[derive(Debug, Clone, Default)]
struct Peer {
    /// Entries of the journal before this position are sent, or need not be.
    cursor: usize,
    /// End of the present exchange in the journal.
    until: usize,
    /// Bytes of the present exchange.
    bytes: usize,
    /// Tick in which the last exchange began.
    last: Option<Tick>,
    /// Number of cells the peer has reported, repetitions included.
    claims: u64,
    /// Whether the peer has reported more cells than it can know.
    is_barred: bool,
}

/// The agents that know a section of the journal because of a message.
#[derive(Debug, Clone)]
struct Provenance {
    positions: Range<usize>,
    from: AgentId,
    /// The sender, and all receivers of the message. Messages of one exchange mostly have the same.
    holders: Arc<AgentSet>,
}

/// The outcome of the messages of one observation.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Report {
    /// Map messages merged.
    pub messages: usize,
    /// Map messages for other agents, ignored.
    pub for_others: usize,
    /// Journal entries that they made.
    pub news: usize,
    /// Map messages rejected: sender and reason.
    pub refused: Vec<(AgentId, MapMessageError)>,
}

/// Running totals of an agent's map messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Totals {
    /// Messages sent; a broadcast counts once.
    pub messages_sent: u64,
    /// Bytes of data sent.
    pub bytes_sent: u64,
    /// Messages merged.
    pub messages_taken: u64,
    /// Bytes of data merged.
    pub bytes_taken: u64,
    /// Messages rejected, as malformed or from barred senders.
    pub messages_refused: u64,
    /// Bytes of data rejected.
    pub bytes_refused: u64,
    /// Cells reported by merged messages, known or not: a measure of their cost.
    pub cells_taken: u64,
}

/// First estimate of the bits per cell on the wire: about what LiDAR scans in open space need.
const CELL_BITS_USUAL: usize = 2;

/// The data of messages with their receivers.
type Batch = Vec<(Vec<AgentId>, SharedBytes)>;

/// Sections of the journal by the agents to send them to.
type News = BTreeMap<Vec<AgentId>, Vec<Range<usize>>>;

impl Sharing {
    /// No exchanges yet. With a period of 0 the agent only receives.
    #[must_use]
    pub fn new(own: AgentId, period_ticks: u32, agents: u32) -> Self {
        Self {
            own,
            period: period_ticks.into(),
            agents,
            peers: Vec::new(),
            provenances: Vec::new(),
            totals: Totals::default(),
        }
    }

    /// Changes the period; exchanges that are due by the new one follow with the next command.
    pub fn set_period(&mut self, period_ticks: u32) {
        self.period = period_ticks.into();
    }

    /// Running totals.
    #[must_use]
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Merges the map messages for this agent among those received; ignores all others.
    ///
    /// A malformed message is rejected as a whole and reported, and so is any message of a barred
    /// sender.
    pub fn incoming(&mut self, map: &mut ExplorationMap, messages: &[ReceivedMessage]) -> Report {
        let mut report = Report::default();
        for ReceivedMessage { from, data, .. } in messages.iter().filter(|message| message.kind == MAP_MESSAGE) {
            let content = match self.admit(map, *from, data) {
                Ok(Some(content)) => content,
                Ok(None) => {
                    report.for_others += 1;
                    continue;
                }
                Err(reason) => {
                    self.totals.messages_refused += 1;
                    self.totals.bytes_refused += data.len() as u64;
                    report.refused.push((*from, reason));
                    continue;
                }
            };
            let start = map.journal_len();
            map.merge(&content.delta, *from);
            let positions = start..map.journal_len();
            self.totals.messages_taken += 1;
            self.totals.bytes_taken += data.len() as u64;
            report.messages += 1;
            report.news += positions.len();
            if !positions.is_empty() {
                self.remember(positions, *from, content.holders(*from));
            }
        }
        report
    }

    /// The content of a message, `None` if it is for others, unless it is to be rejected. Messages
    /// of barred senders are not decoded.
    fn admit(
        &mut self,
        map: &ExplorationMap,
        from: AgentId,
        data: &SharedBytes,
    ) -> Result<Option<Arc<Content>>, MapMessageError> {
        let allowance = (CHANGES_MAX * map.extent().volume()) as u64;
        let sender = peer(&mut self.peers, from);
        if sender.is_barred {
            return Err(MapMessageError::Barred { allowance });
        }
        let content = decoded::content(data, map.extent(), self.agents)?;
        if !content.receivers.contains(self.own) {
            return Ok(None);
        }
        if sender.claims + content.cells > allowance {
            sender.is_barred = true;
            return Err(MapMessageError::Barred { allowance });
        }
        sender.claims += content.cells;
        self.totals.cells_taken += content.cells;
        Ok(Some(content))
    }

    /// Notes who knows a section of the journal, which is not empty.
    fn remember(&mut self, positions: Range<usize>, from: AgentId, mut holders: Arc<AgentSet>) {
        if let Some(last) = self.provenances.last_mut()
            && last.holders == holders
        {
            if last.positions.end == positions.start && last.from == from {
                last.positions.end = positions.end;
                return;
            }
            holders = Arc::clone(&last.holders);
        }
        self.provenances.push(Provenance { positions, from, holders });
    }

    /// The messages of this tick to the agents in contact (ascending by id), with at most `budget`
    /// bytes, [`PARCEL_BYTES_BARE`] per message included.
    pub fn outgoing(
        &mut self,
        map: &ExplorationMap,
        contacts: &[Contact],
        now: Tick,
        mut budget: usize,
    ) -> Vec<AgentMessage> {
        let mut messages = Vec::new();
        if self.period == 0 {
            return messages;
        }
        for contact in contacts {
            let peer = peer(&mut self.peers, contact.agent);
            let is_due = peer.last.is_none_or(|last| now.0 / self.period > last.0 / self.period);
            if is_due {
                *peer = Peer { until: map.journal_len(), bytes: 0, last: Some(now), ..*peer };
            }
        }
        while budget >= BUDGET_MIN
            && let Some((batch, end)) = self.batch(map, contacts, budget)
        {
            for (receivers, data) in batch {
                for receiver in &receivers {
                    peer(&mut self.peers, *receiver).bytes += data.len();
                }
                let mut send = |to, data: SharedBytes| {
                    budget -= data.len() + PARCEL_BYTES_BARE;
                    self.totals.messages_sent += 1;
                    self.totals.bytes_sent += data.len() as u64;
                    messages.push(AgentMessage { to, kind: MAP_MESSAGE, data });
                };
                if is_broadcast(receivers.len(), contacts) {
                    send(None, data);
                } else {
                    receivers.iter().for_each(|&receiver| send(Some(receiver), data.clone()));
                }
            }
            self.record_sent(contacts, end);
        }
        messages
    }

    /// The next messages for the contacts, and the position of the journal at which they end. They
    /// fit into the budget, and mostly use a good part of it.
    fn batch(&self, map: &ExplorationMap, contacts: &[Contact], budget: usize) -> Option<(Batch, usize)> {
        // The encoded size of cells is only known afterwards.
        let mut cell_bits = CELL_BITS_USUAL;
        loop {
            let (news, end) = self.news(contacts, budget, cell_bits)?;
            let mut bytes = 0;
            let mut batch = Batch::new();
            for (receivers, positions) in news {
                let reports = positions.into_iter().flat_map(|range| map.reports(range));
                let encode = |delta: &_| map_message::encode(&receivers, delta);
                let data = SharedBytes::from(with_delta(map.extent(), reports, encode));
                bytes += copies(receivers.len(), contacts) * (data.len() + PARCEL_BYTES_BARE);
                batch.push((receivers, data));
            }
            if bytes <= budget {
                return Some((batch, end));
            }
            let needed = (cell_bits * bytes).div_ceil(budget);
            // With `CELL_BYTES_MAX` it surely fits.
            cell_bits = needed.min(8 * map_message::CELL_BYTES_MAX).max(cell_bits + 1);
        }
    }

    /// When map sharing is due next, after [`Sharing::outgoing`] has been called in this tick: in
    /// the next tick if an exchange is incomplete, else when an exchange with a present contact is
    /// due, or when an agent comes into contact with which none has begun in this period.
    #[must_use]
    pub fn next_trigger(&self, contacts: &[Contact], now: Tick) -> Trigger {
        if self.period == 0 || self.agents < 2 {
            return Trigger { at: Tick(u64::MAX), events: 0 };
        }
        let due = |contact: &Contact| match self.peers.get(contact.agent.index()) {
            Some(Peer { cursor, until, last: Some(last), .. }) if cursor == until => {
                Tick((last.0 / self.period).saturating_add(1).saturating_mul(self.period))
            }
            _ => now.next(),
        };
        Trigger { at: contacts.iter().map(due).min().unwrap_or(Tick(u64::MAX)), events: Events::FIRST_CONTACT }
    }

    /// As many journal entries, from the first one that a contact has not been sent, as fit into
    /// the budget at this estimate of bits per cell; and where they end.
    fn news(&self, contacts: &[Contact], mut budget: usize, cell_bits: usize) -> Option<(News, usize)> {
        let waiting: Vec<(AgentId, &Peer)> = contacts
            .iter()
            .filter_map(|contact| Some((contact.agent, self.peers.get(contact.agent.index())?)))
            .filter(|(_, peer)| peer.cursor < peer.until)
            .collect();
        let start = waiting.iter().map(|(_, peer)| peer.cursor).min()?;
        let mut at = start;
        let mut news: Vec<(AgentSet, Vec<Range<usize>>)> = Vec::new();
        let mut provenances =
            self.provenances[self.provenances.partition_point(|provenance| provenance.positions.end <= at)..].iter();
        let mut provenance = provenances.next();
        // Between two edges, the same peers are within their exchanges.
        let mut edges: Vec<usize> = waiting.iter().flat_map(|(_, peer)| [peer.cursor, peer.until]).collect();
        edges.sort_unstable();
        edges.dedup();
        for between in edges.windows(2) {
            let exchanging = waiting.iter().filter(|(_, peer)| peer.cursor <= between[0] && between[0] < peer.until);
            let exchanging = AgentSet::of(exchanging.map(|&(agent, _)| agent));
            let mut before: Option<SectionBefore> = None;
            // Section by section of the journal; a section is new to the same peers throughout.
            while at < between[1] {
                if provenance.is_some_and(|provenance| provenance.positions.end <= at) {
                    provenance = provenances.next();
                }
                let heard = provenance.filter(|provenance| provenance.positions.start <= at);
                let hearing_edge = match (heard, provenance) {
                    (Some(heard), _) => heard.positions.end,
                    (None, Some(next)) => next.positions.start,
                    (None, None) => usize::MAX,
                };
                let end = hearing_edge.min(between[1]);
                let holders = heard.map(|provenance| &provenance.holders);
                let is_alike = |before: Option<&Arc<AgentSet>>| match (before, holders) {
                    (Some(before), Some(holders)) => Arc::ptr_eq(before, holders),
                    (before, holders) => before.is_none() && holders.is_none(),
                };
                if before.as_ref().is_none_or(|before| !is_alike(before.holders)) {
                    let mut receivers =
                        holders.map_or_else(|| exchanging.clone(), |holders| exchanging.without(holders));
                    if is_crowd(contacts) && receivers.len() > 0 {
                        receivers.clone_from(&exchanging);
                    }
                    let place = news.iter().position(|(same, _)| *same == receivers);
                    before = Some(SectionBefore { holders, receivers, place });
                }
                let Some(SectionBefore { receivers, place, .. }) = &mut before else {
                    unreachable!("it has just been set")
                };
                let count = receivers.len();
                if count == 0 {
                    at = end;
                    continue;
                }
                let copies = copies(count, contacts);
                let bare = match place {
                    Some(_) => 0,
                    None => copies * (map_message::bare_bytes_max(count) + PARCEL_BYTES_BARE),
                };
                let fitting = 8 * budget.saturating_sub(bare) / (copies * cell_bits);
                let taken = (end - at).min(fitting);
                if taken == 0 {
                    return (at > start).then(|| (in_order(news), at));
                }
                budget -= bare + (taken * copies * cell_bits).div_ceil(8);
                let place = *place.get_or_insert_with(|| {
                    news.push((receivers.clone(), Vec::new()));
                    news.len() - 1
                });
                news[place].1.push(at..at + taken);
                at += taken;
            }
        }
        (at > start).then(|| (in_order(news), at))
    }

    /// Records that the contacts have been sent everything before this position.
    fn record_sent(&mut self, contacts: &[Contact], end: usize) {
        let bytes_max = INBOX_BYTES / (2 * self.agents.max(1) as usize);
        for contact in contacts {
            let peer = peer(&mut self.peers, contact.agent);
            peer.cursor = peer.cursor.max(end.min(peer.until));
            if peer.bytes >= bytes_max {
                peer.until = peer.cursor;
            }
        }
    }
}

/// The section of the journal before the present one.
struct SectionBefore<'a> {
    /// Who held it already, if it was heard from others.
    holders: Option<&'a Arc<AgentSet>>,
    /// Who lacked it.
    receivers: AgentSet,
    /// Its place in the news.
    place: Option<usize>,
}

/// The state of the exchanges with an agent.
fn peer(peers: &mut Vec<Peer>, agent: AgentId) -> &mut Peer {
    if agent.index() >= peers.len() {
        peers.resize(agent.index() + 1, Peer::default());
    }
    &mut peers[agent.index()]
}

/// News in the order in which they are sent.
fn in_order(news: Vec<(AgentSet, Vec<Range<usize>>)>) -> News {
    news.into_iter().map(|(receivers, positions)| (receivers.iter().collect(), positions)).collect()
}

/// Number of messages that it takes to send the same to so many of the contacts.
fn copies(receivers: usize, contacts: &[Contact]) -> usize {
    if is_broadcast(receivers, contacts) { 1 } else { receivers }
}

/// Whether there are so many contacts that their knowledge is not told apart.
fn is_crowd(contacts: &[Contact]) -> bool {
    contacts.len() > ADDRESSED_MAX
}

/// Whether a message for so many of the contacts is sent to all of them.
fn is_broadcast(receivers: usize, contacts: &[Contact]) -> bool {
    receivers == contacts.len() || receivers > ADDRESSED_MAX
}
