//! Agents tell each other what they know: the protocol by which maps are shared, over parcels.
//!
//! Each agent tells each peer, once, what is new since it last told it, its own findings and those it was told by others
//! alike, but nothing that the peer told it, nor what others have told the peer in its provenance: a parcel names all who are told
//! the same in the same tick, and what they were told then is not told to them again.
//!
//! Exchanges take place in the ticks that are multiples of the period, as in the reference, so that all agents in contact tell
//! each other at once. A peer that is met for the first time is told at once, and so is one that was out of contact when its
//! turn came. What does not fit into the parcels of a tick goes on in the next one.
//!
//! Delivery: a parcel to an agent that is a contact in the observation it answers arrives, since contact is judged for the same
//! positions. Only an inbox that is full loses it: one exchange leaves room there for everybody else's (`INBOX_BYTES`), and
//! goes on a period later if it must.
//!
//! **Trust.** An agent that tells each entry of its journal once can tell a peer of no more cells than a journal can have entries:
//! [`CHANGES_MAX`] for each cell of the map. Whoever tells of more is broken or wants to waste the time of others, and nothing is
//! taken in from it any more. So all that one sender can cost an agent in a run is bounded, and so is each observation.
//!
//! Invariants: the cost of an exchange is that of the news; what is sent hangs on the order of nothing but the journal and the
//! ids; a parcel that is refused changes nothing but what is counted.
//!
//! This module does not decide when an agent is asked; it says when it wants to be ([`Sharing::next_trigger`]). It must
//! be called in ticks that count only.

mod bits;
mod map_message;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::Range;

use msgs::ids::{AgentId, Tick};
use msgs::limits::{PARCEL_BYTES_BARE, PARCEL_BYTES_MAX};
use msgs::maes_msgs::Wake as Events;

use crate::command::{AgentMessage, Trigger};
use crate::exploration_map::{CHANGES_MAX, Delta, ExplorationMap};
use crate::observation::{Contact, ReceivedMessage};
pub use map_message::{MapMessageError, VERSION};

/// The mark of map parcels; all other marks are the controllers'.
pub const MAP_MESSAGE: u8 = 1;

/// Ticks between exchanges in the reference: 5.02 s.
pub const DEFAULT_PERIOD_TICKS: u32 = 251;

/// Bytes that lie in an inbox at the most; the server loses what does not fit.
const INBOX_BYTES: usize = 64 * PARCEL_BYTES_MAX;

/// Below this many bytes nothing is started: a tick later the runs are longer.
const BUDGET_MIN: usize = 1024;

/// What an agent remembers of the exchanges with its peers.
#[derive(Debug, Clone)]
pub struct Sharing {
    period: u64,
    agents: u32,
    peers: BTreeMap<AgentId, Peer>,
    provenances: Vec<Provenance>,
    totals: Totals,
}

/// How far a peer has been told.
#[derive(Debug, Clone, Default)]
struct Peer {
    /// The journal before this position has been told, or needs not be.
    cursor: usize,
    /// The present exchange ends at this position.
    until: usize,
    /// Bytes of the present exchange.
    bytes: usize,
    /// When the last exchange began.
    last: Option<Tick>,
    /// Cells that it has told of, each as often as it has.
    claims: u64,
    /// Whether it has told of more than it can know.
    is_barred: bool,
}

/// Who knows a part of the journal, because it was learnt from a parcel.
#[derive(Debug, Clone)]
struct Provenance {
    positions: Range<usize>,
    /// The sender, and all who were told the same.
    holders: Vec<AgentId>,
}

/// What came of the parcels of one observation.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Report {
    /// Map parcels that were taken in.
    pub messages: usize,
    /// Entries that they made in the journal.
    pub news: usize,
    /// Map parcels that were refused: from whom, and why.
    pub refused: Vec<(AgentId, MapMessageError)>,
}

/// Running totals of an agent's map parcels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Totals {
    /// Sent; one to everybody in contact counts once.
    pub messages_sent: u64,
    /// Bytes of data in them.
    pub bytes_sent: u64,
    /// Setting in.
    pub messages_taken: u64,
    /// Bytes of data in them.
    pub bytes_taken: u64,
    /// Refused because they were malformed, or their senders have told of more than they can know.
    pub messages_refused: u64,
    /// Bytes of data in them.
    pub bytes_refused: u64,
    /// Cells that the parcels taken in told of, known or not: the work that they were.
    pub cells_taken: u64,
}

