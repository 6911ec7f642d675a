//! The radio medium: transmit queues, packet loss and relays between the command that sends a
//! message and the inbox of its receiver (phase communicate).
//!
//! Relays are deployed first, then written; then each agent, in the order of ids, transmits; last,
//! relays deliver unread content to the agents that reach them. A radio of limited rate transmits
//! in the order of the commands, and a message arrives as a whole with its last byte. Its queue is
//! bounded, and a message that does not fit is lost. Delivery is decided at the end of the
//! transmission: the receiver must be in contact then, the message must survive packet loss, and
//! the inbox must have room.
//!
//! **Packet loss.** Each draw is named by sender, tick, number of the message within the tick, and
//! receiver, so draws depend neither on each other nor on the order of replies.

use std::collections::{BTreeMap, VecDeque};

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;
use protocol::event_mask::EventMask;
use protocol::limits::{AGENT_MESSAGE_BYTES_BARE, RELAYS_TOLD_MAX};
use protocol::relay_id::RelayId;
use rand_chacha::rand_core::Rng;
use voxels::OpenSpace;

use super::collision::Sphere;
use super::comms::{Comms, ContactRules, ContactTable, Radio};
use super::relays::{Relay, Relays};
use super::{AgentState, World};
use protocol::agent_message::{AgentMessage, Peer};
use protocol::command::Command;

/// Draws reserved for one message, more than it can have receivers.
const RECEIVERS_MAX: u128 = 1 << 32;

/// Messages in transmission, and the relays.
#[derive(Debug)]
pub(super) struct RadioMedium {
    queues: Vec<Queue>,
    pub(super) relays: Relays,
}

/// The contacts that committed observations of an agent have listed, one bit for each agent.
#[derive(Debug)]
pub(super) struct ReportedContacts {
    last: Vec<u64>,
    /// The contacts that all committed observations of a share period have listed.
    in_period: Vec<u64>,
    period: u64,
}

/// The contacts of the present positions, with what decides them, and the agents.
struct Present<'w> {
    table: &'w mut ContactTable,
    rules: ContactRules<'w>,
    agents: &'w mut [AgentState],
}

/// The transmit queue of an agent.
#[derive(Debug, Clone, Default)]
struct Queue {
    messages: VecDeque<AgentMessage>,
    /// Bytes on the air of all queued messages.
    bytes: u64,
    /// Bytes of the first message that are transmitted.
    sent: f64,
}

impl RadioMedium {
    /// A medium without traffic between `agents`.
    pub(super) fn new(agents: usize) -> Self {
        Self { queues: vec![Queue::default(); agents], relays: Relays::new(agents) }
    }
}

impl ReportedContacts {
    /// None of `agents` has been in contact.
    pub(super) fn new(agents: usize) -> Self {
        let none = vec![0; agents.div_ceil(64)];
        Self { last: none.clone(), in_period: none, period: 0 }
    }

    /// Those that have been listed in this share period.
    fn in_period(&mut self, period: u64) -> &mut [u64] {
        if self.period != period {
            self.period = period;
            self.in_period.fill(0);
        }
        &mut self.in_period
    }

    fn list(&mut self, row: &[u64], period: u64) {
        self.last.copy_from_slice(row);
        self.in_period(period).iter_mut().zip(row).for_each(|(listed, contacts)| *listed |= contacts);
    }
}

impl Queue {
    /// Appends a message; returns false, and drops it, if more than `bytes_max` would be queued.
    fn push(&mut self, message: AgentMessage, bytes_max: u64) -> bool {
        let bytes = bytes_on_air(&message);
        if self.bytes + bytes > bytes_max {
            return false;
        }
        self.bytes += bytes;
        self.messages.push_back(message);
        true
    }

    /// Transmits for one tick and returns the messages that are complete by its end, in order.
    /// Unused rate does not accumulate.
    fn send(&mut self, bytes_per_tick: f64) -> Vec<AgentMessage> {
        let mut sent = Vec::new();
        self.sent += bytes_per_tick;
        while let Some(first) = self.messages.front() {
            let bytes = bytes_on_air(first);
            if self.sent < bytes as f64 {
                return sent;
            }
            self.sent -= bytes as f64;
            self.bytes -= bytes;
            sent.extend(self.messages.pop_front());
        }
        self.sent = 0.0;
        sent
    }
}

/// Bytes of a message on the air, its header included.
fn bytes_on_air(message: &AgentMessage) -> u64 {
    (message.data.len() + AGENT_MESSAGE_BYTES_BARE) as u64
}

/// Whether packet loss drops message number `others` of `sender` in `tick` on its way to
/// `receiver`. `loss` is a probability.
fn is_lost(loss: f64, seed: u64, tick: Tick, sender: AgentId, others: usize, receiver: AgentId) -> bool {
    if loss <= 0.0 {
        return false;
    }
    let mut rng = voxels::random_streams::stream(seed, sender.0.into(), "radio.loss");
    rng.set_stream(tick.0);
    // A draw consumes two words of 32 bits.
    rng.set_word_pos(2 * (others as u128 * RECEIVERS_MAX + u128::from(receiver.0)));
    const BITS: u32 = 53;
    ((rng.next_u64() >> (u64::BITS - BITS)) as f64) < loss * (1_u64 << BITS) as f64
}

