//! The legs of a path as MAES3D goes them, for [`super::lvd_maes3d`] and [`super::dsvp_maes3d`].
//!
//! Every leg there begins with a turn to the heading of its horizontal part, and that of a leg
//! without one is 0: before a vertical or empty leg the body turns to heading 0, and before the
//! next one back. Here a path that has such a leg is given in parts, with a turn between them.
//!
//! Not reproduced: where the horizontal part is not exactly 0 but the rest of a rounding, the
//! heading there is the direction of that.

use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_2;

use nalgebra::Point3;

use super::Ctx;
use agent::bodies::BodyKind;
use agent::command::Motion;

/// Heading 0 of the reference, along its z, which is our y; radians.
const HEADING_RAD: f64 = FRAC_PI_2;

/// A leg with less horizontal way has no heading of its own, metres: that of the body.
const HORIZONTAL_MIN_M: f64 = 1e-3;

/// Smallest turn, radians: that of the body.
const TURN_MIN_RAD: f64 = 1.745_329_251_994_329_5e-5;

/// What is left of a path after the part that is under way.
#[derive(Debug, Clone, Default)]
pub(crate) struct Legs {
    rest: VecDeque<Point3<f64>>,
}

impl Legs {
    /// The first part of a motion; the rest of the last one is dropped.
    pub(crate) fn begin(&mut self, motion: Motion, ctx: &Ctx<'_>) -> Motion {
        self.rest.clear();
        match motion {
            Motion::Path(waypoints) if ctx.body().kind == BodyKind::Submarine => {
                self.rest = waypoints.into();
                self.next(ctx).unwrap_or(Motion::Path(Vec::new()))
            }
            motion => motion,
        }
    }

    /// Drops the rest.
    pub(crate) fn end(&mut self) {
        self.rest.clear();
    }

    /// Whether the body has nothing to do to be at a place at the end of a path that begins there.
    pub(crate) fn is_done(place: &Point3<f64>, ctx: &Ctx<'_>) -> bool {
        let turn = ctx.turn_to(HEADING_RAD);
        let is_turned = !matches!(turn, Motion::Turn { angle_rad } if angle_rad.abs() >= TURN_MIN_RAD);
        ctx.position() == *place && (is_turned || ctx.body().kind != BodyKind::Submarine)
    }

    /// Whether a part is left.
    pub(crate) fn is_any_left(&self) -> bool {
        !self.rest.is_empty()
    }

    /// The next part, of a body that has come to the end of the one before.
    pub(crate) fn next(&mut self, ctx: &Ctx<'_>) -> Option<Motion> {
        let mut from = ctx.position();
        let first = *self.rest.front()?;
        if !has_heading(from, first)
            && let turn @ Motion::Turn { angle_rad } = ctx.turn_to(HEADING_RAD)
            && angle_rad.abs() >= TURN_MIN_RAD
        {
            return Some(turn);
        }
        // The body has the heading of a first leg without one; a later one needs its turn.
        let mut part = Vec::new();
        while let Some(&next) = self.rest.front()
            && (part.is_empty() || has_heading(from, next))
        {
            part.push(next);
            from = next;
            self.rest.pop_front();
        }
        Some(Motion::Path(part))
    }
}

/// Whether a leg has a horizontal part.
fn has_heading(from: Point3<f64>, to: Point3<f64>) -> bool {
    libm::hypot(to.x - from.x, to.y - from.y) >= HORIZONTAL_MIN_M
}

#[cfg(test)]
mod tests {
    use voxels::Cell;

    use super::*;
    use crate::testing::World;

    fn at(x: f64, y: f64, z: f64) -> Point3<f64> {
        Point3::new(x, y, z)
    }

    /// The parts of a path from (5.5, 5.5, 5.5) with heading 0 of ours.
    fn parts(world: &mut World, path: Vec<Point3<f64>>) -> Vec<Motion> {
        let mut legs = Legs::default();
        let mut parts = vec![legs.begin(Motion::Path(path), &world.ctx())];
        while legs.is_any_left() {
            match parts.last().unwrap() {
                Motion::Turn { angle_rad } => world.observation.pose.yaw_rad += angle_rad,
                Motion::Path(part) => {
                    let before = part.iter().rev().nth(1).copied().unwrap_or(world.observation.pose.position);
                    let end = *part.last().unwrap();
                    if has_heading(before, end) {
                        world.observation.pose.yaw_rad = libm::atan2(end.y - before.y, end.x - before.x);
                    }
                    world.observation.pose.position = end;
                }
                motion => panic!("{motion:?}"),
            }
            parts.push(legs.next(&world.ctx()).unwrap());
        }
        parts
    }

    #[test]
    fn body_turns_to_heading_0_before_vertical_and_empty_legs() {
        let [start, beside, above, higher] =
            [at(5.5, 5.5, 5.5), at(6.5, 5.5, 5.5), at(6.5, 5.5, 6.5), at(6.5, 5.5, 8.5)];
        let end = at(6.5, 7.5, 8.5);
        let turn = Motion::Turn { angle_rad: HEADING_RAD };
        let path = vec![beside, above, higher, end];
        assert_eq!(
            parts(&mut World::empty(), path),
            [
                Motion::Path(vec![beside]),
                turn.clone(),
                Motion::Path(vec![above]),
                // It has the heading already.
                Motion::Path(vec![higher, end]),
            ]
        );
        assert_eq!(parts(&mut World::empty(), vec![start]), [turn, Motion::Path(vec![start])]);
        let level = vec![beside, at(6.5, 9.5, 6.5), at(2.5, 9.5, 6.5)];
        assert_eq!(parts(&mut World::empty(), level.clone()), [Motion::Path(level)]);
    }

    #[test]
    fn bodies_that_need_not_turn_do_not() {
        let up = Motion::Path(vec![World::empty().map.extent().centre(Cell::new(5, 5, 8))]);
        let mut legs = Legs::default();
        assert_eq!(legs.begin(up.clone(), &World::empty().aerial().ctx()), up);
        assert!(!legs.is_any_left());
    }
}
