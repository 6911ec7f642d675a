//! Map sharing: the protocol by which agents in contact exchange their maps.
//!
//! Agents in contact first send each other what they know, and then what the other lacks
//! (anti-entropy: Demers et al., PODC 1987; summary vectors: Vahdat and Becker, "Epidemic routing",
//! 2000). What an agent knows is a position in the journal of each agent: it knows all cells that
//! this journal reports up to there. An exchange has three steps:
//!
//! 1. Both send a *summary*: these positions, their own journal included.
//! 2. Each replies to the summary of the other with *updates*: its journal up to its own summary,
//!    without what the other knows. A section that came from a third agent is left out if the
//!    other knows the journal of that one as far as needed, whoever it has that from. An update
//!    names all who lack its cells.
//! 3. A *completion* says how many updates the other was sent since the summary. If none of them
//!    was lost, nor the summary, it now knows the journal up to the summary, and whatever the
//!    summary says: the journal has that, too. It does not if the own sensor contradicts a report
//!    ([`ExplorationMap::contradictions`] and [`ExplorationMap::corrections`]); the summary says
//!    so, and is not taken over then.
//!
//! **Deputies.** What several agents know that are in contact with each other and with a third one,
//! one of them sends: a summary lists its receivers as well, so each sees whom it can leave a
//! section to. The completion names those deputies, and holds once they have completed their own.
//! The order in which agents are deputies of each other is drawn anew in each period, so that no
//! agent can keep others from news for long.
//!
//! **Hubs.** What is new to a crowd, more than `ADDRESSED_MAX` contacts, an agent sends to a *hub*
//! alone, and completes only that exchange: the first of the agents that exchange their maps, in
//! the order of deputies; hubs are several where contacts of the agent are not all in contact with
//! each other, and who is in contact with no hub is sent it as well. The completion for a hub asks
//! it to pass on what it has been sent: it sends all its contacts another summary, updates and a
//! completion in one tick, in reply to the summaries that it has from them. The others are sent no
//! completion; they know the news by that of the hub. Summaries go to the hubs as well: an agent
//! sends its own to the `LEADING` first of its contacts, and to all if it comes before or among
//! these. So a crowd of `n` agents sends some `10 n` messages and not `3 n^2`, and news take a tick
//! more. Two agents that no hub is in contact with, which happens where the contacts of an agent
//! are not in contact with each other, exchange their maps in a later period, whose order is
//! another one. A hub passes on once in each exchange; what reaches it later, it sends in the next
//! one, like any other agent that knows it.
//!
//! An update or completion is addressed to each of its receivers, or broadcast if they are all
//! contacts or more than `ADDRESSED_MAX`: otherwise the copies for a crowd would not fit into a
//! command. Those that are not named as receivers ignore it. In a crowd, what some lack is sent to
//! all that no hub passes it on to: who lacks what differs for each section of the journal, and
//! with it the message.
//!
//! Summaries are sent in the ticks that are multiples of the period, as exchanges take place in the
//! reference, so that all agents in contact exchange at the same time; at a first contact at once,
//! and so to a peer that was out of contact in its turn, and in reply to a summary. An agent in a
//! crowd begins exchanges once a period, with all contacts: they come and go all the time where
//! lines of sight are short. What does not fit into the messages of a tick is continued in the next
//! one.
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
//! Invariants: the cost of an exchange is proportional to the changes; messages depend only on the
//! journal, on ids, and on the messages received; a rejected message changes nothing but counters.
//!
//! This module does not schedule the agent; it states when it is due ([`Sharing::next_trigger`]).
//! Call it in committed ticks only.

mod agent_set;
mod bits;
mod decoded;
mod hubs;
mod knowledge;
mod map_message;
mod news;
mod outbox;
mod peer;
#[cfg(test)]
mod tests;
mod turns;
mod updates;

use std::sync::Arc;

use msgs::ids::{AgentId, Tick};
use msgs::limits::PARCEL_BYTES_BARE;
use msgs::shared_bytes::SharedBytes;

use crate::command::AgentMessage;
use crate::exploration_map::{CHANGES_MAX, ExplorationMap};
use crate::observation::{Contact, ReceivedMessage};
use agent_set::AgentSet;
use decoded::{Content, Summary, Update};
use knowledge::Knowledge;
use map_message::{Completed, SenderState};
pub use map_message::{MapMessageError, VERSION};
use outbox::{Outbox, copies};
use peer::{Peer, Provenance, peer};
use updates::complete;

/// The mark of map messages; all other marks are the controllers'.
pub const MAP_MESSAGE: u8 = 1;

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
    turn: Option<Tick>,
    /// What this agent does as a hub in the present exchange.
    hub: Hub,
    /// Number of summaries sent.
    summaries_sent: u32,
    provenances: Vec<Provenance>,
    totals: Totals,
}