impl World {
    /// The deployed relays, in the order of deployment.
    #[must_use]
    pub fn relays(&self) -> &[Relay] {
        self.radio.relays.all()
    }

    /// The pairs of relays in contact, as indices into [`World::relays`].
    #[must_use]
    pub fn relay_links(&self) -> &[(usize, usize)] {
        self.radio.relays.links()
    }

    pub(super) fn communicate(&mut self, commands: &BTreeMap<AgentId, Command>) {
        self.deploy_relays(commands);
        self.write_relays(commands);
        let comms = &self.params.comms;
        let (bytes_per_tick, queue_bytes) = (comms.bytes_per_s * Tick::TICK_S, comms.queue_bytes);
        let is_unlimited = comms.bytes_per_s == f64::INFINITY;
        for sender in self.agents() {
            let messages = commands.get(&sender).map_or(&[][..], |command| &command.messages);
            let to_agents = messages.iter().filter(|message| matches!(message.peer, Peer::One(_) | Peer::Broadcast));
            let queue = &mut self.radio.queues[sender.index()];
            if is_unlimited {
                // What was queued while the radio had a limited rate goes first.
                let queued = queue.send(bytes_per_tick);
                let all = queued.iter().chain(to_agents).enumerate();
                all.for_each(|(others, message)| self.deliver(sender, message, others));
                continue;
            }
            let refused = to_agents.filter(|&message| !queue.push(message.clone(), queue_bytes)).count();
            self.totals.messages_queue_full += refused as u64;
            let sent = queue.send(bytes_per_tick);
            sent.iter().enumerate().for_each(|(others, message)| self.deliver(sender, message, others));
        }
        self.deliver_relay_content();
    }

    /// Delivers message number `others` of a sender in this tick to its receivers.
    fn deliver(&mut self, sender: AgentId, message: &AgentMessage, others: usize) {
        let receivers = match message.peer {
            Peer::One(receiver) => vec![receiver],
            Peer::Broadcast => self.contacts_of(sender),
            Peer::Relay(_) | Peer::NewRelay | Peer::Server => Vec::new(),
        };
        let (loss, seed, tick) = (self.params.comms.loss, self.params.comms.seed, self.tick);
        for receiver in receivers {
            self.totals.messages_sent += 1;
            if receiver == sender || !self.in_contact(sender, receiver) {
                self.totals.messages_out_of_contact += 1;
                continue;
            }
            if is_lost(loss, seed, tick, sender, others, receiver) {
                self.totals.messages_lost_radio += 1;
                continue;
            }
            let pending_observation = &mut self.agents[receiver.index()].pending_observation;
            if !pending_observation.post(AgentMessage { peer: Peer::One(sender), ..message.clone() }) {
                self.totals.messages_inbox_full += 1;
                continue;
            }
            self.totals.messages_delivered += 1;
            let bytes = message.data.len() as u64;
            self.totals.message_bytes_delivered += bytes;
            *self.totals.message_bytes_by_kind.entry(message.kind).or_default() += bytes;
        }
    }

    fn deploy_relays(&mut self, commands: &BTreeMap<AgentId, Command>) {
        for (&owner, command) in commands {
            for AgentMessage { kind, data, .. } in
                command.messages.iter().filter(|message| message.peer == Peer::NewRelay)
            {
                let position = self.spheres[owner.index()].centre;
                let content = (*kind, data.clone());
                if self.radio.relays.deploy(owner, position, content, &self.params.comms, &self.terrain) {
                    self.totals.relays_left += 1;
                    self.contacts = None;
                } else {
                    self.totals.relays_refused += 1;
                }
            }
        }
    }

    fn write_relays(&mut self, commands: &BTreeMap<AgentId, Command>) {
        for (&writer, command) in commands {
            for AgentMessage { peer, kind, data } in &command.messages {
                let Peer::Relay(relay) = *peer else { continue };
                let from = self.spheres[writer.index()].centre;
                let content = (*kind, data.clone());
                let is_written = self.is_on_air(writer)
                    && self.radio.relays.write(writer, from, relay, content, &self.params.comms, &self.terrain);
                self.totals.relay_writings += u64::from(is_written);
                self.totals.relay_writings_lost += u64::from(!is_written);
            }
        }
    }

    /// Delivers unread content of relays to the agents that reach them; a full inbox gets it later.
    fn deliver_relay_content(&mut self) {
        if self.relays().is_empty() {
            return;
        }
        for agent in self.agents().filter(|&agent| self.is_on_air(agent)).collect::<Vec<_>>() {
            let from = self.spheres[agent.index()].centre;
            for relay in self.radio.relays.reached(agent, &from, &self.params.comms, &self.terrain) {
                let Some(message) = self.radio.relays.unread(agent, relay) else { continue };
                if self.agents[agent.index()].pending_observation.post(message) {
                    self.radio.relays.mark_read(agent, relay);
                    self.totals.relay_readings += 1;
                }
            }
        }
    }

