//! The digest of a run: a hash chain over its ticks, equal for two runs exactly if they are equal.
//!
//! The link of a tick is the BLAKE3 hash of the previous link, the interventions before the tick,
//! its messages (committed observations and commands, as CDR, in the order of the agents), and the
//! state of the world at its end, bit by bit: tick, bodies, coverage, and relays if there are any.
//!
//! The session decides which messages are committed.

use std::fmt;

use crate::world::collision::Surface;
use crate::world::{Presence, World};

/// The digest up to and including a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Digest(pub [u8; 32]);

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        blake3::Hash::from_bytes(self.0).fmt(f)
    }
}

/// The hash chain of a run.
#[derive(Debug, Clone)]
pub struct Chain {
    link: Digest,
    hasher: blake3::Hasher,
}

impl Chain {
    /// The chain of a run of this scenario (see [`crate::scenario::Scenario::identity`]) in this
    /// world, before its first tick.
    #[must_use]
    pub fn new(identity: &str, world: &World) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(identity.as_bytes());
        hasher.update(mapgen::terrain_hash(world.terrain()).as_bytes());
        let mut chain = Self { link: Digest([0; 32]), hasher };
        chain.close(world);
        chain
    }

    /// Adds a message of the present tick.
    pub fn message(&mut self, cdr: &[u8]) {
        self.hasher.update(&(cdr.len() as u64).to_le_bytes());
        self.hasher.update(cdr);
    }

    /// Ends a tick with the state of the world.
    pub fn close(&mut self, world: &World) {
        self.hasher.update(&world.tick().0.to_le_bytes());
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
                self.hasher.update(&number.to_bits().to_le_bytes());
            }
            let surface = match body.collision().map(|collision| collision.surface) {
                None => 0,
                Some(Surface::Wall) => 1,
                Some(Surface::Floor) => 2,
                Some(Surface::Ceiling) => 3,
            };
            let with_agent = body.collision().is_some_and(|hit| hit.with_agent);
            self.hasher.update(&[u8::from(body.is_active()), surface, u8::from(with_agent)]);
            // Runs without events keep the digest they had before events existed.
            let (presence, is_on_air) = (world.presence(agent), world.is_on_air(agent));
            if presence != Presence::Active || !is_on_air {
                self.hasher.update(&[presence as u8, u8::from(is_on_air)]);
            }
        }
        for share in [world.coverage().explored(), world.coverage().covered()] {
            self.hasher.update(&share.to_bits().to_le_bytes());
        }
        // Runs without relays keep the digest they had before relays existed.
        for relay in world.relays() {
            self.hasher.update(&relay.id.on_wire().to_le_bytes());
            self.hasher.update(&relay.writings.to_le_bytes());
            for along in relay.position.iter() {
                self.hasher.update(&along.to_bits().to_le_bytes());
            }
        }
        self.link = Digest(*self.hasher.finalize().as_bytes());
        self.hasher.reset();
        self.hasher.update(&self.link.0);
    }

    /// The digest up to the last closed tick.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.link
    }
}
