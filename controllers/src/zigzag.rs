//! Zigzag: straight on until a collision, then a turn to a random side.

use std::f64::consts::PI;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::settings::{SettingError, Settings};
use super::{Controller, Ctx};
use agent::command::{Command, Motion, WakeCondition};
use agent::observation::Observation;

/// The zigzag of one agent.
#[derive(Debug, Clone)]
pub struct Zigzag {
    rng: ChaCha8Rng,
    turn_rad: f64,
}

impl Zigzag {
    /// Settings: `turn_rad`, the angle of a turn.
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn new(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let turn_rad = settings.number("turn_rad", 2.0, 0.0, PI)?;
        Ok(Self { rng, turn_rad })
    }
}

impl Controller for Zigzag {
    fn decide(&mut self, observation: &Observation, _ctx: &mut Ctx<'_>) -> Command {
        if observation.is_active {
            return Command::keep(WakeCondition::TASK_DONE);
        }
        if observation.collision.is_some() {
            let sign = if self.rng.random::<bool>() { 1.0 } else { -1.0 };
            let turn = Motion::turn(sign * self.turn_rad);
            return Command::new(turn, WakeCondition::TASK_DONE).with_info("turns");
        }
        let straight = Motion::straight(0.0, f64::INFINITY);
        Command::new(straight, WakeCondition::TASK_DONE).with_info("moves straight on")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{World, collided, idle};
    use agent::observation::Surface;

    #[test]
    fn turns_at_a_wall() {
        let rng = voxels::random_streams::stream(1, 0, "test");
        let mut zigzag = Zigzag::new(&mut Settings::default(), rng).unwrap();
        let mut world = World::empty();
        let first = world.ask_about(&mut zigzag, &idle()).motion;
        assert_eq!(first, Motion::straight(0.0, f64::INFINITY));
        let turn = world.ask_about(&mut zigzag, &collided(idle(), Surface::Wall)).motion;
        let Motion::Turn { angle_rad } = turn else { panic!("{turn:?}") };
        assert!((angle_rad.abs() - 2.0).abs() < 1e-9);
    }
}
