//! Map sharing: the protocol by which agents in contact exchange their maps.
//!
//! Agents in contact first send each other what they know, and then what the other lacks
//! (anti-entropy: Demers et al., PODC 1987; summary vectors: Vahdat and Becker, "Epidemic routing",
//! 2000). What an agent knows is a position in the journal of each agent: it knows all cells that
//! this journal reports up to there. An exchange has three steps:
//!
//! 1. Both send a *summary*: these positions, their own journal included.
//! 2. Each replies to the summary of the other with *updates*: its journal up to its own summary,
//!    without what the other knows. A segment that came from a third agent is left out if the
//!    other knows the journal of that one as far as needed, whoever it has that from. An update
//!    names all who lack its cells.
//! 3. An *acknowledgement* says how many updates the other was sent since the summary. If none of
//!    them was lost, nor the summary, it now knows the journal up to the summary, and whatever the
//!    summary says: the journal has that, too. It does not if the own sensor contradicts a report
//!    ([`ExplorationMap::contradictions`] and [`ExplorationMap::corrections`]); the summary says
//!    so, and is not taken over then.
//!
//! **Delegates.** What several agents know that are in contact with each other and with a third
//! one, one of them sends: a summary lists its receivers as well, so each sees whom it can leave a
//! segment to. The acknowledgement names those delegates, and holds once they have completed their
//! own. The order in which agents are delegates of each other is drawn anew in each period, so that
//! no agent can keep others from the delta for long.
//!
//! **Relay peers.** What is new to a dense neighbourhood, more than `ADDRESSED_MAX` contacts, an
//! agent sends to a *relay peer* alone, and completes only that exchange: the first of the agents
//! that exchange their maps, in the order of delegates; relay peers are several where contacts of
//! the agent are not all in contact with each other, and who is in contact with no relay peer is
//! sent it as well. The acknowledgement for a relay peer asks it to pass on what it has been sent:
//! it sends all its contacts another summary, updates and an acknowledgement in one tick, in reply
//! to the summaries that it has from them. The others are sent no acknowledgement; they know the
//! delta by that of the relay peer. Summaries go to the relay peers as well: an agent sends its own
//! to the `LEADING` first of its contacts, and to all if it comes before or among these. So a dense
//! neighbourhood of `n` agents sends some `10 n` messages and not `3 n^2`, and the delta takes a
//! tick more. Two agents that no relay peer is in contact with, which happens where the contacts of
//! an agent are not in contact with each other, exchange their maps in a later period, whose order
//! is another one. A relay peer passes on once in each exchange; what reaches it later, it sends in
//! the next one, like any other agent that knows it.
//!
//! An update or acknowledgement is addressed to each of its receivers, or broadcast if they are all
//! contacts or more than `ADDRESSED_MAX`: otherwise the copies for a dense neighbourhood would not
//! fit into a command. Those that are not named as receivers ignore it. In a dense neighbourhood,
//! what some lack is sent to all that no relay peer passes it on to: who lacks what differs for
//! each segment of the log, and with it the message.
//!
//! Summaries are sent in the ticks that are multiples of the period, as exchanges take place in the
//! reference, so that all agents in contact exchange at the same time; at a first contact at once,
//! and so to a peer that was out of contact in its round, and in reply to a summary. An agent in a
//! dense neighbourhood begins exchanges once a period, with all contacts: they come and go all the
//! time where lines of sight are short. What does not fit into the messages of a tick is continued
//! in the next one.
//!
//! Delivery: what is lost, by the radio or in a full inbox, is sent again a period later, because
//! the next summary does not list it. One exchange leaves room in the inbox for those of all others
//! (`INBOX_BYTES`), and is continued a period later if necessary.
//!
//! **Trust.** An agent that replies to a summary cannot report more cells than a journal has
//! entries: [`CHANGES_MAX`] for each cell of the map. A sender that reports more between two
//! summaries is faulty or malicious, and is barred: nothing of it is merged any more. So the cost
//! that one sender can cause in a period is bounded, and so is each observation. A false summary
//! changes no map, but it can keep others from sending what they take to be known, and as they take
//! it over and pass it on, that of a liar can silence a team.
//!
//! **Frames.** The maps of agents whose localisation drifts are displaced against each other by
//! whole cells. Cells that are received are entered where the sender's map is on the own one
//! ([`Sharing::set_frames`]).
//!
//! Invariants: the cost of an exchange is proportional to the changes; messages depend only on the
//! journal, on ids, and on the messages received; a rejected message changes nothing but counters.
//!
//! This module does not schedule the agent; it states when it is due ([`Sharing::next_wake`]).
//! Call it in committed ticks only.

