//! What an agent knows of the journals of others, and what it waits for to know more.
//!
//! Invariant: an agent knows a journal up to a position only if its map has what that reports up to
//! there.

use std::collections::BTreeMap;
use std::sync::Arc;

use msgs::ids::AgentId;

use super::decoded::{Known, Summary};
use super::map_message::Acknowledgement;
use super::peer::{Peer, peer};

/// See the module.
#[derive(Debug, Clone, Default)]
pub(super) struct Knowledge {
    known: Known,
    /// The last acknowledgements of peers that wait for those of others, and the place of this
    /// agent among their receivers.
    waiting: BTreeMap<AgentId, (Arc<Acknowledgement>, usize)>,
    /// Whether more is known since they were last gone through.
    is_overdue: bool,
}

impl Knowledge {
    /// The position in the log of each agent up to which this agent knows it.
    pub(super) fn known(&self) -> &Known {
        &self.known
    }

    /// Takes a new summary of a peer into account.
    pub(super) fn hear(&mut self, from: AgentId, summary: &Summary) {
        // What others have stated of its journal is not more than it states itself.
        self.known.set(from, self.known.of(from).min(summary.known.of(from)));
        join_if_complete(&mut self.known, summary, from);
        self.is_overdue = true;
    }

    /// Takes over an acknowledgement of what this agent, at this place among its receivers, has
    /// received: at once, or once those that it waits for have been completed.
    pub(super) fn complete(
        &mut self,
        peers: &mut Vec<Peer>,
        from: AgentId,
        acknowledgement: &Arc<Acknowledgement>,
        place: usize,
    ) {
        self.is_overdue |= !is_waiting(acknowledgement, place, &self.known);
        self.waiting.insert(from, (Arc::clone(acknowledgement), place));
        while std::mem::take(&mut self.is_overdue) {
            let before = self.waiting.len();
            let known = &mut self.known;
            self.waiting.retain(|&from, (acknowledgement, place)| {
                let is_waiting = is_waiting(acknowledgement, *place, known);
                if !is_waiting {
                    known.set(from, known.of(from).max(acknowledgement.until));
                    join_if_complete(known, &peer(peers, from).heard, from);
                }
                is_waiting
            });
            self.is_overdue = self.waiting.len() < before;
        }
    }
}

/// Whether the receiver at a place of an acknowledgement lacks what delegates send it.
fn is_waiting(acknowledgement: &Acknowledgement, place: usize, known: &Known) -> bool {
    acknowledgement.rest_from(place).any(|(agent, position)| known.of(agent) < position)
}

/// Adds the summary of a peer to what is known if its journal is known up to it.
fn join_if_complete(known: &mut Known, summary: &Summary, from: AgentId) {
    let position = summary.known.of(from);
    if position > 0 && known.of(from) >= position && !summary.state.has_contradictions {
        known.join(&summary.known);
    }
}