    /// The relays in an agent's observation with their positions (metres, frame `map`), ascending:
    /// those it reaches, at most the nearest [`RELAYS_TOLD_MAX`].
    pub fn relays_of(&mut self, agent: AgentId) -> Vec<(RelayId, Point3<f64>)> {
        if self.relays().is_empty() || !self.is_on_air(agent) {
            return Vec::new();
        }
        let from = self.spheres[agent.index()].centre;
        let mut reached = self.radio.relays.reached(agent, &from, &self.params.comms, &self.terrain);
        let distance_m = |&relay: &usize| (self.relays()[relay].position - from).norm();
        reached.sort_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        reached.truncate(RELAYS_TOLD_MAX);
        let mut reported: Vec<_> = reached.into_iter().map(|relay| &self.relays()[relay]).collect();
        reported.sort_by_key(|relay| relay.id);
        reported.into_iter().map(|relay| (relay.id, relay.position)).collect()
    }

    pub(super) fn in_contact(&mut self, one: AgentId, other: AgentId) -> bool {
        let Present { table, rules, .. } = self.present_contacts();
        table.in_contact(one, other, rules)
    }

    pub(super) fn contacts_of(&mut self, agent: AgentId) -> Vec<AgentId> {
        let Present { table, rules, .. } = self.present_contacts();
        table.of(agent, rules).collect()
    }

    /// [`EventMask::CONTACTS`] if the agents or relays in contact differ from those of the last
    /// committed observation, else no event.
    pub(super) fn change_of_contacts(&mut self, agent: AgentId) -> EventMask {
        let relays = self.relays_of(agent);
        let Present { table, rules, agents } = self.present_contacts();
        let state = &agents[agent.index()];
        let is_as_reported = relays == state.reported_relays && table.row(agent, rules) == state.reported_contacts.last;
        if is_as_reported { EventMask::empty() } else { EventMask::CONTACTS }
    }

    /// Whether an agent is in contact that no committed observation of this share period has
    /// listed.
    pub(super) fn has_first_contact(&mut self, agent: AgentId) -> bool {
        let period = self.share_period();
        let Present { table, rules, agents } = self.present_contacts();
        let listed = agents[agent.index()].reported_contacts.in_period(period);
        table.has_contact_not_among(agent, listed, rules)
    }

    /// Number of the present share period.
    fn share_period(&self) -> u64 {
        self.tick.0.checked_div(self.params.share_period_ticks.into()).unwrap_or(0)
    }

    /// Notes that the agents in contact have been reported.
    pub(super) fn note_reported_contacts(&mut self, agent: AgentId) {
        let period = self.share_period();
        let Present { table, rules, agents } = self.present_contacts();
        agents[agent.index()].reported_contacts.list(table.row(agent, rules), period);
    }

    /// The contacts of the present positions.
    fn present_contacts(&mut self) -> Present<'_> {
        self.compute_contacts();
        let Self { contacts, params, terrain, open_space, agents, .. } = self;
        let table = contacts.as_mut().expect("it has just been computed");
        let open_space = open_space.get_or_insert_with(|| OpenSpace::of(terrain));
        Present { table, rules: ContactRules { model: &params.comms.contact, terrain, open_space }, agents }
    }

    fn compute_contacts(&mut self) {
        if self.has_present_contacts && self.contacts.is_some() {
            return;
        }
        self.has_present_contacts = true;
        let mut networks = Vec::new();
        if !self.relays().is_empty() {
            let Self { radio, params, terrain, .. } = self;
            let by_agent = (0..).map(AgentId).zip(&self.spheres);
            let network =
                |(agent, sphere): (_, &Sphere)| radio.relays.networks(agent, &sphere.centre, &params.comms, terrain);
            networks = by_agent.map(network).collect();
        }
        let mut contacts = self.contacts.take();
        let radios = self
            .agents()
            .map(|agent| Radio { position: self.spheres[agent.index()].centre, is_on_air: self.is_on_air(agent) });
        match &mut contacts {
            Some(contacts) => contacts.update(radios, networks),
            None => contacts = Some(ContactTable::new(radios.collect(), networks)),
        }
        self.contacts = contacts;
    }

    /// Changes the radios of the team, and links the relays anew.
    pub fn set_radios(&mut self, comms: Comms) {
        self.params.comms = comms;
        self.radio.relays.reconnect(&self.params.comms.contact, &self.terrain);
        self.contacts = None;
    }

    /// Drops what an agent has not transmitted yet.
    pub(super) fn clear_queue(&mut self, agent: AgentId) {
        self.radio.queues[agent.index()] = Queue::default();
    }
}

#[cfg(test)]
mod tests;
