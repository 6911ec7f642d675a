//! The digest of a run: a hash chain over its ticks, equal for two runs exactly if they are equal.
//!
//! The link of a tick is the BLAKE3 hash of the previous link, the interventions before the tick,
//! its messages (committed observations and commands, as CDR, in the order of the agents), and the
//! state of the world at its end, bit by bit: tick, bodies with their energy if they need any
//! and what they believe if localisation drifts,
//! coverage, and relays if there are any.
//!
//! The session decides which messages are committed.

mod links;
#[cfg(test)]
mod tests;

use std::fmt;
use std::sync::Arc;

use msgs::ids::Tick;

use links::{Links, Piece};
use protocol::observation::{Pose, Surface};
use world::workers::Workers;
use world::{ExploredShares, Presence, World};

/// The digest up to and including a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Digest(pub [u8; 32]);

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        blake3::Hash::from_bytes(self.0).fmt(f)
    }
}

/// The hash chain of a run.
///
/// The explored share at the end of a tick may follow later ([`World::flush_scans`]); until then,
/// the bytes of the ticks are kept. Helpers hash, if there are any, while the run continues.
#[derive(Debug)]
pub struct Chain {
    links: Links,
    /// What was not passed on to be hashed.
    bytes: Vec<u8>,
    /// The ends in `bytes` of the ticks whose bytes are complete; those after them are not.
    ends: Vec<usize>,
    /// The closed ticks in `bytes` after those.
    closed: Vec<ClosedTick>,
}

/// So many bytes are passed on at once: enough to be worth waking a helper.
const PIECE_BYTES: usize = 1 << 16;

/// A tick whose explored share is not known.
#[derive(Debug, Clone, Copy)]
struct ClosedTick {
    /// The tick after it.
    next: Tick,
    /// Where the share belongs in the bytes.
    explored_at: usize,
    /// The end of the bytes of this tick.
    end: usize,
}

impl Chain {
    /// The chain of a run of this scenario (see [`crate::scenario::Scenario::identity`]) in this
    /// world, before its first tick.
    #[must_use]
    pub fn new(identity: &str, world: &World, workers: Arc<Workers>) -> Self {
        let (bytes, ends, closed) = Default::default();
        let mut chain = Self { links: Links::new(workers), bytes, ends, closed };
        chain.bytes.extend_from_slice(identity.as_bytes());
        chain.bytes.extend_from_slice(mapgen::terrain_hash(world.terrain()).as_bytes());
        chain.close(world);
        chain
    }

    /// Adds a message of the present tick.
    pub fn message(&mut self, cdr: &[u8]) {
        self.bytes.extend_from_slice(&(cdr.len() as u64).to_le_bytes());
        self.bytes.extend_from_slice(cdr);
        if self.closed.is_empty() && self.bytes.len() >= PIECE_BYTES {
            self.pass_on(self.bytes.len());
        }
    }

    /// Number of bytes that are kept, because an explored share is missing or as they are few.
    #[must_use]
    pub fn kept_bytes(&self) -> usize {
        self.bytes.len()
    }

    /// Ends a tick with the state of the world. If that is not settled, [`Chain::resolve`] has to
    /// follow.
    ///
    /// # Panics
    /// If the world was settled without that.
    pub fn close(&mut self, world: &World) {
        let bytes = &mut self.bytes;
        bytes.extend_from_slice(&world.tick().0.to_le_bytes());
        for agent in world.agents() {
            let body = world.body(agent);
            let pose = body.pose();
            let velocity = body.velocity_in_map_m_s();
            for number in [
                pose.position.x,
                pose.position.y,
                pose.position.z,
                pose.yaw_rad,
                velocity.x,
                velocity.y,
                velocity.z,
                body.yaw_rate_rad_s(),
            ] {
                bytes.extend_from_slice(&number.to_bits().to_le_bytes());
            }
            let surface = match body.collision().map(|collision| collision.surface) {
                None => 0,
                Some(Surface::Wall) => 1,
                Some(Surface::Floor) => 2,
                Some(Surface::Ceiling) => 3,
            };
            let with_agent = body.collision().is_some_and(|hit| hit.with_agent);
            bytes.extend_from_slice(&[u8::from(body.is_active()), surface, u8::from(with_agent)]);
            // Runs without events keep the digest they had before events existed.
            let (presence, is_on_air) = (world.presence(agent), world.is_on_air(agent));
            if presence != Presence::Active || !is_on_air {
                bytes.extend_from_slice(&[presence as u8, u8::from(is_on_air)]);
            }
            if let Some(frames) = world.frames(agent) {
                let Pose { position, yaw_rad } = frames.odometry;
                for number in position.iter().chain(frames.map_offset_m.iter()).chain([&yaw_rad]) {
                    bytes.extend_from_slice(&number.to_bits().to_le_bytes());
                }
            }
            if let Some(energy) = world.energy(agent) {
                bytes.extend_from_slice(&energy.left_j.to_bits().to_le_bytes());
            }
        }
        for obstacle in world.moving_obstacles() {
            for along in obstacle.centre.iter() {
                bytes.extend_from_slice(&along.to_bits().to_le_bytes());
            }
        }
        let explored_at = bytes.len();
        bytes.extend_from_slice(&0_f64.to_bits().to_le_bytes());
        bytes.extend_from_slice(&world.covered().to_bits().to_le_bytes());
        // Runs without relays keep the digest they had before relays existed.
        for relay in world.relays() {
            bytes.extend_from_slice(&relay.id.on_wire().to_le_bytes());
            bytes.extend_from_slice(&relay.writings.to_le_bytes());
            for along in relay.position.iter() {
                bytes.extend_from_slice(&along.to_bits().to_le_bytes());
            }
        }
        self.closed.push(ClosedTick { next: world.tick(), explored_at, end: bytes.len() });
        if world.has_no_pending_scans() {
            assert_eq!(self.closed.len(), 1, "the shares of earlier ticks were dropped");
            let explored = world.coverage().explored();
            self.complete(|_| explored);
        }
    }

    /// Ends the ticks whose explored shares are known now.
    pub fn resolve(&mut self, shares: &ExploredShares) {
        self.complete(|next| shares.at_start_of(next));
    }

    /// Completes the closed ticks, given the explored share at the start of the tick after each.
    fn complete(&mut self, explored: impl Fn(Tick) -> f64) {
        for ClosedTick { next, explored_at, end } in self.closed.drain(..) {
            let share = explored(next).to_bits().to_le_bytes();
            self.bytes[explored_at..explored_at + share.len()].copy_from_slice(&share);
            self.ends.push(end);
        }
        if let Some(&end) = self.ends.last()
            && end >= PIECE_BYTES
        {
            self.pass_on(end);
        }
    }

    /// Has the complete ticks hashed, and what else is before `end`.
    fn pass_on(&mut self, end: usize) {
        let mut rest = Vec::with_capacity(2 * PIECE_BYTES);
        rest.extend_from_slice(&self.bytes[end..]);
        let mut bytes = std::mem::replace(&mut self.bytes, rest);
        bytes.truncate(end);
        self.links.add(Piece { bytes, ends: std::mem::take(&mut self.ends) });
    }

    /// The digest up to the last closed tick.
    ///
    /// # Panics
    /// If the explored share of a closed tick is not known: see [`Chain::resolve`].
    pub fn digest(&mut self) -> Digest {
        assert!(self.closed.is_empty(), "the digest is read while scans are not counted");
        if let Some(&end) = self.ends.last() {
            self.pass_on(end);
        }
        self.links.last()
    }
}
