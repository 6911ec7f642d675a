//! Where to carry news to when nothing is left to explore: to agents that may have something left,
//! at their last known positions.
//!
//! M-TARE (Cao et al., Science Robotics 2023) calls meeting on purpose a pursuit; here it is taken
//! up only by an agent that knows no frontier. Agents tell each other who has none: a map without
//! frontiers lacks nothing that others could bring. When all are known to have none, the team
//! rests.
//!
//! Invariants: who has had nothing left once is not pursued any more; a malformed message changes
//! nothing.

use std::collections::BTreeSet;

use msgs::ids::{AgentId, Tick};
use voxels::{Cell, Extent};

use super::goal::Goal;
use crate::command::Command;
use crate::observation::{Contact, Observation, ReceivedMessage};

/// The mark of messages that tell which agents have nothing left to explore.
pub const FINISHED_MESSAGE: u8 = 4;

const VERSION: u8 = 1;

/// Bytes of an id.
const ID_BYTES: usize = 4;

/// What an agent knows of those that it could bring its map to.
#[derive(Debug, Clone)]
pub(super) struct Pursuit {
    own: AgentId,
    agents: u32,
    /// Where and when each agent was last in contact, by agent.
    last_known: Vec<Option<LastKnown>>,
    /// The agents that have nothing left to explore.
    finished: BTreeSet<AgentId>,
    /// Whether the agents in contact have not been told of all of them.
    has_news: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct LastKnown {
    cell: Cell,
    seen: Tick,
    /// This agent has been there since and has not found it.
    is_absent: bool,
}

impl Pursuit {
    /// That of one agent of a team, before it has met others.
    pub(super) fn new(own: AgentId, agents: u32) -> Self {
        Self { own, agents, last_known: Vec::new(), finished: BTreeSet::new(), has_news: false }
    }

    /// Records the agents in contact and what they tell.
    pub(super) fn receive(&mut self, observation: &Observation, extent: Extent) {
        for contact in &observation.contacts {
            let cell = extent.cell_of(&contact.position);
            let place = contact.agent.index();
            if place >= self.last_known.len() {
                self.last_known.resize(place + 1, None);
            }
            self.last_known[place] = Some(LastKnown { cell, seen: observation.tick, is_absent: false });
        }
        for ReceivedMessage { kind, data, .. } in &observation.messages {
            if *kind == FINISHED_MESSAGE {
                self.add(decode(data, self.agents).unwrap_or_default());
            }
        }
    }

    /// Notes that this agent knows no frontier.
    pub(super) fn finish(&mut self) {
        self.add([self.own]);
    }

    fn add(&mut self, finished: impl IntoIterator<Item = AgentId>) {
        for agent in finished {
            self.has_news |= self.finished.insert(agent);
        }
    }

    /// Adds the message for the agents in contact to a command, if there is something to tell.
    /// `has_met` tells whether they may be others than before.
    pub(super) fn with_message(&mut self, command: Command, contacts: &[Contact], has_met: bool) -> Command {
        if contacts.is_empty() || self.finished.is_empty() || !(has_met || self.has_news) {
            return command;
        }
        self.has_news = false;
        command.with_message(None, FINISHED_MESSAGE, encode(&self.finished))
    }

    /// Marks an agent as absent from its last known position.
    pub(super) fn mark_absent(&mut self, agent: AgentId) {
        if let Some(Some(last_known)) = self.last_known.get_mut(agent.index()) {
            last_known.is_absent = true;
        }
    }

    /// Whether an agent is out of contact and not known to have nothing left to explore.
    pub(super) fn is_sought(&self, agent: AgentId, contacts: &[Contact]) -> bool {
        let is_in_contact = contacts.binary_search_by_key(&agent, |contact| contact.agent).is_ok();
        agent != self.own && !is_in_contact && !self.finished.contains(&agent)
    }

    /// Whether there is any agent to bring the map to.
    pub(super) fn seeks_any(&self, contacts: &[Contact]) -> bool {
        (0..self.agents).any(|agent| self.is_sought(AgentId(agent), contacts))
    }

    /// Whether all agents of the team have nothing left to explore.
    pub(super) fn have_all_finished(&self) -> bool {
        self.finished.len() == self.agents as usize
    }

    /// The agents sought that may still be at their last known positions, longest out of contact
    /// first, as goals.
    pub(super) fn candidates(&self, contacts: &[Contact], here: Cell) -> impl Iterator<Item = Goal> + use<> {
        let known = (0..).map(AgentId).zip(&self.last_known).filter_map(|(agent, known)| Some((agent, (*known)?)));
        let mut candidates: Vec<(Tick, AgentId, Cell)> = known
            .filter(|&(agent, known)| self.is_sought(agent, contacts) && !known.is_absent && known.cell != here)
            .map(|(agent, known)| (known.seen, agent, known.cell))
            .collect();
        candidates.sort_unstable();
        candidates.into_iter().map(|(_, agent, cell)| Goal::Pursuit { agent, cell })
    }
}

/// The version, and each id as a uint32.
fn encode(finished: &BTreeSet<AgentId>) -> Vec<u8> {
    let ids = finished.iter().flat_map(|agent| agent.0.to_le_bytes());
    std::iter::once(VERSION).chain(ids).collect()
}

/// The agents of a message, or nothing if it is malformed.
fn decode(data: &[u8], agents: u32) -> Option<Vec<AgentId>> {
    let (&VERSION, ids) = data.split_first()? else { return None };
    let (ids, rest) = ids.as_chunks::<ID_BYTES>();
    let finished: Vec<AgentId> = ids.iter().map(|&id| AgentId(u32::from_le_bytes(id))).collect();
    (rest.is_empty() && finished.iter().all(|agent| agent.0 < agents)).then_some(finished)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_as_written_and_malformed_ones_are_refused() {
        let finished: BTreeSet<_> = [AgentId(0), AgentId(6)].into();
        let bytes = encode(&finished);
        assert_eq!(bytes, [1, 0, 0, 0, 0, 6, 0, 0, 0]);
        assert_eq!(decode(&bytes, 7), Some(finished.into_iter().collect()));
        assert_eq!(decode(&bytes, 6), None, "an agent that is not of the team");
        assert_eq!(decode(&bytes[..8], 7), None, "cut off");
        assert_eq!(decode(&[2, 0, 0, 0, 0], 7), None, "of another version");
        assert_eq!(decode(&[], 7), None);
    }
}
