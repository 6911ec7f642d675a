//! What has happened to an agent and what it has seen since it was last told.
//!
//! Invariant: what is taken with [`Untold::take`] is the same however often [`Untold::take_unasked`] was called before, so that
//! asking out of turn changes nothing.

use msgs::limits::PARCEL_BYTES_MAX;

use super::comms::Parcel;
use super::{Events, PARCEL};

/// What a parcel takes beside its data, so that empty ones count as well.
const PARCEL_BYTES_BARE: usize = 64;

/// Bytes an inbox holds at the most; a parcel that does not fit is lost. 64 full parcels: an agent that never asks for its
/// mail must not make the server grow.
const INBOX_BYTES_MAX: usize = 64 * (PARCEL_BYTES_MAX + PARCEL_BYTES_BARE);

/// What an agent is told. Cells are indices.
#[derive(Debug, Default)]
pub(super) struct News {
    pub(super) events: Events,
    pub(super) free: Vec<u32>,
    pub(super) wall: Vec<u32>,
    pub(super) parcels: Vec<Parcel>,
}

/// What an agent has not been told yet, since the last observation that counted.
#[derive(Debug, Default)]
pub(super) struct Untold {
    pub(super) events: Events,
    /// Cells in the order in which they were seen.
    pub(super) free: Vec<u32>,
    pub(super) wall: Vec<u32>,
    parcels: Vec<Parcel>,
    parcel_bytes: usize,
    asked: Asked,
}

/// How much of it was told when the agent was asked out of turn.
#[derive(Debug, Default)]
struct Asked {
    events: Events,
    free: usize,
    wall: usize,
    parcels: usize,
}

impl Untold {
    /// Puts a parcel into the inbox, unless that is full.
    pub(super) fn post(&mut self, parcel: Parcel) -> bool {
        let bytes = self.parcel_bytes + PARCEL_BYTES_BARE + parcel.data.len();
        if bytes > INBOX_BYTES_MAX {
            return false;
        }
        self.parcel_bytes = bytes;
        self.events |= PARCEL;
        self.parcels.push(parcel);
        true
    }

    /// Everything, cells ascending; nothing is left.
    pub(super) fn take(&mut self) -> News {
        let Self { events, free, wall, parcels, .. } = std::mem::take(self);
        News { events, free: sorted(free), wall: sorted(wall), parcels }
    }

    /// What is new since this was last called, cells ascending; everything is left.
    pub(super) fn take_unasked(&mut self) -> News {
        let news = News {
            events: self.events & !self.asked.events,
            free: sorted(self.free[self.asked.free..].to_vec()),
            wall: sorted(self.wall[self.asked.wall..].to_vec()),
            parcels: self.parcels[self.asked.parcels..].to_vec(),
        };
        self.asked =
            Asked { events: self.events, free: self.free.len(), wall: self.wall.len(), parcels: self.parcels.len() };
        news
    }
}

fn sorted(mut cells: Vec<u32>) -> Vec<u32> {
    cells.sort_unstable();
    cells
}