/// What an agent does as a hub in an exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Hub {
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
            turn: None,
            hub: Hub::No,
            summaries_sent: 0,
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

    /// Processes the map messages for this agent among those received; ignores all others.
    ///
    /// A malformed message is rejected as a whole and reported, and so is any message of a barred
    /// sender.
    pub fn incoming(&mut self, map: &mut ExplorationMap, messages: &[ReceivedMessage]) -> Report {
        let mut report = Report::default();
        for ReceivedMessage { from, data, .. } in messages.iter().filter(|message| message.kind == MAP_MESSAGE) {
            match self.admit(map, *from, data) {
                Ok(Some(news)) => {
                    self.totals.messages_taken += 1;
                    self.totals.bytes_taken += data.len() as u64;
                    report.messages += 1;
                    report.news += news;
                }
                Ok(None) => report.for_others += 1,
                Err(reason) => {
                    self.totals.messages_refused += 1;
                    self.totals.bytes_refused += data.len() as u64;
                    report.refused.push((*from, reason));
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
                map.merge(delta, from);
                let positions = start..map.journal_len();
                let news = positions.len();
                self.remember(Provenance { positions, from, until: *until });
                Ok(Some(news))
            }
            Content::Completion(completion) => {
                let Some(place) = completion.place_of(self.own) else { return Ok(None) };
                let Completed { summary, updates, .. } = completion.receivers[place];
                if (summary, updates) == (sender.heard.number, sender.updates_received) {
                    if completion.is_for_hubs && self.hub != Hub::HasPassedOn {
                        self.hub = Hub::Asked;
                    }
                    self.knowledge.complete(&mut self.peers, from, completion, place);
                }
                Ok(Some(0))
            }
            Content::Update(_) => Ok(None),
        }
    }

    /// Notes where a section of the journal came from.
    fn remember(&mut self, section: Provenance) {
        if section.positions.is_empty() {
            return;
        }
        match self.provenances.last_mut() {
            Some(last)
                if last.positions.end == section.positions.start
                    && (last.from, last.until) == (section.from, section.until) =>
            {
                last.positions.end = section.positions.end;
            }
            _ => self.provenances.push(section),
        }
    }

    /// The messages of this tick to the agents in contact (ascending by id), with at most `budget`
    /// bytes, [`PARCEL_BYTES_BARE`] per message included.
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
            let deputies = self.deputies(contacts, now);
            if have_come && self.hub == Hub::No && self.may_be_hub(contacts, &deputies, now) {
                self.hub = Hub::MayBeAsked;
            }
            if self.hub == Hub::Asked {
                self.pass_on(&mut outbox, map);
            }
            // The first of a crowd waits a tick for what the others have seen.
            let waits = have_come && self.hub == Hub::MayBeAsked && deputies.is_empty();
            if !waits {
                self.send_updates(&mut outbox, map, &deputies, now);
                complete(&mut self.peers, &mut outbox);
            }
        }
        self.totals = outbox.totals;
        outbox.messages
    }

    /// Sends a summary to all contacts that one is due for.
    fn send_summaries(&mut self, outbox: &mut Outbox<'_>, map: &ExplorationMap, received: &[AgentId], now: Tick) {
        let has_had_turn = self.has_had_turn(outbox.contacts, now);
        if has_had_turn && received.is_empty() {
            return;
        }
        let leading = self.leading(outbox.contacts, now);
        let hubs: Vec<Arc<Summary>> = leading
            .iter()
            .flatten()
            .filter(|leader| received.contains(leader))
            .map(|leader| Arc::clone(&self.peers[leader.index()].heard))
            .collect();
        let has_hub = |agent: AgentId| hubs.iter().any(|heard| heard.receivers.contains(agent));
        let is_due = |peer: &Peer, agent: AgentId| match self.period {
            // Two that only receive would answer each other without end.
            0 => received.contains(&agent) && !peer.heard.state.only_receives,
            period => {
                let is_named = !has_had_turn && leading.as_ref().is_none_or(|leading| leading.contains(&agent));
                (is_named || received.contains(&agent) && !has_hub(agent))
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
        if !has_had_turn {
            (self.present, self.hub, self.turn) = (AgentSet::default(), Hub::No, Some(now));
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
        let room = (outbox.budget / copies(receivers.len(), outbox.contacts)).saturating_sub(PARCEL_BYTES_BARE);
        let summary = map_message::encode_summary((number, state), receivers, known.positions(), self.own, room);
        if !outbox.send(receivers, summary.into()) {
            return None;
        }
        self.summaries_sent = number.wrapping_add(1);
        Some(number)
    }

    /// As a hub, begins to send the contacts of the present exchange what they lack once more, what
    /// has been received from others included.
    fn pass_on(&mut self, outbox: &mut Outbox<'_>, map: &ExplorationMap) {
        let present = outbox.contacts.iter().map(|contact| contact.agent).filter(|&agent| self.present.contains(agent));
        let present: Vec<AgentId> = present.collect();
        if present.is_empty() {
            return;
        }
        let Some(number) = self.send_summary(outbox, map, &present) else { return };
        self.hub = Hub::HasPassedOn;
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