mod agent_set;
mod bits;
mod decoded;
mod deltas;
mod knowledge;
mod map_message;
mod outbox;
mod peer;
mod relay_peers;
mod rounds;
#[cfg(test)]
mod tests;
mod updates;

use std::sync::Arc;

use msgs::ids::{AgentId, Tick};
use msgs::shared_bytes::SharedBytes;
use protocol::limits::AGENT_MESSAGE_BYTES_BARE;
use protocol::message_type::MessageType;

use crate::command::AgentMessage;
use crate::exploration_map::{CHANGES_MAX, ExplorationMap};
use crate::observation::{Contact, MapFrame};
use agent_set::AgentSet;
use decoded::{Content, Summary, Update};
use knowledge::Knowledge;
use map_message::{Acknowledged, SenderState};
pub use map_message::{MapMessageError, VERSION};
use outbox::{Outbox, copies};
use peer::{Peer, Provenance, peer};
use updates::complete;

/// Ticks between exchanges in the reference: 5.02 s.
pub const DEFAULT_PERIOD_TICKS: u32 = 251;

/// The state of an agent's exchanges with its peers.
#[derive(Debug, Clone)]
pub struct Sharing {
    own: AgentId,
    period: u64,
    agents: u32,
    /// What this agent knows of the journals of others.
    knowledge: Knowledge,
    /// By agent; those beyond the end have exchanged nothing.
    peers: Vec<Peer>,
    /// The peers whose summaries have not been replied to.
    summaries: Vec<AgentId>,
    /// The peers whose summaries belong to the present exchange.
    present: AgentSet,
    /// When it last began exchanges.
    round: Option<Tick>,
    /// What this agent does as a relay peer in the present exchange.
    relay_role: RelayRole,
    /// Number of summaries sent.
    summaries_sent: u32,
    provenances: Vec<Provenance>,
    /// Where the maps of others are, as far as they are elsewhere.
    frames: Vec<MapFrame>,
    totals: Totals,
}

/// What an agent does as a relay peer in an exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum RelayRole {
    /// Nothing: others come before it.
    #[default]
    No,
    /// It may be asked to pass on what it is sent.
    MayBeAsked,
    /// It has been asked.
    Asked,
    /// It has passed it on.
    HasPassedOn,
}

/// The outcome of the messages of one observation.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Report {
    /// Map messages for this agent that were well-formed.
    pub messages: usize,
    /// Map messages for other agents, ignored.
    pub for_others: usize,
    /// Journal entries that they made.
    pub deltas: usize,
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
    /// Messages for this agent that were well-formed.
    pub messages_taken: u64,
    /// Their bytes of data.
    pub bytes_taken: u64,
    /// Messages rejected, as malformed or from barred senders.
    pub messages_refused: u64,
    /// Bytes of data rejected.
    pub bytes_refused: u64,
    /// Cells reported by updates, known or not: a measure of their cost.
    pub cells_taken: u64,
}

impl Sharing {
    /// No exchanges yet. With a period of 0 the agent only receives: it sends summaries in reply to
    /// those of others.
    #[must_use]
    pub fn new(own: AgentId, period_ticks: u32, agents: u32) -> Self {
        Self {
            own,
            period: period_ticks.into(),
            agents,
            knowledge: Knowledge::default(),
            peers: Vec::new(),
            summaries: Vec::new(),
            present: AgentSet::default(),
            round: None,
            relay_role: RelayRole::No,
            summaries_sent: 0,
            provenances: Vec::new(),
            frames: Vec::new(),
            totals: Totals::default(),
        }
    }

    /// Changes the period; exchanges that are due by the new one follow with the next command.
    pub fn set_period(&mut self, period_ticks: u32) {
        self.period = period_ticks.into();
    }

    /// Sets where the maps of the senders of the next messages are on the own one.
    pub fn set_frames(&mut self, frames: &[MapFrame]) {
        self.frames.clear();
        self.frames.extend_from_slice(frames);
    }

    /// Running totals.
    #[must_use]
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Processes the map messages for this agent among those received; ignores all others.
    ///
    /// A malformed message is rejected as a whole and reported, and so is any message of a barred
    /// sender.
    pub fn incoming(&mut self, map: &mut ExplorationMap, messages: &[AgentMessage]) -> Report {
        let mut report = Report::default();
        for AgentMessage { peer, data, .. } in messages.iter().filter(|message| message.is_from_agent(MessageType::Map))
        {
            let crate::command::Peer::One(from) = *peer else { continue };
            match self.admit(map, from, data) {
                Ok(Some(deltas)) => {
                    self.totals.messages_taken += 1;
                    self.totals.bytes_taken += data.len() as u64;
                    report.messages += 1;
                    report.deltas += deltas;
                }
                Ok(None) => report.for_others += 1,
                Err(reason) => {
                    self.totals.messages_refused += 1;
                    self.totals.bytes_refused += data.len() as u64;
                    report.refused.push((from, reason));
                }
            }
        }
        report
    }