/// How many bits a cell is at first taken to need on the wire: about as many as what a LiDAR finds in the open does need.
const CELL_BITS_USUAL: usize = 2;

/// The data of parcels, and for whom each is.
type Batch = Vec<(Vec<AgentId>, Vec<u8>)>;

/// Positions of the journal, and who is to be told them.
type News = BTreeMap<Vec<AgentId>, Vec<Range<usize>>>;

impl Sharing {
    /// Nobody has been met. With a period of 0 the agent listens, but tells nobody anything.
    #[must_use]
    pub fn new(period_ticks: u32, agents: u32) -> Self {
        Self {
            period: period_ticks.into(),
            agents,
            peers: BTreeMap::new(),
            provenances: Vec::new(),
            totals: Totals::default(),
        }
    }

    /// Running totals.
    #[must_use]
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Takes in the map parcels among those received; leaves all others alone.
    ///
    /// A parcel that is malformed is refused as a whole and reported, and so is all that comes from a sender that has told of more
    /// cells than it can have news of.
    pub fn incoming(&mut self, map: &mut ExplorationMap, messages: &[ReceivedMessage]) -> Report {
        let mut report = Report::default();
        for ReceivedMessage { from, data, .. } in messages.iter().filter(|message| message.kind == MAP_MESSAGE) {
            let (receivers, delta) = match self.admit(map, *from, data) {
                Ok(content) => content,
                Err(reason) => {
                    self.totals.messages_refused += 1;
                    self.totals.bytes_refused += data.len() as u64;
                    report.refused.push((*from, reason));
                    continue;
                }
            };
            let start = map.journal_len();
            map.merge(&delta, *from);
            let positions = start..map.journal_len();
            self.totals.messages_taken += 1;
            self.totals.bytes_taken += data.len() as u64;
            report.messages += 1;
            report.news += positions.len();
            self.remember(Provenance { positions, holders: receivers.into_iter().chain([*from]).collect() });
        }
        report
    }

    /// What a parcel says, and to whom, unless it is to be refused. Of a sender that is barred, no byte is looked at.
    fn admit(
        &mut self,
        map: &ExplorationMap,
        from: AgentId,
        data: &[u8],
    ) -> Result<(Vec<AgentId>, Delta), MapMessageError> {
        let allowance = (CHANGES_MAX * map.extent().volume()) as u64;
        let sender = self.peers.entry(from).or_default();
        if sender.is_barred {
            return Err(MapMessageError::Barred { allowance });
        }
        let (receivers, delta) = map_message::decode(data, map.extent(), self.agents)?;
        let cells = delta.len() as u64;
        if sender.claims + cells > allowance {
            sender.is_barred = true;
            return Err(MapMessageError::Barred { allowance });
        }
        sender.claims += cells;
        self.totals.cells_taken += cells;
        Ok((receivers, delta))
    }

    fn remember(&mut self, provenance: Provenance) {
        match self.provenances.last_mut() {
            _ if provenance.positions.is_empty() => {}
            Some(last) if last.positions.end == provenance.positions.start && last.holders == provenance.holders => {
                last.positions.end = provenance.positions.end;
            }
            _ => self.provenances.push(provenance),
        }
    }

