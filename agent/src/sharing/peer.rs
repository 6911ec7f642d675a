//! The state of the exchanges with each peer, and where the segments of the log came from.

use std::ops::Range;
use std::sync::Arc;

use msgs::ids::{AgentId, Tick};

use super::agent_set::AgentSet;
use super::decoded::Summary;

/// The state of the exchanges with one peer.
#[derive(Debug, Clone, Default)]
pub(super) struct Peer {
    /// Its last summary.
    pub(super) heard: Arc<Summary>,
    /// Tick in which it was last sent a summary, and whether one of its own has come since then.
    pub(super) last: Option<Tick>,
    pub(super) has_replied: bool,
    /// The number of that summary, and the length of the journal then.
    pub(super) summary: u32,
    pub(super) summarised: usize,
    /// Whether it is still being sent what it lacks.
    pub(super) is_open: bool,
    /// Entries of the journal before this position are sent, or need not be.
    pub(super) cursor: usize,
    /// End of the present exchange in the journal.
    pub(super) until: usize,
    /// Bytes of updates since the last summary to it.
    pub(super) bytes: usize,
    /// Tick in which it was last sent an update.
    pub(super) updated: Option<Tick>,
    /// Updates sent since the last summary to it.
    pub(super) updates_sent: u32,
    /// Those that send it what this agent leaves to them, in the present exchange.
    pub(super) rest_from: AgentSet,
    /// Whether relay peers pass something on to it, and whether it is such a relay peer, in the
    /// present exchange.
    pub(super) is_left_to_relay_peers: bool,
    pub(super) is_relay_peer: bool,
    /// Updates received since its last summary.
    pub(super) updates_received: u32,
    /// Number of cells the peer has reported since it was last sent a summary.
    pub(super) claims: u64,
    /// Whether the peer has reported more cells than a journal has entries.
    pub(super) is_barred: bool,
}

impl Peer {
    /// Notes a summary to it, with its number and the length of the journal.
    pub(super) fn summarise(&mut self, number: u32, entries: usize) {
        (self.summary, self.summarised) = (number, entries);
        (self.is_open, self.updates_sent, self.bytes, self.claims) = (false, 0, 0, 0);
    }

    /// Begins to send it what it lacks of the journal up to its summary, from the start.
    pub(super) fn restart(&mut self) {
        (self.cursor, self.rest_from) = (0, AgentSet::default());
        (self.is_left_to_relay_peers, self.is_relay_peer) = (false, false);
    }

    /// Continues with what it lacks of the journal of `own` up to its summary.
    pub(super) fn proceed(&mut self, own: AgentId) {
        self.until = self.summarised;
        self.cursor = (self.heard.known.of(own) as usize).max(self.cursor).min(self.until);
        self.is_open = self.cursor < self.until;
    }

    /// Whether it knows a segment of the log that came from others.
    pub(super) fn knows(&self, provenance: &Provenance) -> bool {
        self.heard.known.of(provenance.from) >= provenance.until
    }
}

/// Where a segment of the log came from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Provenance {
    pub(super) positions: Range<usize>,
    pub(super) from: AgentId,
    /// Whoever knows the journal of that agent up to this position knows the segment.
    pub(super) until: u32,
}

/// The state of the exchanges with an agent.
pub(super) fn peer(peers: &mut Vec<Peer>, agent: AgentId) -> &mut Peer {
    if agent.index() >= peers.len() {
        peers.resize(agent.index() + 1, Peer::default());
    }
    &mut peers[agent.index()]
}
