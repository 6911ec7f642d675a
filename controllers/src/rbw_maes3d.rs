//! Random Ballistic Walk as coded in MAES3D, for comparison with its results.
//!
//! Differences from [`super::rbw`]: the first heading is that of the start, at 45 degrees upwards;
//! angles are whole degrees; half a turn goes to the right; and the agent acts one tick late after
//! a task that ended by itself, and at the start, because the status becomes idle only in the tick
//! after.

use std::f64::consts::PI;

use msgs::ids::Tick;
use protocol::event_mask::EventMask;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Controller, Ctx};
use agent::command::{Command, Motion, WakeCondition};
use agent::observation::{Observation, Surface};

const FIRST_PITCH_DEG: i32 = 45;

/// The walk of one agent.
#[derive(Debug, Clone)]
pub struct RbwMaes3d {
    rng: ChaCha8Rng,
    pitch_deg: i32,
    /// The tick in which the end of the present task is noticed.
    notices_at: Option<Tick>,
}

impl RbwMaes3d {
    /// The controller has no settings.
    #[must_use]
    pub fn new(rng: ChaCha8Rng) -> Self {
        Self { rng, pitch_deg: FIRST_PITCH_DEG, notices_at: None }
    }

    fn acts(&mut self, motion: Motion) -> Command {
        self.notices_at = None;
        Command::new(motion, WakeCondition::TASK_DONE)
    }
}

impl Controller for RbwMaes3d {
    fn decide(&mut self, observation: &Observation, _ctx: &mut Ctx<'_>) -> Command {
        if observation.is_active {
            return Command::keep(WakeCondition::TASK_DONE);
        }
        let surface = observation.collision.map(|collision| collision.surface);
        if surface.is_none() {
            let notices_at = *self.notices_at.get_or_insert(observation.tick.after(1));
            if observation.tick < notices_at {
                return Command::keep(WakeCondition { at: notices_at, events: EventMask::empty() });
            }
        }
        match surface {
            Some(Surface::Wall) => {
                let right_deg = self.rng.random_range(90..270);
                return self.acts(Motion::turn(-degrees(right_deg)));
            }
            Some(Surface::Floor) => self.pitch_deg = self.rng.random_range(15..45),
            Some(Surface::Ceiling) => self.pitch_deg = -self.rng.random_range(15..45),
            None => {}
        }
        let pitch_rad = degrees(self.pitch_deg);
        self.acts(Motion::Move { pitch_rad, distance_m: f64::INFINITY })
    }
}

fn degrees(angle_deg: i32) -> f64 {
    f64::from(angle_deg) * PI / 180.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{World, collided, idle};

    fn walk() -> RbwMaes3d {
        RbwMaes3d::new(voxels::random_streams::stream(1, 0, "test"))
    }

    #[test]
    fn waits_a_tick_then_moves_at_45_degrees() {
        let mut world = World::empty();
        let mut rbw = walk();
        let mut observation = idle();
        let keep = world.ask_about(&mut rbw, &observation);
        assert_eq!(keep, Command::keep(WakeCondition { at: Tick(1), events: EventMask::empty() }));
        observation.tick = Tick(1);
        let go = world.ask_about(&mut rbw, &observation);
        assert_eq!(go.motion, Motion::Move { pitch_rad: degrees(45), distance_m: f64::INFINITY });
    }

    #[test]
    fn acts_at_once_after_a_collision_in_whole_degrees() {
        let mut world = World::empty();
        let mut rbw = walk();
        let mut seen = std::collections::BTreeSet::new();
        for _ in 0..2000 {
            let up = world.ask_about(&mut rbw, &collided(idle(), Surface::Floor));
            let Motion::Move { pitch_rad, .. } = up.motion else { panic!("{up:?}") };
            seen.insert((pitch_rad * 180.0 / PI).round() as i32);
        }
        assert_eq!(seen, (15..45).collect());
        seen.clear();
        for _ in 0..5000 {
            let turn = world.ask_about(&mut rbw, &collided(idle(), Surface::Wall));
            let Motion::Turn { angle_rad } = turn.motion else { panic!("{turn:?}") };
            seen.insert((angle_rad * 180.0 / PI).round() as i32);
        }
        assert_eq!(seen, (-180..=-90).chain(91..180).collect());
    }
}
