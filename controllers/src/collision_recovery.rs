//! Recovery after a collision with something that the map does not have: another agent.
//!
//! Waiting alone is not enough, since both agents would then run into each other again: the agent
//! moves to a clear neighbouring cell first. Random choices keep two agents from repeating the same
//! moves for ever.

use std::ops::RangeInclusive;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Ctx;
use agent::command::{Command, Motion, Stage, WakeCondition};

/// Ticks to hold after a collision: 0.5 to 4 s.
pub const HOLD_TICKS: RangeInclusive<u64> = 25..=200;

/// Moves to a random clear neighbour, if there is one, and holds there.
pub fn step_aside(rng: &mut ChaCha8Rng, ctx: &Ctx<'_>) -> Command {
    step_aside_for(HOLD_TICKS, rng, ctx)
}

/// [`step_aside`] with another time to hold.
pub fn step_aside_for(hold_ticks: RangeInclusive<u64>, rng: &mut ChaCha8Rng, ctx: &Ctx<'_>) -> Command {
    let beside = ctx.clear_neighbours();
    let motion = match beside.len() {
        0 => Motion::Keep,
        cells => Motion::Path(vec![ctx.place(beside[rng.random_range(0..cells)])]),
    };
    let until = ctx.tick().after(rng.random_range(hold_ticks));
    Command::new(motion, WakeCondition::at(until)).with_stage(Stage::Waiting).with_info("makes way")
}
