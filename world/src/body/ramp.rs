//! Speed control along one leg: from the distance to go and the speed, the step of the next fixed
//! update.
//!
//! Units are metres for moves and radians for turns.

/// A landing ramp ends with no more than this to go, so that rounding does not cost a tick.
const LANDING_REST: f64 = 1e-9;

/// The distance to go on a leg and the present speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ramp {
    pub(super) rest: f64,
    speed: f64,
}

/// Limits of a [`Ramp`] in the unit of its distance.
pub(super) struct RampLimits {
    pub(super) speed_max: f64,
    pub(super) acceleration: f64,
    pub(super) deceleration: f64,
    /// A leg with less than this to go is finished; unused by a landing ramp.
    pub(super) rest_min: f64,
}

impl Ramp {
    pub(super) fn from_rest(rest: f64) -> Self {
        Self { rest, speed: 0.0 }
    }

    /// The step of this tick, and whether it is the last one.
    ///
    /// The rule of MAES3D: brake while the braking distance reaches the target, accelerate
    /// otherwise.
    pub(super) fn next_step(&mut self, limits: &RampLimits, dt_s: f64) -> (f64, bool) {
        if self.rest < limits.rest_min {
            return (self.rest, true);
        }
        if self.speed * self.speed / (2.0 * limits.deceleration) >= self.rest {
            self.speed = (self.speed - limits.deceleration * dt_s).max(0.0);
        } else {
            self.speed = (self.speed + limits.acceleration * dt_s).min(limits.speed_max);
        }
        let step = (self.speed * dt_s).min(self.rest);
        self.rest -= step;
        (step, false)
    }

    /// As [`Ramp::next_step`], without ever exceeding the deceleration: the last step ends on the
    /// target, slow enough to be at rest in the tick after it.
    pub(super) fn next_landing_step(&mut self, limits: &RampLimits, dt_s: f64) -> (f64, bool) {
        let slowest = self.speed - limits.deceleration * dt_s;
        let fastest = (self.speed + limits.acceleration * dt_s).min(limits.speed_max);
        self.speed = landing_speed(self.rest, limits.deceleration, dt_s).clamp(slowest.min(fastest), fastest);
        let step = (self.speed * dt_s).min(self.rest);
        self.rest -= step;
        if self.rest > LANDING_REST { (step, false) } else { (step + std::mem::take(&mut self.rest), true) }
    }
}

/// The highest speed for the next tick with which a body can still stop after `rest`, braking by at
/// most `deceleration * dt_s` per tick.
///
/// Braking by d per tick from speed v takes n ticks at v, v - d, v - 2 d ..., a distance of n v - d
/// n (n - 1) / 2 in units of `dt_s`.
pub(super) fn landing_speed(rest: f64, deceleration: f64, dt_s: f64) -> f64 {
    let change = deceleration * dt_s;
    let ticks = (0.5 + (0.25 + 2.0 * (rest / (dt_s * change))).sqrt()).floor();
    if ticks.is_finite() {
        rest / (ticks * dt_s) + 0.5 * change * (ticks - 1.0)
    } else {
        (2.0 * deceleration * rest).sqrt()
    }
}
