//! The exchange of tasks between agents that meet: who holds which task, and how two agents change
//! that together.
//!
//! Every agent has a *record*: the tasks it holds, with a stamp and a lease. It alone changes its
//! record, and agents in contact pass on the latest ones that they know. Two agents change their
//! records together in two phases:
//!
//! 1. The one with the lower id *proposes* both new records. Until the answer it changes its own
//!    one in no other way.
//! 2. The other one takes its new record over, provided that its present one is still that of the
//!    proposal, and answers; with the answer the first one takes over its own.
//!
//! Invariants, whatever messages are lost:
//! - A task is unallocated for no longer than a lease. Before the answer the proposer keeps what
//!   it gives. The other one no longer holds what it gives, but believes that the proposer does,
//!   until it learns otherwise or the lease of that belief ends.
//! - Of two agents that hold one task and know of each other the one with the lower id has it. If
//!   an answer is lost, the proposer renews its old record with a higher stamp, and at the next
//!   contact the exchange is undone.
//! - A record without a live lease holds nothing, so the tasks of a lost agent become free.
//!
//! This module knows neither maps nor costs. Source of the two phases: RACER (see [`super::tour`]);
//! stamps, leases and the rule of the lower id are ours.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use voxels::Cell;

use super::message::{Message, Record, TASKS_MAX};
use super::tasks::TaskId;

/// Ticks after which a proposal without an answer is void: some round trips.
const ANSWER_TICKS: u64 = 25;

/// Upper bound on the remaining lease of a received record: ten minutes.
const LEASE_TICKS_MAX: u64 = 30_000;

/// How far a stamp can be ahead of the clock: changes of a record within one tick.
const STAMP_AHEAD_TICKS: u64 = 50;

/// What one agent knows of the tasks of all.
#[derive(Debug, Clone)]
pub(super) struct Ledger {
    own: AgentId,
    /// The latest record of each agent, the own one included.
    records: BTreeMap<AgentId, Record>,
    pending: Option<Pending>,
    /// The stamp of the record of an agent (second) that another one (first) has last been sent, or
    /// has sent itself.
    known_to: BTreeMap<(AgentId, AgentId), Tick>,
    outbox: Vec<(AgentId, Message)>,
}

/// A proposal without an answer.
#[derive(Debug, Clone, PartialEq)]
struct Pending {
    peer: AgentId,
    until: Tick,
    sender: Record,
    receiver: Record,
}

impl Ledger {
    /// A ledger without records.
    pub(super) fn new(own: AgentId) -> Self {
        Self { own, records: BTreeMap::new(), pending: None, known_to: BTreeMap::new(), outbox: Vec::new() }
    }

    /// The own record, once there is one.
    pub(super) fn own_record(&self) -> Option<&Record> {
        self.records.get(&self.own)
    }

    /// The record of another agent, if its lease is live.
    pub(super) fn record(&self, agent: AgentId, now: Tick) -> Option<&Record> {
        self.records.get(&agent).filter(|record| now < record.ends)
    }

    /// The agent that holds a task: of several the one with the lowest id.
    pub(super) fn holder(&self, task: TaskId, now: Tick) -> Option<AgentId> {
        let holds = |agent: AgentId, record: &Record| {
            (agent == self.own || now < record.ends) && record.tasks.iter().any(|held| held.overlaps(task))
        };
        self.records.iter().find(|&(&agent, record)| holds(agent, record)).map(|(&agent, _)| agent)
    }

    /// Whether a proposal of this agent awaits its answer: then its record must not change.
    pub(super) fn is_pending(&self) -> bool {
        self.pending.is_some()
    }

    /// Replaces the own record, unless a proposal is pending, or it holds the same tasks and half
    /// of its lease is left: each new stamp costs messages, and voids proposals of others.
    pub(super) fn hold(&mut self, tasks: &[TaskId], at: Cell, lease_ticks: u64, now: Tick) {
        let tasks = &tasks[..tasks.len().min(TASKS_MAX)];
        let is_same = |own: &Record| own.tasks == tasks && now.after(lease_ticks / 2) < own.ends;
        if self.pending.is_none() && !self.own_record().is_some_and(is_same) {
            let tasks = tasks.to_vec();
            let stamp = self.next_stamp(now);
            self.records.insert(self.own, Record { stamp, ends: stamp.after(lease_ticks), at, tasks });
        }
    }

    fn next_stamp(&self, now: Tick) -> Tick {
        self.own_record().map_or(now, |record| now.max(record.stamp.next()))
    }

