//! What to do when something is in the way that the map does not have: another agent.
//!
//! A wait alone would not do, for both would go on against each other; so the agent first goes to a cell beside it, if one is clear.
//! Chance sees to it that two agents do not do the same for ever.

use std::ops::RangeInclusive;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Ctx;
use crate::command::{Command, Motion, Trigger};

/// Ticks to keep out of the way after a collision: 0.5 to 4 s.
pub const HOLD_TICKS: RangeInclusive<u64> = 25..=200;

/// Steps aside at random, and waits there for a moment.
pub fn step_aside(rng: &mut ChaCha8Rng, ctx: &Ctx<'_>) -> Command {
    let beside = ctx.clear_neighbours();
    let motion = match beside.len() {
        0 => Motion::Keep,
        cells => Motion::Path(vec![ctx.map().extent().centre(beside[rng.random_range(0..cells)])]),
    };
    let until = ctx.tick().after(rng.random_range(HOLD_TICKS));
    Command::new(motion, Trigger::at(until)).with_info("makes way")
}
