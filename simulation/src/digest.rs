//! The digest of a run: a hash chain over its ticks, equal for two runs exactly if they are equal.
//!
//! The link of a tick is the BLAKE3 hash of the previous link, the interventions before the tick,
//! its messages (committed observations and commands, as CDR, in the order of the agents), and the
//! state of the world at its end, bit by bit: tick, bodies, coverage, and relays if there are any.
//!
//! The session decides which messages are committed.

use std::fmt;

use msgs::ids::Tick;

use crate::world::collision::Surface;
use crate::world::{ExploredShares, Presence, World};

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
/// The explored share at the end of a tick may follow later ([`World::settle`]); until then, the
/// bytes of the ticks are kept.
#[derive(Debug, Clone)]
pub struct Chain {
    link: Digest,
    hasher: blake3::Hasher,
    /// What is not hashed yet.
    bytes: Vec<u8>,
    /// The closed ticks in `bytes`.
    closed: Vec<ClosedTick>,
}

/// A message of so many bytes is not copied to be hashed with others. Shorter ones are: BLAKE3 is
/// slow for few bytes at a time.
const HASHED_AT_ONCE: usize = 1 << 14;

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
    pub fn new(identity: &str, world: &World) -> Self {
        let hasher = blake3::Hasher::new();
        let mut chain = Self { link: Digest([0; 32]), hasher, bytes: Vec::new(), closed: Vec::new() };
        chain.bytes.extend_from_slice(identity.as_bytes());
        chain.bytes.extend_from_slice(mapgen::terrain_hash(world.terrain()).as_bytes());
        chain.close(world);
        chain
    }

    /// Adds a message of the present tick.
    pub fn message(&mut self, cdr: &[u8]) {
        self.bytes.extend_from_slice(&(cdr.len() as u64).to_le_bytes());
        if cdr.len() < HASHED_AT_ONCE || !self.closed.is_empty() {
            self.bytes.extend_from_slice(cdr);
        } else {
            self.hasher.update(&self.bytes).update(cdr);
            self.bytes.clear();
        }
    }

    /// Number of bytes that wait to be hashed.
    #[must_use]
    pub fn waiting_bytes(&self) -> usize {
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
        if world.is_settled() {
            assert_eq!(self.closed.len(), 1, "the shares of earlier ticks were dropped");
            let explored = world.coverage().explored();
            self.hash_closed(|_| explored);
        }
    }

    /// Ends the ticks whose explored shares are known now.
    pub fn resolve(&mut self, shares: &ExploredShares) {
        self.hash_closed(|next| shares.at_start_of(next));
    }

    /// Hashes the closed ticks, given the explored share at the start of the tick after each.
    fn hash_closed(&mut self, explored: impl Fn(Tick) -> f64) {
        let mut start = 0;
        for ClosedTick { next, explored_at, end } in self.closed.drain(..) {
            let share = explored(next).to_bits().to_le_bytes();
            self.bytes[explored_at..explored_at + share.len()].copy_from_slice(&share);
            self.hasher.update(&self.bytes[start..end]);
            self.link = Digest(*self.hasher.finalize().as_bytes());
            self.hasher.reset();
            self.hasher.update(&self.link.0);
            start = end;
        }
        self.bytes.drain(..start);
    }

    /// The digest up to the last closed tick.
    ///
    /// # Panics
    /// If the explored share of a closed tick is not known: see [`Chain::resolve`].
    #[must_use]
    pub fn digest(&self) -> Digest {
        assert!(self.closed.is_empty(), "the digest is read while scans are not counted");
        self.link
    }
}