    /// Proposes an exchange to an agent whose record is known, unless one is pending.
    pub(super) fn propose(&mut self, peer: AgentId, tasks: [&[TaskId]; 2], lease_ticks: u64, now: Tick) {
        let (Some(own), Some(theirs), None) = (self.own_record(), self.records.get(&peer), &self.pending) else {
            return;
        };
        let record = |of: &Record, stamp: Tick, tasks: &[TaskId]| Record {
            stamp,
            ends: stamp.after(lease_ticks),
            at: of.at,
            tasks: tasks[..tasks.len().min(TASKS_MAX)].to_vec(),
        };
        let sender = record(own, self.next_stamp(now), tasks[0]);
        let receiver = record(theirs, now.max(theirs.stamp.next()), tasks[1]);
        let message = Message::Proposal { replaces: theirs.stamp, sender: sender.clone(), receiver: receiver.clone() };
        self.outbox.push((peer, message));
        self.pending = Some(Pending { peer, until: now.after(ANSWER_TICKS), sender, receiver });
    }

    /// Ends a proposal that has had no answer. Call it after the messages of a tick.
    pub(super) fn expire(&mut self, now: Tick) {
        if let Some(Pending { sender, .. }) = self.pending.take_if(|pending| pending.until <= now)
            && let Some(own) = self.records.get_mut(&self.own)
        {
            // The other agent may have taken its record over: what it believes of this one is void
            // from the next stamp on.
            own.stamp = now.max(sender.stamp.next());
        }
    }

    /// Processes a message. Returns whether it changed the own record.
    pub(super) fn receive(&mut self, from: AgentId, message: Message, now: Tick) -> bool {
        match message {
            Message::Records(records) => {
                for (agent, record) in records {
                    let stamp = record.stamp;
                    self.learn(agent, record, now);
                    let known = self.known_to.entry((from, agent)).or_insert(stamp);
                    *known = stamp.max(*known);
                }
                false
            }
            Message::Proposal { replaces, sender, receiver } => {
                let is_accepted = from < self.own
                    && self.pending.is_none()
                    && sender.stamp <= now.after(STAMP_AHEAD_TICKS)
                    && receiver.stamp <= now.after(STAMP_AHEAD_TICKS)
                    && replaces < receiver.stamp
                    && self.own_record().is_some_and(|own| own.stamp == replaces)
                    && self.records.get(&from).is_none_or(|known| known.stamp < sender.stamp);
                self.outbox.push((from, Message::Answer { proposal: sender.stamp, is_accepted }));
                if is_accepted {
                    self.learn(from, sender, now);
                    self.records.insert(self.own, bounded(receiver, now));
                }
                is_accepted
            }
            Message::Answer { proposal, is_accepted } => {
                let is_awaited = |pending: &mut Pending| pending.peer == from && pending.sender.stamp == proposal;
                let Some(pending) = self.pending.take_if(is_awaited) else { return false };
                if is_accepted {
                    self.learn(from, pending.receiver, now);
                    self.records.insert(self.own, bounded(pending.sender, now));
                }
                is_accepted
            }
        }
    }

    /// Takes the record of another agent over if it is newer.
    fn learn(&mut self, agent: AgentId, record: Record, now: Tick) {
        let is_newer = self.records.get(&agent).is_none_or(|known| known.stamp < record.stamp);
        if agent != self.own && is_newer && record.stamp <= now.after(STAMP_AHEAD_TICKS) {
            self.records.insert(agent, bounded(record, now));
        }
    }

    /// The messages for the agents in contact: proposals and answers, and the records that they may
    /// not know.
    pub(super) fn messages(
        &mut self,
        contacts: impl IntoIterator<Item = AgentId>,
        now: Tick,
    ) -> Vec<(AgentId, Message)> {
        let mut messages = Vec::new();
        let mut outbox = std::mem::take(&mut self.outbox);
        for peer in contacts {
            messages.extend(outbox.extract_if(.., |(to, _)| *to == peer));
            let mut news = Vec::new();
            for (&agent, record) in &self.records {
                let is_live = agent == self.own || now < record.ends;
                let is_new = self.known_to.get(&(peer, agent)).is_none_or(|&known| known < record.stamp);
                if agent != peer && is_live && is_new {
                    self.known_to.insert((peer, agent), record.stamp);
                    news.push((agent, record.clone()));
                }
            }
            if !news.is_empty() {
                messages.push((peer, Message::Records(news)));
            }
        }
        messages
    }
}

/// The record with a bounded lease.
fn bounded(record: Record, now: Tick) -> Record {
    Record { ends: record.ends.min(now.after(LEASE_TICKS_MAX)), ..record }
}

#[cfg(test)]
mod tests;