    /// Processes a message; the number of journal entries that it made, or `None` if it is for
    /// others. Messages of barred senders are not decoded.
    fn admit(
        &mut self,
        map: &mut ExplorationMap,
        from: AgentId,
        data: &SharedBytes,
    ) -> Result<Option<usize>, MapMessageError> {
        let allowance = (CHANGES_MAX * map.extent().volume()) as u64;
        let sender = peer(&mut self.peers, from);
        if sender.is_barred {
            return Err(MapMessageError::Barred { allowance });
        }
        match decoded::content(data, map.extent(), self.agents)?.as_ref() {
            Content::Summary(summary) => {
                let entries = map.journal_len();
                let position = summary.known.of(self.own);
                if position as usize > entries {
                    return Err(MapMessageError::Ahead { position, entries });
                }
                sender.heard = Arc::clone(summary);
                (sender.updates_received, sender.has_replied) = (0, true);
                self.summaries.push(from);
                self.knowledge.hear(from, summary);
                Ok(Some(0))
            }
            Content::Update(update) if update.receivers.contains(self.own) => {
                let Update { until, delta, cells, .. } = update;
                if sender.claims + cells > allowance {
                    sender.is_barred = true;
                    return Err(MapMessageError::Barred { allowance });
                }
                sender.claims += cells;
                sender.updates_received += 1;
                self.totals.cells_taken += cells;
                let start = map.journal_len();
                match self.frames.iter().find(|frame| frame.agent == from) {
                    Some(frame) => map.merge(&delta.moved(map.extent(), frame.offset(map.extent())), from),
                    None => map.merge(delta, from),
                }
                let positions = start..map.journal_len();
                let deltas = positions.len();
                self.remember(Provenance { positions, from, until: *until });
                Ok(Some(deltas))
            }
            Content::Acknowledgement(acknowledgement) => {
                let Some(place) = acknowledgement.place_of(self.own) else { return Ok(None) };
                let Acknowledged { summary, updates, .. } = acknowledgement.receivers[place];
                if (summary, updates) == (sender.heard.number, sender.updates_received) {
                    if acknowledgement.is_for_relay_peers && self.relay_role != RelayRole::HasPassedOn {
                        self.relay_role = RelayRole::Asked;
                    }
                    self.knowledge.complete(&mut self.peers, from, acknowledgement, place);
                }
                Ok(Some(0))
            }
            Content::Update(_) => Ok(None),
        }
    }

    /// Notes where a segment of the log came from.
    fn remember(&mut self, segment: Provenance) {
        if segment.positions.is_empty() {
            return;
        }
        match self.provenances.last_mut() {
            Some(last)
                if last.positions.end == segment.positions.start
                    && (last.from, last.until) == (segment.from, segment.until) =>
            {
                last.positions.end = segment.positions.end;
            }
            _ => self.provenances.push(segment),
        }
    }

    /// The messages of this tick to the agents in contact (ascending by id), with at most `budget`
    /// bytes, [`AGENT_MESSAGE_BYTES_BARE`] per message included.
    pub fn outgoing(
        &mut self,
        map: &ExplorationMap,
        contacts: &[Contact],
        now: Tick,
        budget: usize,
    ) -> Vec<AgentMessage> {
        let mut outbox = Outbox { budget, contacts, totals: self.totals, messages: Vec::new() };
        let summaries = std::mem::take(&mut self.summaries);
        self.send_summaries(&mut outbox, map, &summaries, now);
        if self.period > 0 {
            let have_come = !summaries.is_empty();
            self.begin(&outbox, summaries, now);
            let delegates = self.delegates(contacts, now);
            if have_come && self.relay_role == RelayRole::No && self.may_be_relay_peer(contacts, &delegates, now) {
                self.relay_role = RelayRole::MayBeAsked;
            }
            if self.relay_role == RelayRole::Asked {
                self.pass_on(&mut outbox, map);
            }
            // The first of a dense neighbourhood waits a tick for what the others have seen.
            let waits = have_come && self.relay_role == RelayRole::MayBeAsked && delegates.is_empty();
            if !waits {
                self.send_updates(&mut outbox, map, &delegates, now);
                complete(&mut self.peers, &mut outbox);
            }
        }
        self.totals = outbox.totals;
        outbox.messages
    }

