//! The pending observation of an agent: events, seen cells and messages since the last committed
//! observation.
//!
//! Invariant: [`PendingObservation::commit`] returns the same however often
//! [`PendingObservation::speculate`] was called before, so look-ahead does not change a run.

use protocol::event_mask::EventMask;
use protocol::limits::AGENT_MESSAGE_BYTES_MAX;

use protocol::agent_message::AgentMessage;

/// Bytes charged for a message in addition to its data, so that empty messages fill an inbox as
/// well.
const AGENT_MESSAGE_BYTES_BARE: usize = 64;

/// Capacity of an inbox in bytes, 64 messages of the largest size; a message that does not fit is
/// lost. It bounds the memory that an agent which is never due can take.
const INBOX_BYTES_MAX: usize = 64 * (AGENT_MESSAGE_BYTES_MAX + AGENT_MESSAGE_BYTES_BARE);

/// The content of an observation that is new to its agent. Cells are ascending indices.
#[derive(Debug, Default)]
pub(super) struct ObservationDelta {
    pub(super) events: EventMask,
    pub(super) free: Vec<u32>,
    pub(super) wall: Vec<u32>,
    pub(super) messages: Vec<AgentMessage>,
}

/// Events, cells and messages since the last committed observation.
#[derive(Debug, Default)]
pub(super) struct PendingObservation {
    pub(super) events: EventMask,
    /// Cell indices in the order in which they were seen.
    pub(super) free: Vec<u32>,
    pub(super) wall: Vec<u32>,
    messages: Vec<AgentMessage>,
    message_bytes: usize,
    cursor: Cursor,
}

/// How much of the pending observation speculative observations have contained.
#[derive(Debug, Default)]
struct Cursor {
    events: EventMask,
    free: usize,
    wall: usize,
    messages: usize,
}

impl PendingObservation {
    /// Adds a message to the inbox; returns false, and drops it, if the inbox is full.
    pub(super) fn post(&mut self, message: AgentMessage) -> bool {
        let bytes = self.message_bytes + AGENT_MESSAGE_BYTES_BARE + message.data.len();
        if bytes > INBOX_BYTES_MAX {
            return false;
        }
        self.message_bytes = bytes;
        self.events |= EventMask::MESSAGE;
        self.messages.push(message);
        true
    }

    /// Adds a message of the server to the agent: no event, and outside the capacity of the inbox.
    pub(super) fn tell(&mut self, message: AgentMessage) {
        self.messages.push(message);
    }

    /// Drops what is pending about cells that have changed since, which ascend, and returns them.
    pub(super) fn forget(&mut self, changed: &[u32]) -> Vec<u32> {
        let mut dropped = Vec::new();
        for (cells, cursor) in [(&mut self.free, &mut self.cursor.free), (&mut self.wall, &mut self.cursor.wall)] {
            let is_changed = |cell: &u32| changed.binary_search(cell).is_ok();
            *cursor -= cells[..*cursor].iter().filter(|cell| is_changed(cell)).count();
            dropped.extend(cells.extract_if(.., |cell| is_changed(cell)));
        }
        dropped
    }

    /// Takes everything that is pending.
    pub(super) fn commit(&mut self) -> ObservationDelta {
        let Self { events, free, wall, messages, .. } = std::mem::take(self);
        ObservationDelta { events, free: sorted(free), wall: sorted(wall), messages }
    }

    /// Copies what is new since the last call; everything stays pending.
    pub(super) fn speculate(&mut self) -> ObservationDelta {
        let delta = ObservationDelta {
            events: self.events & !self.cursor.events,
            free: sorted(self.free[self.cursor.free..].to_vec()),
            wall: sorted(self.wall[self.cursor.wall..].to_vec()),
            messages: self.messages[self.cursor.messages..].to_vec(),
        };
        self.cursor =
            Cursor { events: self.events, free: self.free.len(), wall: self.wall.len(), messages: self.messages.len() };
        delta
    }
}

fn sorted(mut cells: Vec<u32>) -> Vec<u32> {
    cells.sort_unstable();
    cells
}
