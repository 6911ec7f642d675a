//! What has happened to an agent and what it has seen since it was last told.
//!
//! Invariant: what is taken with [`PendingObservation::take`] is the same however often [`PendingObservation::speculate`] was called before, so that
//! asking out of turn changes nothing.

use msgs::limits::PARCEL_BYTES_MAX;

use super::comms::AgentMessage;
use super::{Events, PARCEL};

/// What a message takes beside its data, so that empty ones count as well.
const PARCEL_BYTES_BARE: usize = 64;

/// Bytes an inbox holds at the most; a message that does not fit is lost. 64 full messages: an agent that never asks for its
/// mail must not make the server grow.
const INBOX_BYTES_MAX: usize = 64 * (PARCEL_BYTES_MAX + PARCEL_BYTES_BARE);

/// What an agent is told. Cells are indices.
#[derive(Debug, Default)]
pub(super) struct ObservationDelta {
    pub(super) events: Events,
    pub(super) free: Vec<u32>,
    pub(super) wall: Vec<u32>,
    pub(super) messages: Vec<AgentMessage>,
}

/// What an agent has not been told yet, since the last observation that counted.
#[derive(Debug, Default)]
pub(super) struct PendingObservation {
    pub(super) events: Events,
    /// Cells in the order in which they were seen.
    pub(super) free: Vec<u32>,
    pub(super) wall: Vec<u32>,
    messages: Vec<AgentMessage>,
    message_bytes: usize,
    watermark: Watermark,
}

/// How much of it was told when the agent was asked out of turn.
#[derive(Debug, Default)]
struct Watermark {
    events: Events,
    free: usize,
    wall: usize,
    messages: usize,
}

impl PendingObservation {
    /// Puts a message into the inbox, unless that is full.
    pub(super) fn post(&mut self, message: AgentMessage) -> bool {
        let bytes = self.message_bytes + PARCEL_BYTES_BARE + message.data.len();
        if bytes > INBOX_BYTES_MAX {
            return false;
        }
        self.message_bytes = bytes;
        self.events |= PARCEL;
        self.messages.push(message);
        true
    }

    /// Everything, cells ascending; nothing is left.
    pub(super) fn commit(&mut self) -> ObservationDelta {
        let Self { events, free, wall, messages, .. } = std::mem::take(self);
        ObservationDelta { events, free: sorted(free), wall: sorted(wall), messages }
    }

    /// What is new since this was last called, cells ascending; everything is left.
    pub(super) fn speculate(&mut self) -> ObservationDelta {
        let delta = ObservationDelta {
            events: self.events & !self.watermark.events,
            free: sorted(self.free[self.watermark.free..].to_vec()),
            wall: sorted(self.wall[self.watermark.wall..].to_vec()),
            messages: self.messages[self.watermark.messages..].to_vec(),
        };
        self.watermark = Watermark {
            events: self.events,
            free: self.free.len(),
            wall: self.wall.len(),
            messages: self.messages.len(),
        };
        delta
    }
}

fn sorted(mut cells: Vec<u32>) -> Vec<u32> {
    cells.sort_unstable();
    cells
}
