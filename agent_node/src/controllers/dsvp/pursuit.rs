//! Last known positions of the other agents: where to carry news to when nothing is left to
//! explore.
//!
//! M-TARE (Cao et al., Science Robotics 2023) calls meeting on purpose a pursuit; here it is taken
//! up only by an agent that knows no frontier.

use msgs::ids::{AgentId, Tick};
use voxels::{Cell, Extent};

use super::goal::Goal;
use crate::observation::Contact;

/// Where and when each agent was last in contact, by agent.
#[derive(Debug, Clone, Default)]
pub(super) struct LastKnownPositions(Vec<Option<LastKnown>>);

#[derive(Debug, Clone, Copy)]
struct LastKnown {
    cell: Cell,
    seen: Tick,
    /// This agent has been there since and has not found it.
    is_absent: bool,
}

impl LastKnownPositions {
    /// Records the positions of the agents in contact.
    pub(super) fn record(&mut self, contacts: &[Contact], extent: Extent, now: Tick) {
        for contact in contacts {
            let cell = extent.cell_of(&contact.position);
            let place = contact.agent.index();
            if place >= self.0.len() {
                self.0.resize(place + 1, None);
            }
            self.0[place] = Some(LastKnown { cell, seen: now, is_absent: false });
        }
    }

    /// Marks an agent as absent from its last known position.
    pub(super) fn mark_absent(&mut self, agent: AgentId) {
        if let Some(Some(last_known)) = self.0.get_mut(agent.index()) {
            last_known.is_absent = true;
        }
    }

    /// The agents out of contact that may still be at their last known positions, longest out of
    /// contact first, as goals.
    pub(super) fn candidates(&self, contacts: &[Contact], here: Cell) -> impl Iterator<Item = Goal> + use<> {
        let is_in_contact = |agent: AgentId| contacts.binary_search_by_key(&agent, |contact| contact.agent).is_ok();
        let known = (0..).map(AgentId).zip(&self.0).filter_map(|(agent, known)| Some((agent, known.as_ref()?)));
        let candidates = known
            .filter(|(agent, last_known)| !is_in_contact(*agent) && !last_known.is_absent && last_known.cell != here);
        let mut candidates: Vec<(Tick, AgentId, Cell)> =
            candidates.map(|(agent, last_known)| (last_known.seen, agent, last_known.cell)).collect();
        candidates.sort_unstable();
        candidates.into_iter().map(|(_, agent, cell)| Goal::Pursuit { agent, cell })
    }
}
