//! When an agent exchanges its map, in which order the agents of a period come, and what an agent
//! of a dense neighbourhood is in its exchanges.
//!
//! Invariants: two agents agree on their order in a period. This module sends nothing.

use msgs::ids::{AgentId, Tick};
use protocol::event_mask::EventMask;

use super::map_message::SenderState;
use super::outbox::is_dense;
use super::peer::Peer;
use super::{RelayRole, Sharing, relay_peers};
use crate::command::WakeCondition;
use crate::observation::Contact;

/// For so many ticks after its own summary an agent is due with each message if it lacks that of a
/// contact, which a radio may delay: no longer, or a flood of messages would keep it busy.
const LATE_TICKS: u64 = 50;

/// In a dense neighbourhood, an agent that comes after so many of its contacts sends its summary to
/// these alone.
const LEADING: usize = 4;

/// For so many ticks after it has begun its exchanges, an agent that may be a relay peer is due
/// with each message.
const ROUND_TICKS: u64 = 5;

impl Sharing {
    /// When map sharing is due next, after [`Sharing::outgoing`] has been called in this tick: in
    /// the next tick if an exchange is incomplete or a summary has been sent, else when an exchange
    /// with a present contact is due, or when an agent comes into contact with which none has begun
    /// in this period. An agent that only receives is due with each message.
    #[must_use]
    pub fn next_wake(&self, contacts: &[Contact], now: Tick) -> WakeCondition {
        if self.agents < 2 {
            return WakeCondition { at: Tick(u64::MAX), events: EventMask::empty() };
        }
        if self.period == 0 {
            return WakeCondition { at: Tick(u64::MAX), events: EventMask::MESSAGE };
        }
        let next_round = Tick(self.period_of(now).saturating_add(1).saturating_mul(self.period));
        let has_had_round = self.has_had_round(contacts, now);
        let due = |contact: &Contact| match self.peers.get(contact.agent.index()) {
            Some(peer) if peer.is_open || peer.last == Some(now) => now.next(),
            Some(Peer { last: Some(last), .. }) if self.period_of(*last) == self.period_of(now) => next_round,
            _ if has_had_round => next_round,
            _ => now.next(),
        };
        let is_waiting = |contact: &Contact| {
            let since =
                self.peers.get(contact.agent.index()).filter(|peer| !peer.has_replied).and_then(|peer| peer.last);
            since.is_some_and(|since| since < now && now.0 - since.0 < LATE_TICKS)
        };
        // Summaries may be late, and the delta for a relay peer. In a dense neighbourhood, not all
        // reply.
        let waits_for_relay_peer = has_had_round && !self.present.is_empty();
        let is_relay_peer = self.relay_role == RelayRole::MayBeAsked && self.is_in_round(now);
        let is_late = is_relay_peer || !waits_for_relay_peer && contacts.iter().any(is_waiting);
        let late = if is_late { EventMask::MESSAGE } else { EventMask::empty() };
        let at = match self.relay_role {
            RelayRole::Asked => now.next(),
            _ => contacts.iter().map(due).min().unwrap_or(Tick(u64::MAX)),
        };
        let met = if has_had_round { EventMask::empty() } else { EventMask::FIRST_CONTACT };
        WakeCondition { at, events: met | late }
    }

    /// In a dense neighbourhood, the first agents in the order of this period, which an agent that
    /// is none of them sends its summary to; `None`: it sends it to all.
    pub(super) fn leading(&self, contacts: &[Contact], now: Tick) -> Option<Vec<AgentId>> {
        if !is_dense(contacts) {
            return None;
        }
        let mut leading = self.those_before(contacts.iter().map(|contact| contact.agent), now);
        leading.truncate(LEADING);
        (leading.len() == LEADING).then_some(leading)
    }

    /// Whether this agent is in a dense neighbourhood and has begun its exchanges of this period.
    pub(super) fn has_had_round(&self, contacts: &[Contact], now: Tick) -> bool {
        is_dense(contacts) && self.round.is_some_and(|round| self.period_of(round) == self.period_of(now))
    }

    /// Whether it has begun its exchanges a few ticks ago.
    fn is_in_round(&self, now: Tick) -> bool {
        self.round.is_some_and(|round| now.0 - round.0 <= ROUND_TICKS)
    }

    /// Whether contacts that exchange their maps may ask this agent to pass on what they send it:
    /// some come after it in the order, and `before` it none that reaches all that it reaches.
    pub(super) fn may_be_relay_peer(&self, contacts: &[Contact], before: &[AgentId], now: Tick) -> bool {
        let is_after =
            |agent: AgentId| self.present.contains(agent) && self.place(agent, now) > self.place(self.own, now);
        is_dense(contacts)
            && contacts.iter().any(|contact| is_after(contact.agent))
            && !relay_peers::reach_all(contacts, before, &self.peers)
    }

    /// The contacts that this agent leaves it to, to send what they know as well: those that come
    /// before it in this period.
    pub(super) fn delegates(&self, contacts: &[Contact], now: Tick) -> Vec<AgentId> {
        let sends = |peer: &Peer| peer.heard.state == SenderState::default() && !peer.is_barred;
        let is_present =
            |agent: &AgentId| self.present.contains(*agent) && self.peers.get(agent.index()).is_some_and(sends);
        self.those_before(contacts.iter().map(|contact| contact.agent).filter(is_present), now)
    }

    /// Those of some agents that come before this one in the order of this period, the first one
    /// first.
    fn those_before(&self, agents: impl Iterator<Item = AgentId>, now: Tick) -> Vec<AgentId> {
        let own_place = self.place(self.own, now);
        let places = agents.map(|agent| self.place(agent, now));
        let mut places: Vec<(u64, AgentId)> = places.filter(|place| *place < own_place).collect();
        places.sort_unstable();
        places.into_iter().map(|(_, agent)| agent).collect()
    }

    /// The place of an agent in the order of this period.
    fn place(&self, agent: AgentId, now: Tick) -> (u64, AgentId) {
        (drawn(self.period_of(now), agent), agent)
    }

    /// The number of the period of a tick.
    pub(super) fn period_of(&self, tick: Tick) -> u64 {
        tick.0 / self.period.max(1)
    }
}

/// The place of an agent in a period, as if drawn: the finaliser of SplitMix64 (Steele et al.,
/// OOPSLA 2014).
fn drawn(round: u64, agent: AgentId) -> u64 {
    let mut word = round.wrapping_shl(32) ^ u64::from(agent.0).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    word = (word ^ word >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ word >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ word >> 31
}
