//! The trajectory under way: which velocity is due, and the next trajectory from that of the body.
//!
//! Invariants: the body is at rest, or holds the velocity of the present step of its trajectory;
//! the agent decides where that changes, by a wake-up condition of its own.

use msgs::ids::Tick;
use nalgebra::Point3;

use super::obstacles::Obstacles;
use crate::Ctx;
use agent::bodies::legs_s;
use agent::command::{Motion, WakeCondition};
use agent::observation::Observation;
use agent::path::{BodyState, Trajectory};

/// A trajectory under way.
#[derive(Debug)]
pub(super) struct Driving {
    waypoints: Vec<Point3<f64>>,
    trajectory: Trajectory,
    since: Tick,
}

impl Driving {
    /// Along waypoints (metres, frame `map`), from the motion of the body: that of the trajectory
    /// `before`, if it is under way. `None` if none is found, another agent blocks it, or a body at
    /// rest gets there sooner with a stop at each waypoint.
    pub(super) fn along(
        waypoints: &[Point3<f64>],
        before: Option<&Self>,
        observation: &Observation,
        ctx: &Ctx<'_>,
        obstacles: &Obstacles,
    ) -> Option<Self> {
        let now = observation.tick;
        let here = BodyState::at_rest(ctx.position(), ctx.yaw_rad());
        let moving = before.filter(|_| observation.is_active).and_then(|before| {
            // Velocities as predicted: those observed are rounded.
            let state = before.trajectory.state_after(before.passed(now), ctx.body())?;
            Some(BodyState { position: here.position, yaw_rad: here.yaw_rad, ..state })
        });
        let trajectory = Trajectory::along(waypoints, ctx.map(), ctx.body(), &moving.unwrap_or(here))?;
        let duration_s = trajectory.ticks() as f64 * Tick::TICK_S;
        let stops_s = || legs_s(ctx.body(), (here.position, here.yaw_rad), waypoints.iter().copied(), 1.0);
        let is_free = || {
            let starts = trajectory.positions();
            !starts.zip(trajectory.positions().skip(1)).any(|(from, to)| obstacles.block(&from, &to))
        };
        let is_quicker = moving.is_some() || duration_s < stops_s();
        (is_quicker && is_free()).then(|| Self { waypoints: waypoints.to_vec(), trajectory, since: now })
    }

    /// Ticks since its start.
    fn passed(&self, now: Tick) -> u64 {
        now.0.saturating_sub(self.since.0)
    }

    /// What is due: a velocity at the start of each step that has another one than the step before,
    /// and to stop at the end.
    pub(super) fn motion(&self, now: Tick) -> Motion {
        let passed = self.passed(now);
        let step = (passed / Trajectory::STEP_TICKS) as usize;
        let is_changed = step == 0 || self.trajectory.next_change(step - 1) == step;
        if !(passed.is_multiple_of(Trajectory::STEP_TICKS) && is_changed) {
            return Motion::Keep;
        }
        match self.trajectory.step(step) {
            Some((held, ahead)) => Motion::Velocity {
                linear_in_body_m_s: held.linear_in_body_m_s,
                yaw_rate_rad_s: held.yaw_rate_rad_s,
                path: self.waypoints[ahead..].to_vec(),
            },
            None => Motion::Stop,
        }
    }

    /// When the next velocity is due.
    pub(super) fn wake(&self, now: Tick) -> WakeCondition {
        let step = (self.passed(now) / Trajectory::STEP_TICKS) as usize;
        WakeCondition::at(self.since.after(self.trajectory.next_change(step) as u64 * Trajectory::STEP_TICKS))
    }
}

#[cfg(test)]
mod tests {
    use protocol::event_mask::EventMask;

    use voxels::Cell;

    use super::*;
    use crate::testing::World;
    use agent::bodies::BodyModel;
    use agent::observation::Contact;

    const ROOM: &str = "\
        ##########\n\
        #........#\n\
        #........#\n\
        #........#\n\
        ##########\n";

    /// Ways to these are quicker without a stop.
    const BENT: [Cell; 2] = [Cell::new(4, 1, 0), Cell::new(8, 3, 0)];

    fn along(world: &mut World, before: Option<&Driving>, to: &[Cell]) -> Option<Driving> {
        let observation = world.observation.clone();
        let ctx = world.ctx();
        let waypoints: Vec<Point3<f64>> = to.iter().map(|&cell| ctx.map().extent().centre(cell)).collect();
        let obstacles = Obstacles::of(&observation, &ctx);
        Driving::along(&waypoints, before, &observation, &ctx, &obstacles)
    }

    fn velocity(driving: &Driving, tick: Tick) -> Vec<Point3<f64>> {
        let Motion::Velocity { path, .. } = driving.motion(tick) else { panic!("{:?}", driving.motion(tick)) };
        path
    }

    #[test]
    fn a_velocity_is_due_where_it_changes_and_a_stop_at_the_end() {
        let mut world = World::known(ROOM, Cell::new(1, 1, 0));
        world.wait(7);
        let since = world.observation.tick;
        let to = [Cell::new(8, 1, 0), Cell::new(8, 3, 0)];
        let driving = along(&mut world, None, &to).unwrap();
        let ends = to.map(|cell| world.map.extent().centre(cell));
        assert_eq!(velocity(&driving, since), ends);
        let ticks = driving.trajectory.ticks();
        let mut last = ends.to_vec();
        let mut due = since;
        for tick in (1..=ticks).map(|ticks| since.after(ticks)) {
            let next = driving.wake(Tick(tick.0 - 1));
            match driving.motion(tick) {
                Motion::Keep => assert!(!next.is_met(tick, EventMask::empty()), "{tick:?}"),
                motion => {
                    assert!(
                        next.is_met(tick, EventMask::empty()) && tick.0 >= due.0 + Trajectory::STEP_TICKS,
                        "{tick:?}"
                    );
                    due = tick;
                    if tick < since.after(ticks) {
                        last = velocity(&driving, tick);
                    } else {
                        assert_eq!(motion, Motion::Stop);
                    }
                }
            }
        }
        assert_eq!((due, last), (since.after(ticks), ends[1..].to_vec()));
    }

    #[test]
    fn the_next_trajectory_begins_with_the_velocity_of_the_last_one() {
        let mut world = World::known(ROOM, Cell::new(1, 2, 0));
        let first = along(&mut world, None, &BENT).unwrap();
        world.wait(73);
        let state = first.trajectory.state_after(73, &BodyModel::SUBMARINE).unwrap();
        (world.observation.pose.position, world.observation.pose.yaw_rad) = (state.position, state.yaw_rad);
        world.observation.is_active = true;
        let second = along(&mut world, Some(&first), &BENT).unwrap();
        assert_eq!(second.trajectory.state_after(0, &BodyModel::SUBMARINE), Some(state));
        assert!(state.velocity_in_body_m_s.x > 0.5, "{state:?}");
        // A body whose task has ended is at rest.
        world.observation.is_active = false;
        let third = along(&mut world, Some(&first), &BENT).unwrap();
        let at_rest = BodyState::at_rest(state.position, state.yaw_rad);
        assert_eq!(third.trajectory.state_after(0, &BodyModel::SUBMARINE), Some(at_rest));
    }

    #[test]
    fn other_bodies_block_it() {
        let mut world = World::known(ROOM, Cell::new(1, 2, 0));
        assert!(along(&mut world, None, &BENT).is_some());
        let position = world.map.extent().centre(Cell::new(3, 1, 0));
        world.observation.contacts.push(Contact { agent: msgs::ids::AgentId(0), position });
        assert!(along(&mut world, None, &BENT).is_none());
    }
}