    /// What there is to tell in this tick to agents in contact (ascending by id), in parcels that take `budget` bytes at the
    /// most, [`PARCEL_BYTES_BARE`] for each of them included.
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
            let peer = self.peers.entry(contact.agent).or_default();
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
                    self.peers.entry(*receiver).or_default().bytes += data.len();
                }
                let mut send = |to, data: Vec<u8>| {
                    budget -= data.len() + PARCEL_BYTES_BARE;
                    self.totals.messages_sent += 1;
                    self.totals.bytes_sent += data.len() as u64;
                    messages.push(AgentMessage { to, kind: MAP_MESSAGE, data });
                };
                if receivers.len() == contacts.len() {
                    send(None, data);
                } else {
                    receivers.iter().for_each(|&receiver| send(Some(receiver), data.clone()));
                }
            }
            self.told(contacts, end);
        }
        messages
    }

    /// What the contacts are to be told next, as the data of parcels and for whom each is, and the position of the journal at which
    /// it ends. It fits into the budget, and mostly fills a good part of it.
    fn batch(&self, map: &ExplorationMap, contacts: &[Contact], budget: usize) -> Option<(Batch, usize)> {
        // How long cells are on the wire is only known once they are written.
        let mut cell_bits = CELL_BITS_USUAL;
        loop {
            let (news, end) = self.news(contacts, budget, cell_bits)?;
            let mut bytes = 0;
            let mut batch = Batch::new();
            for (receivers, positions) in news {
                let delta = Delta::of(map.extent(), positions.into_iter().flat_map(|range| map.changes(range)));
                let data = map_message::encode(&receivers, &delta);
                bytes += copies(&receivers, contacts) * (data.len() + PARCEL_BYTES_BARE);
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

    /// When the agent has something to do for its map parcels next, after [`Sharing::outgoing`] has been called in this tick:
    /// in the next tick if something is left over, else when an exchange with a present contact is due, and when contacts
    /// change.
    #[must_use]
    pub fn next_trigger(&self, contacts: &[Contact], now: Tick) -> Trigger {
        if self.period == 0 || self.agents < 2 {
            return Trigger { at: Tick(u64::MAX), events: 0 };
        }
        let due = |contact: &Contact| match self.peers.get(&contact.agent) {
            Some(Peer { cursor, until, last: Some(last), .. }) if cursor == until => {
                Tick((last.0 / self.period).saturating_add(1).saturating_mul(self.period))
            }
            _ => now.next(),
        };
        Trigger { at: contacts.iter().map(due).min().unwrap_or(Tick(u64::MAX)), events: Events::CONTACTS }
    }

    /// From where the first of the contacts has been told, as many news as fit into the budget if they take so many bits a cell;
    /// where they end.
    fn news(&self, contacts: &[Contact], mut budget: usize, cell_bits: usize) -> Option<(News, usize)> {
        let waiting: Vec<(AgentId, &Peer)> = contacts
            .iter()
            .filter_map(|contact| Some((contact.agent, self.peers.get(&contact.agent)?)))
            .filter(|(_, peer)| peer.cursor < peer.until)
            .collect();
        let start = waiting.iter().map(|(_, peer)| peer.cursor).min()?;
        let mut at = start;
        let mut news = News::new();
        let mut provenances =
            self.provenances[self.provenances.partition_point(|provenance| provenance.positions.end <= at)..].iter();
        let mut provenance = provenances.next();
        // Piece by piece of the journal; a piece is new to the same peers throughout.
        loop {
            if provenance.is_some_and(|provenance| provenance.positions.end <= at) {
                provenance = provenances.next();
            }
            let heard = provenance.filter(|provenance| provenance.positions.start <= at);
            let hearing_edge = provenance
                .map(|provenance| if heard.is_some() { provenance.positions.end } else { provenance.positions.start });
            let peer_edges = waiting.iter().flat_map(|(_, peer)| [peer.cursor, peer.until]);
            let Some(end) = peer_edges.chain(hearing_edge).filter(|&edge| edge > at).min() else {
                break;
            };
            let knows = |agent: &AgentId| heard.is_some_and(|provenance| provenance.holders.contains(agent));
            let receivers: Vec<AgentId> = waiting
                .iter()
                .filter(|(agent, peer)| peer.cursor <= at && at < peer.until && !knows(agent))
                .map(|&(agent, _)| agent)
                .collect();
            if receivers.is_empty() {
                at = end;
                continue;
            }
            let copies = copies(&receivers, contacts);
            let bare = match news.contains_key(&receivers) {
                true => 0,
                false => copies * (map_message::bare_bytes_max(receivers.len()) + PARCEL_BYTES_BARE),
            };
            let fitting = 8 * budget.saturating_sub(bare) / (copies * cell_bits);
            let taken = (end - at).min(fitting);
            if taken == 0 {
                break;
            }
            budget -= bare + (taken * copies * cell_bits).div_ceil(8);
            news.entry(receivers).or_default().push(at..at + taken);
            at += taken;
        }
        (at > start).then_some((news, at))
    }

    /// Notes that contacts have been told what is new to them before this position.
    fn told(&mut self, contacts: &[Contact], end: usize) {
        let bytes_max = INBOX_BYTES / (2 * self.agents.max(1) as usize);
        for contact in contacts {
            let peer = self.peers.entry(contact.agent).or_default();
            peer.cursor = peer.cursor.max(end.min(peer.until));
            if peer.bytes >= bytes_max {
                peer.until = peer.cursor;
            }
        }
    }
}

/// How many parcels it takes to tell some of the contacts the same.
fn copies(receivers: &[AgentId], contacts: &[Contact]) -> usize {
    if receivers.len() == contacts.len() { 1 } else { receivers.len() }
}
