//! The phase communicate: what becomes of messages between the command that sends them and the inbox.
//!
//! First relays are left behind, then they are written on; then each agent, in the order of the ids, sends what it has to
//! send; last, relays tell their news to those that reach them. A radio of a limited rate sends in the order of the commands, each
//! message as a whole once its last byte is through; what waits is bounded, and what does not fit is lost. Whether a message arrives
//! is judged when it has been sent: the receiver is in contact then, chance lets it through, and the inbox has room.
//!
//! **Chance.** Whether a message is lost is a draw that is named by the sender, the tick, how many the sender has sent before in
//! this tick, and the receiver. So no draw hangs on another, or on who is asked first.

use std::collections::{BTreeMap, VecDeque};

use msgs::ids::{AgentId, Tick};
use msgs::limits::{PARCEL_BYTES_BARE, RELAYS_TOLD_MAX};
use msgs::relay_id::RelayId;
use nalgebra::Point3;
use rand_chacha::rand_core::Rng;

use super::comms::{AgentMessage, ContactTable, Peer};
use super::relays::{Relay, Relays};
use super::{Action, World};

/// Receivers of one message at the most, so that draws of one message do not run into those of the next.
const RECEIVERS_MAX: u128 = 1 << 32;

/// What is between the agents.
#[derive(Debug)]
pub(super) struct RadioMedium {
    queues: Vec<Queue>,
    pub(super) relays: Relays,
}

/// Parcels that wait at an agent to be sent.
#[derive(Debug, Clone, Default)]
struct Queue {
    messages: VecDeque<AgentMessage>,
    /// Bytes on the air that they take.
    bytes: u64,
    /// Bytes that have been sent of the first one.
    sent: f64,
}

impl RadioMedium {
    /// Nothing on its way between so many agents.
    pub(super) fn new(agents: usize) -> Self {
        Self { queues: vec![Queue::default(); agents], relays: Relays::new(agents) }
    }
}

impl Queue {
    /// Puts a message at the end, unless more than `bytes_max` would wait.
    fn push(&mut self, message: AgentMessage, bytes_max: u64) -> bool {
        let bytes = bytes_on_air(&message);
        if self.bytes + bytes > bytes_max {
            return false;
        }
        self.bytes += bytes;
        self.messages.push_back(message);
        true
    }

    /// Sends for one tick: the messages that are through by its end, in order. What a radio without work could have sent is not
    /// saved up.
    fn send(&mut self, bytes_per_tick: f64) -> Vec<AgentMessage> {
        let mut through = Vec::new();
        self.sent += bytes_per_tick;
        while let Some(first) = self.messages.front() {
            let bytes = bytes_on_air(first);
            if self.sent < bytes as f64 {
                return through;
            }
            self.sent -= bytes as f64;
            self.bytes -= bytes;
            through.extend(self.messages.pop_front());
        }
        self.sent = 0.0;
        through
    }
}

/// What a message takes on the air: empty ones count as well.
fn bytes_on_air(message: &AgentMessage) -> u64 {
    (message.data.len() + PARCEL_BYTES_BARE) as u64
}

/// Whether chance loses the message that `sender` sends in a tick after so many others, on its way to `receiver`.
fn is_lost(loss: f64, seed: u64, tick: Tick, sender: AgentId, others: usize, receiver: AgentId) -> bool {
    if loss <= 0.0 {
        return false;
    }
    let mut rng = random_streams::stream(seed, sender.0.into(), "radio.loss");
    rng.set_stream(tick.0);
    // A draw takes two words of 32 bits.
    rng.set_word_pos(2 * (others as u128 * RECEIVERS_MAX + u128::from(receiver.0)));
    const BITS: u32 = 53;
    ((rng.next_u64() >> (u64::BITS - BITS)) as f64) < loss * (1_u64 << BITS) as f64
}

impl World {
    /// The relays that agents have left behind, in the order of leaving.
    #[must_use]
    pub fn relays(&self) -> &[Relay] {
        self.radio.relays.all()
    }

    /// The pairs of relays that hear each other, by place in [`World::relays`].
    #[must_use]
    pub fn relay_links(&self) -> &[(usize, usize)] {
        self.radio.relays.links()
    }

    pub(super) fn communicate(&mut self, actions: &BTreeMap<AgentId, Action>) {
        self.leave_relays(actions);
        self.write_on_relays(actions);
        let comms = &self.params.comms;
        let (bytes_per_tick, queue_bytes) = (comms.bytes_per_s * Tick::TICK_S, comms.queue_bytes);
        let is_unlimited = comms.bytes_per_s == f64::INFINITY;
        for sender in self.agents() {
            let messages = actions.get(&sender).map_or(&[][..], |action| &action.messages);
            let to_agents = messages.iter().filter(|message| matches!(message.peer, Peer::One(_) | Peer::Broadcast));
            if is_unlimited {
                to_agents.enumerate().for_each(|(others, message)| self.deliver(sender, message, others));
                continue;
            }
            let queue = &mut self.radio.queues[sender.index()];
            let refused = to_agents.filter(|&message| !queue.push(message.clone(), queue_bytes)).count();
            self.totals.parcels_queue_full += refused as u64;
            let through = queue.send(bytes_per_tick);
            through.iter().enumerate().for_each(|(others, message)| self.deliver(sender, message, others));
        }
        self.tell_news_of_relays();
    }

