//! Random Ballistic Walk: straight until a collision, then off in another direction.
//!
//! As in the papers on MAES3D: the first heading is random; after a collision with a floor the
//! agent continues upwards, with a ceiling downwards, with a wall it turns by a random angle. A
//! body that need not turn first moves in the new direction at once. The map is not used.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::settings::{SettingError, Settings};
use super::{Controller, Ctx};
use agent::command::{Command, Motion, WakeCondition};
use agent::observation::{Observation, Surface};

/// Elevation before the first floor or ceiling: the reference's 45 degrees.
const FIRST_PITCH_RAD: f64 = PI / 4.0;

/// The walk of one agent.
#[derive(Debug, Clone)]
pub struct Rbw {
    rng: ChaCha8Rng,
    pitch_rad: f64,
    /// Last direction of a body that need not turn first.
    heading_rad: Option<f64>,
    pitch_min_rad: f64,
    pitch_max_rad: f64,
    turn_min_rad: f64,
    turn_max_rad: f64,
}

impl Rbw {
    /// Settings: `pitch_min_rad`, `pitch_max_rad` (elevation after a floor, and negated after a
    /// ceiling; reference: 15 and 45 degrees), `turn_min_rad`, `turn_max_rad` (turn at a wall;
    /// reference: 90 and 270 degrees).
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn new(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let pitch_min_rad = settings.number("pitch_min_rad", PI / 12.0, 0.0, FRAC_PI_2)?;
        let pitch_max_rad =
            settings.number("pitch_max_rad", (PI / 4.0).max(pitch_min_rad), pitch_min_rad, FRAC_PI_2)?;
        let turn_min_rad = settings.number("turn_min_rad", FRAC_PI_2, 0.0, TAU)?;
        let turn_max_rad = settings.number("turn_max_rad", (3.0 * FRAC_PI_2).max(turn_min_rad), turn_min_rad, TAU)?;
        Ok(Self {
            rng,
            pitch_rad: FIRST_PITCH_RAD,
            heading_rad: None,
            pitch_min_rad,
            pitch_max_rad,
            turn_min_rad,
            turn_max_rad,
        })
    }

    /// The motion in a direction that differs from the present one by a random angle in this range.
    fn turn(&mut self, low_rad: f64, high_rad: f64, ctx: &Ctx<'_>) -> Motion {
        let angle_rad = self.rng.random_range(low_rad..=high_rad);
        let heading_rad = self.heading_rad.unwrap_or(ctx.yaw_rad()) + angle_rad;
        self.heading_rad = Some(libm::remainder(heading_rad, TAU));
        ctx.straight_towards(heading_rad, self.pitch_rad).unwrap_or_else(|| Motion::turn(angle_rad))
    }

    fn straight_on(&self, ctx: &Ctx<'_>) -> Motion {
        let heading_rad = self.heading_rad.unwrap_or(ctx.yaw_rad());
        let along_heading = || Motion::straight(self.pitch_rad, f64::INFINITY);
        ctx.straight_towards(heading_rad, self.pitch_rad).unwrap_or_else(along_heading)
    }
}

impl Controller for Rbw {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        if observation.is_active {
            return Command::keep(WakeCondition::TASK_DONE);
        }
        if self.heading_rad.is_none() {
            return Command::new(self.turn(0.0, TAU, ctx), WakeCondition::TASK_DONE);
        }
        match observation.collision.map(|collision| collision.surface) {
            Some(Surface::Wall) => {
                let turn = self.turn(self.turn_min_rad, self.turn_max_rad, ctx);
                return Command::new(turn, WakeCondition::TASK_DONE);
            }
            Some(Surface::Floor) => self.pitch_rad = self.rng.random_range(self.pitch_min_rad..=self.pitch_max_rad),
            Some(Surface::Ceiling) => self.pitch_rad = -self.rng.random_range(self.pitch_min_rad..=self.pitch_max_rad),
            None => {}
        }
        Command::new(self.straight_on(ctx), WakeCondition::TASK_DONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{World, collided, idle};

    fn walk(settings: &[&str]) -> Result<Rbw, SettingError> {
        let texts: Vec<String> = settings.iter().map(ToString::to_string).collect();
        Rbw::new(&mut Settings::parse(&texts)?, voxels::random_streams::stream(1, 0, "test"))
    }

    #[test]
    fn starts_with_a_random_turn_and_moves_until_a_collision() {
        let mut world = World::empty();
        let mut rbw = walk(&[]).unwrap();
        let turn = world.ask_about(&mut rbw, &idle());
        assert!(matches!(turn.motion, Motion::Turn { angle_rad } if (-PI..PI).contains(&angle_rad)));
        let go = world.ask_about(&mut rbw, &idle());
        assert_eq!(go.motion, Motion::Move { pitch_rad: FIRST_PITCH_RAD, distance_m: f64::INFINITY });
    }

    #[test]
    fn keeps_while_active() {
        let mut world = World::empty();
        let mut rbw = walk(&[]).unwrap();
        let mut observation = idle();
        observation.is_active = true;
        assert_eq!(world.ask_about(&mut rbw, &observation), Command::keep(WakeCondition::TASK_DONE));
    }

    #[test]
    fn goes_up_at_a_floor_down_at_a_ceiling_and_turns_at_a_wall() {
        let mut world = World::empty();
        let mut rbw = walk(&["pitch_min_rad=0.1", "pitch_max_rad=0.2"]).unwrap();
        world.ask_about(&mut rbw, &idle());
        for _ in 0..100 {
            let up = world.ask_about(&mut rbw, &collided(idle(), Surface::Floor));
            assert!(matches!(up.motion, Motion::Move { pitch_rad, .. } if (0.1..=0.2).contains(&pitch_rad)));
            let down = world.ask_about(&mut rbw, &collided(idle(), Surface::Ceiling));
            assert!(matches!(down.motion, Motion::Move { pitch_rad, .. } if (-0.2..=-0.1).contains(&pitch_rad)));
            let turn = world.ask_about(&mut rbw, &collided(idle(), Surface::Wall));
            assert!(matches!(turn.motion, Motion::Turn { angle_rad } if angle_rad.abs() >= FRAC_PI_2 - 1e-9));
        }
    }

    #[test]
    fn aerial_body_does_not_turn_first() {
        let mut world = World::empty().aerial();
        let mut rbw = walk(&["turn_min_rad=1.5", "turn_max_rad=1.5"]).unwrap();
        let mut off = |about: &Observation| {
            let Motion::Path(waypoints) = world.ask_about(&mut rbw, about).motion else { panic!("no path") };
            (waypoints[0] - about.pose.position).normalize()
        };
        let first = off(&idle());
        assert!((first.z - libm::sin(FIRST_PITCH_RAD)).abs() < 1e-9, "{first}");
        assert!((off(&idle()) - first).norm() < 1e-9, "straight on");
        let next = off(&collided(idle(), Surface::Wall));
        let turned_rad = libm::atan2(first.x * next.y - first.y * next.x, first.x * next.x + first.y * next.y);
        assert!((turned_rad - 1.5).abs() < 1e-9, "from where it went, wherever it looks: {turned_rad}");
        assert!(off(&collided(idle(), Surface::Ceiling)).z < 0.0);
    }

    #[test]
    fn settings_are_checked() {
        assert!(walk(&["pitch_min_rad=2"]).is_err());
        assert!(walk(&["pitch_max_rad=x"]).is_err());
        assert!(walk(&["turn_min_rad=3", "turn_max_rad=2"]).is_err());
        assert!(walk(&["turn_min_rad"]).is_err());
    }
}