    /// Sends a summary to all contacts that one is due for.
    fn send_summaries(&mut self, outbox: &mut Outbox<'_>, map: &ExplorationMap, received: &[AgentId], now: Tick) {
        let has_had_round = self.has_had_round(outbox.contacts, now);
        if has_had_round && received.is_empty() {
            return;
        }
        let leading = self.leading(outbox.contacts, now);
        let relay_peers: Vec<Arc<Summary>> = leading
            .iter()
            .flatten()
            .filter(|leader| received.contains(leader))
            .map(|leader| Arc::clone(&self.peers[leader.index()].heard))
            .collect();
        let has_relay_peer = |agent: AgentId| relay_peers.iter().any(|heard| heard.receivers.contains(agent));
        let is_due = |peer: &Peer, agent: AgentId| match self.period {
            // Two that only receive would answer each other without end.
            0 => received.contains(&agent) && !peer.heard.state.only_receives,
            period => {
                let is_named = !has_had_round && leading.as_ref().is_none_or(|leading| leading.contains(&agent));
                (is_named || received.contains(&agent) && !has_relay_peer(agent))
                    && peer.last.is_none_or(|last| now.0 / period > last.0 / period)
            }
        };
        let due = outbox.contacts.iter().map(|contact| contact.agent);
        let due: Vec<AgentId> = due.filter(|&agent| is_due(peer(&mut self.peers, agent), agent)).collect();
        if due.is_empty() {
            return;
        }
        // What has been sent of the exchanges before this one counts.
        for &agent in &due {
            let peer = peer(&mut self.peers, agent);
            peer.until = peer.cursor;
        }
        complete(&mut self.peers, outbox);
        let Some(number) = self.send_summary(outbox, map, &due) else { return };
        if !has_had_round {
            (self.present, self.relay_role, self.round) = (AgentSet::default(), RelayRole::No, Some(now));
        }
        for agent in due {
            let peer = peer(&mut self.peers, agent);
            peer.last = Some(now);
            peer.summarise(number, map.journal_len());
            peer.has_replied = received.contains(&agent);
        }
    }

    /// Sends what this agent knows, if it fits; the number of the summary.
    fn send_summary(&mut self, outbox: &mut Outbox<'_>, map: &ExplorationMap, receivers: &[AgentId]) -> Option<u32> {
        let mut known = self.knowledge.known().clone();
        known.set(self.own, position(map.journal_len()));
        let state = SenderState {
            has_contradictions: map.contradictions() + map.corrections() > 0,
            only_receives: self.period == 0,
        };
        let number = self.summaries_sent;
        let room = (outbox.budget / copies(receivers.len(), outbox.contacts)).saturating_sub(AGENT_MESSAGE_BYTES_BARE);
        let summary = map_message::encode_summary((number, state), receivers, known.positions(), self.own, room);
        if !outbox.send(receivers, summary.into()) {
            return None;
        }
        self.summaries_sent = number.wrapping_add(1);
        Some(number)
    }

    /// As a relay peer, begins to send the contacts of the present exchange what they lack once
    /// more, what has been received from others included.
    fn pass_on(&mut self, outbox: &mut Outbox<'_>, map: &ExplorationMap) {
        let present = outbox.contacts.iter().map(|contact| contact.agent).filter(|&agent| self.present.contains(agent));
        let present: Vec<AgentId> = present.collect();
        if present.is_empty() {
            return;
        }
        let Some(number) = self.send_summary(outbox, map, &present) else { return };
        self.relay_role = RelayRole::HasPassedOn;
        for agent in present {
            let peer = peer(&mut self.peers, agent);
            // What it has been sent since its summary counts no more.
            peer.summarise(number, map.journal_len());
            peer.restart();
            peer.proceed(self.own);
        }
    }

    /// Begins the exchanges with the contacts whose summaries have arrived.
    fn begin(&mut self, outbox: &Outbox<'_>, received: Vec<AgentId>, now: Tick) {
        let is_contact = |agent: &AgentId| outbox.contacts.binary_search_by_key(agent, |contact| contact.agent).is_ok();
        for agent in received.into_iter().filter(is_contact) {
            let peer = peer(&mut self.peers, agent);
            // Its summary does not know yet what was sent a tick ago.
            let is_on_its_way = peer.updated.is_some_and(|updated| now <= updated.next());
            if is_on_its_way && peer.updates_sent == 0 {
                // That does not count any more: its next summary will know.
                continue;
            }
            if !is_on_its_way {
                peer.restart();
            }
            peer.proceed(self.own);
            self.present.insert(agent);
        }
    }
}

/// A position in a journal on the wire; one beyond 2^32 - 1 counts as that.
fn position(entries: usize) -> u32 {
    u32::try_from(entries).unwrap_or(u32::MAX)
}