    /// A message has been sent, after so many others in this tick.
    fn deliver(&mut self, sender: AgentId, message: &AgentMessage, others: usize) {
        let receivers = match message.peer {
            Peer::One(receiver) => vec![receiver],
            Peer::Broadcast => self.contacts_of(sender),
            Peer::Relay(_) | Peer::NewRelay => Vec::new(),
        };
        let (loss, seed, tick) = (self.params.comms.loss, self.params.comms.seed, self.tick);
        for receiver in receivers {
            self.totals.parcels_sent += 1;
            if receiver == sender || !self.in_contact(sender, receiver) {
                self.totals.parcels_out_of_contact += 1;
                continue;
            }
            if is_lost(loss, seed, tick, sender, others, receiver) {
                self.totals.parcels_lost_radio += 1;
                continue;
            }
            let pending_observation = &mut self.agents[receiver.index()].pending_observation;
            if !pending_observation.post(AgentMessage { peer: Peer::One(sender), ..message.clone() }) {
                self.totals.parcels_inbox_full += 1;
                continue;
            }
            self.totals.parcels_delivered += 1;
            let bytes = message.data.len() as u64;
            self.totals.parcel_bytes_delivered += bytes;
            *self.totals.parcel_bytes_by_kind.entry(message.kind).or_default() += bytes;
        }
    }

    fn leave_relays(&mut self, actions: &BTreeMap<AgentId, Action>) {
        for (&owner, action) in actions {
            for AgentMessage { kind, data, .. } in
                action.messages.iter().filter(|message| message.peer == Peer::NewRelay)
            {
                let position = self.spheres[owner.index()].centre;
                let content = (*kind, data.clone());
                if self.radio.relays.leave(owner, position, content, &self.params.comms, &self.terrain) {
                    self.totals.relays_left += 1;
                    self.contacts = None;
                } else {
                    self.totals.relays_refused += 1;
                }
            }
        }
    }

    fn write_on_relays(&mut self, actions: &BTreeMap<AgentId, Action>) {
        for (&writer, action) in actions {
            for AgentMessage { peer, kind, data } in &action.messages {
                let Peer::Relay(relay) = *peer else { continue };
                let from = self.spheres[writer.index()].centre;
                let content = (*kind, data.clone());
                let is_written =
                    self.radio.relays.write(writer, from, relay, content, &self.params.comms, &self.terrain);
                self.totals.relay_writings += u64::from(is_written);
                self.totals.relay_writings_lost += u64::from(!is_written);
            }
        }
    }

    /// Relays tell what is new to those that reach them; who has no room is told later.
    fn tell_news_of_relays(&mut self) {
        if self.relays().is_empty() {
            return;
        }
        for agent in self.agents() {
            let from = self.spheres[agent.index()].centre;
            for relay in self.radio.relays.reached(agent, &from, &self.params.comms, &self.terrain) {
                let Some(message) = self.radio.relays.news(agent, relay) else { continue };
                if self.agents[agent.index()].pending_observation.post(message) {
                    self.radio.relays.has_read(agent, relay);
                    self.totals.relay_readings += 1;
                }
            }
        }
    }

    /// The relays that an agent is told of, and where they are, ascending: those that it reaches, or the nearest of them.
    pub fn relays_of(&mut self, agent: AgentId) -> Vec<(RelayId, Point3<f64>)> {
        if self.relays().is_empty() {
            return Vec::new();
        }
        let from = self.spheres[agent.index()].centre;
        let mut reached = self.radio.relays.reached(agent, &from, &self.params.comms, &self.terrain);
        let distance_m = |&relay: &usize| (self.relays()[relay].position - from).norm();
        reached.sort_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        reached.truncate(RELAYS_TOLD_MAX);
        let mut told: Vec<_> = reached.into_iter().map(|relay| &self.relays()[relay]).collect();
        told.sort_by_key(|relay| relay.id);
        told.into_iter().map(|relay| (relay.id, relay.position)).collect()
    }

    pub(super) fn in_contact(&mut self, one: AgentId, other: AgentId) -> bool {
        self.know_contacts();
        let table = self.contacts.as_mut().expect("it has just been made");
        table.in_contact(one, other, &self.params.comms.contact, &self.terrain)
    }

    pub(super) fn contacts_of(&mut self, agent: AgentId) -> Vec<AgentId> {
        self.know_contacts();
        let table = self.contacts.as_mut().expect("it has just been made");
        table.of(agent, &self.params.comms.contact, &self.terrain)
    }

    fn know_contacts(&mut self) {
        if self.contacts.is_some() {
            return;
        }
        let positions: Vec<Point3<f64>> = self.spheres.iter().map(|sphere| sphere.centre).collect();
        let mut networks = Vec::new();
        if !self.relays().is_empty() {
            let Self { radio, params, terrain, .. } = self;
            let by_agent = (0..).map(AgentId).zip(&positions);
            networks =
                by_agent.map(|(agent, from)| radio.relays.networks(agent, from, &params.comms, terrain)).collect();
        }
        self.contacts = Some(ContactTable::new(positions, networks));
    }
}

#[cfg(test)]
mod tests;
