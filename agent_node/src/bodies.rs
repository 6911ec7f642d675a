//! What the bodies of the team can do, as far as agents reckon with it.
//!
//! This module moves nothing: that is the server's.

use msgs::ids::AgentId;

/// How a body moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BodyKind {
    /// It turns first, and then moves along its heading.
    Submarine,
    /// It moves in any direction at once, and turns on its way.
    Aerial,
}

/// What a body can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// How it moves.
    pub kind: BodyKind,
    /// Radius of the sphere, metres.
    pub radius_m: f64,
    /// Top speed along its path.
    pub speed_max_m_s: f64,
    /// How fast it speeds up.
    pub acceleration_m_s2: f64,
    /// How fast it brakes.
    pub deceleration_m_s2: f64,
    /// Top turn rate.
    pub turn_rate_max_rad_s: f64,
    /// How fast a turn speeds up.
    pub turn_acceleration_rad_s2: f64,
    /// How fast a turn brakes.
    pub turn_deceleration_rad_s2: f64,
}

impl Body {
    /// One that flies.
    #[cfg(test)]
    pub(crate) const AERIAL: Self = Self {
        kind: BodyKind::Aerial,
        speed_max_m_s: 3.0,
        acceleration_m_s2: 2.0,
        deceleration_m_s2: 2.0,
        ..Self::SUBMARINE
    };

    /// The submarine of a scenario that does not say what bodies can do: what paces are measured with.
    pub const SUBMARINE: Self = Self {
        kind: BodyKind::Submarine,
        radius_m: 0.4,
        speed_max_m_s: 1.5,
        acceleration_m_s2: 0.5,
        deceleration_m_s2: 0.25,
        turn_rate_max_rad_s: 1.745_329_251_994_329_5,
        turn_acceleration_rad_s2: 0.872_664_625_997_164_8,
        turn_deceleration_rad_s2: 0.436_332_312_998_582_4,
    };

    /// How long a straight leg takes from rest to rest, seconds: with the turn before it, by this angle at the most, if the body
    /// has to turn first.
    #[must_use]
    pub fn leg_s(&self, length_m: f64, turn_rad: f64) -> f64 {
        let go_s = ramp_s(length_m, self.speed_max_m_s, self.acceleration_m_s2, self.deceleration_m_s2);
        match self.kind {
            BodyKind::Aerial => go_s,
            BodyKind::Submarine => {
                let (faster, slower) = (self.turn_acceleration_rad_s2, self.turn_deceleration_rad_s2);
                go_s + ramp_s(turn_rad, self.turn_rate_max_rad_s, faster, slower)
            }
        }
    }
}

/// Time from rest to rest over a distance, seconds.
fn ramp_s(distance: f64, speed_max: f64, acceleration: f64, deceleration: f64) -> f64 {
    let per_speed_s = 1.0 / acceleration + 1.0 / deceleration;
    let top = speed_max.min((2.0 * distance / per_speed_s).sqrt());
    if top > 0.0 { distance / top + 0.5 * top * per_speed_s } else { 0.0 }
}

/// The bodies of a team.
#[derive(Debug, Clone, PartialEq)]
pub struct Bodies {
    different: Vec<Body>,
    /// Which of them, by agent.
    body_of: Vec<u8>,
}

impl Bodies {
    /// The bodies that there are, and by agent which of them is its own; none if an agent has one that there is not.
    #[must_use]
    pub fn new(different: Vec<Body>, body_of: Vec<u8>) -> Option<Self> {
        body_of.iter().all(|&body| usize::from(body) < different.len()).then_some(Self { different, body_of })
    }

    /// What the body of an agent of the run can do.
    ///
    /// # Panics
    /// If there is no such agent.
    #[must_use]
    pub fn of(&self, agent: AgentId) -> &Body {
        &self.different[usize::from(self.body_of[agent.index()])]
    }

    /// The bodies by agent.
    pub fn iter(&self) -> impl Iterator<Item = &Body> {
        self.body_of.iter().map(|&body| &self.different[usize::from(body)])
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn legs_take_as_long_as_the_bodies_do() {
        // Measured with the server's bodies, which lose up to a tenth of a second to whole ticks.
        for (body, length_m, turn_rad, expected_s) in [
            (Body::SUBMARINE, 10.0, 0.0, 10.6),
            (Body::SUBMARINE, 1.0, 0.0, 3.22),
            (Body::SUBMARINE, 1.0, FRAC_PI_2, 3.22 + 3.08),
            (Body::SUBMARINE, 0.0, 0.0, 0.0),
            (Body::AERIAL, 8.0, FRAC_PI_2, 4.17),
            (Body::AERIAL, 2.0, FRAC_PI_2, 2.0),
        ] {
            let reckoned_s = body.leg_s(length_m, turn_rad);
            assert!((reckoned_s - expected_s).abs() <= 0.6, "{length_m} m: {reckoned_s} s, not {expected_s} s");
        }
    }

    #[test]
    fn every_agent_has_one_of_the_bodies() {
        let small = Body { radius_m: 0.1, ..Body::SUBMARINE };
        let bodies = Bodies::new(vec![Body::SUBMARINE, small], vec![0, 1]).unwrap();
        assert_eq!(bodies.of(AgentId(1)), &small);
        assert_eq!(bodies.iter().collect::<Vec<_>>(), [&Body::SUBMARINE, &small]);
        assert_eq!(Bodies::new(vec![small], vec![0, 1]), None);
    }
}
