//! Where other agents were last.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use voxels::{Cell, Extent};

use super::goal::Goal;
use crate::observation::Contact;

/// The agents that have been met.
#[derive(Debug, Clone, Default)]
pub(super) struct Peers(BTreeMap<AgentId, Peer>);

#[derive(Debug, Clone, Copy)]
struct Peer {
    cell: Cell,
    met: Tick,
    /// It has been looked for there since.
    is_gone: bool,
}

impl Peers {
    /// Notes who is in contact.
    pub(super) fn meet(&mut self, contacts: &[Contact], extent: Extent, now: Tick) {
        for contact in contacts {
            let cell = extent.cell_of(&contact.position);
            self.0.insert(contact.agent, Peer { cell, met: now, is_gone: false });
        }
    }

    /// Notes that an agent is not where it was.
    pub(super) fn note_gone(&mut self, agent: AgentId) {
        if let Some(peer) = self.0.get_mut(&agent) {
            peer.is_gone = true;
        }
    }

    /// Those out of contact that may be where they were, the one not met for longest first, as goals.
    pub(super) fn away(&self, contacts: &[Contact], here: Cell) -> impl Iterator<Item = Goal> + use<> {
        let is_heard = |agent: AgentId| contacts.iter().any(|contact| contact.agent == agent);
        let away = self.0.iter().filter(|(agent, peer)| !is_heard(**agent) && !peer.is_gone && peer.cell != here);
        let mut away: Vec<(Tick, AgentId, Cell)> = away.map(|(&agent, peer)| (peer.met, agent, peer.cell)).collect();
        away.sort_unstable();
        away.into_iter().map(|(_, agent, cell)| Goal::Peer { agent, cell })
    }
}
