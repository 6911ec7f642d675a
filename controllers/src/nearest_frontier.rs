//! Nearest frontier: moves to the nearest frontier until there are none. The example to start a
//! controller from.
//!
//! A *frontier* is a cell known to be free with an unexplored neighbour. The agent searches its own
//! map for the frontier with the shortest path, moves there, and looks for the next one once that
//! cell is no frontier any more, which mostly happens long before it arrives.
//!
//! A confined body cannot be in most frontiers, and one whose LiDAR has a band of elevations does
//! not see from there what is above or below: it goes to
//! a viewpoint from which it sees that (`viewpoints.rs`), and rests once there is none.
//!
//! With `relays=on` it drops relays where it would lose contact ([`super::relays`]). It does not
//! coordinate: agents with equal maps go to the same frontiers, and plan as if no other body were
//! there until they run into one that stays.

use std::collections::BTreeSet;
use std::task::Poll;

use msgs::ids::Tick;
use nalgebra::Point3;
use protocol::event_mask::EventMask;
use rand_chacha::ChaCha8Rng;
use voxels::Cell;

use super::blockage::{Blockages, Yield};
use super::dsvp::avoidance::{Waypoints, way_round};
use super::dsvp::obstacles::Obstacles;
use super::relays::{RELAY_MARK, Relays};
use super::settings::{SettingError, Settings};
use super::viewpoints::{NOTHING_TO_SEE, Viewpoint, Viewpoints};
use super::{Controller, Ctx, collision_recovery};
use agent::command::{Command, Motion, Stage, WakeCondition};
use agent::exploration_map::CellState;
use agent::navigation::{NavigationStatus, SearchTime};
use agent::observation::Observation;

/// The controller of one agent: its state between decisions.
#[derive(Debug)]
pub struct NearestFrontier {
    search_time: SearchTime,
    /// Its own random stream. Any other source of randomness would make runs unrepeatable.
    rng: ChaCha8Rng,
    /// The frontier it moves to.
    goal: Option<Cell>,
    /// Frontiers it has been in without seeing what is beyond, because the sensor does not reach
    /// there.
    abandoned: BTreeSet<Cell>,
    /// Of a body that needs them: its viewpoints, and the one it moves to.
    viewpoints: Option<Viewpoints>,
    viewpoint: Option<Viewpoint>,
    relays: Relays,
    /// The agents that it has run into.
    blockages: Blockages,
    /// The waypoints ahead of it.
    waypoints: Vec<Point3<f64>>,
}

impl NearestFrontier {
    /// Settings: `search_time`, see [`Settings::search_time`], and `relays`, see [`Relays::new`].
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn new(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let search_time = settings.search_time()?;
        let relays = Relays::new(settings)?;
        Ok(Self {
            search_time,
            rng,
            goal: None,
            abandoned: BTreeSet::new(),
            viewpoints: None,
            viewpoint: None,
            relays,
            blockages: Blockages::default(),
            waypoints: Vec::new(),
        })
    }

    /// The frontier with the shortest path.
    fn nearest(&self, ctx: &mut Ctx<'_>) -> Option<Cell> {
        let map = ctx.map();
        let mut frontiers = map.frontiers().map(|index| map.extent().cell_at(index as usize));
        // Without any, the search would visit all reachable cells.
        if frontiers.all(|cell| self.abandoned.contains(&cell)) {
            return None;
        }
        ctx.nearest(|map, cell| map.is_frontier(cell) && !self.abandoned.contains(&cell))
    }

    fn goes(&mut self, motion: Motion) -> Command {
        if let Motion::Path(waypoints) = &motion {
            self.waypoints.clone_from(waypoints);
        }
        Command::new(motion, UNDER_WAY).with_stage(Stage::Relocating)
    }

    /// A way past the bodies nearby to the nearest goal that they leave open.
    fn detour(&mut self, ctx: &Ctx<'_>, obstacles: &Obstacles) -> Option<Command> {
        let is_open = |cell| !obstacles.occupy(cell);
        let (cell, viewpoint) = if ctx.needs_viewpoints() {
            let found = self.viewpoints.as_mut()?.next_within(ctx, &is_open);
            let Poll::Ready(Some(viewpoint)) = found else { return None };
            (viewpoint.cell, Some(viewpoint))
        } else {
            (ctx.frontier_through(&is_open, |cell| !self.abandoned.contains(&cell))?, None)
        };
        let motion = way_round(ctx, cell, obstacles, Waypoints::Fewest)?;
        (self.goal, self.viewpoint) = (viewpoint.is_none().then_some(cell), viewpoint);
        let Cell { x, y, z } = cell;
        Some(self.goes(motion).with_info(format!("goes past a body to {x} {y} {z}")))
    }

    /// The command, with a relay dropped here if needed.
    fn with_relay_if_needed(&mut self, command: Command, observation: &Observation, ctx: &Ctx<'_>) -> Command {
        let here = ctx.position();
        // Waypoints that it has passed are removed.
        let passed = self.waypoints.iter().position(|next| (next - here).norm() < ctx.map().extent().cell_m() / 2.0);
        self.waypoints.drain(..passed.map_or(0, |passed| passed + 1));
        match self.relays.should_drop(observation, ctx, &self.waypoints) {
            true => command.with_relay(RELAY_MARK, Vec::new()),
            false => command,
        }
    }
}

/// Under way it decides in each new cell, since it may have seen beyond the frontier from there.
const UNDER_WAY: WakeCondition = WakeCondition {
    at: Tick(u64::MAX),
    events: EventMask::TASK_DONE.union(EventMask::COLLISION).union(EventMask::NEW_CELL),
};

impl NearestFrontier {
    /// The decision of a body that needs viewpoints, after its first scan and without a collision.
    fn go_to_viewpoint(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let viewpoints = self.viewpoints.get_or_insert_with(|| Viewpoints::new(ctx.run_info(), ctx.body().radius_m));
        let is_hidden = |viewpoint: &Viewpoint| ctx.map().state(viewpoint.target) == CellState::Unexplored;
        let mut goal = self.viewpoint.take().filter(is_hidden);
        if observation.is_active {
            if goal.is_some() {
                self.viewpoint = goal;
                return self.with_relay_if_needed(Command::keep(UNDER_WAY), observation, ctx);
            }
        } else {
            viewpoints.visit(ctx.map().extent(), ctx.cell());
            goal = goal.filter(|goal| goal.cell != ctx.cell());
        }
        let goal = match goal.map_or_else(|| viewpoints.next(ctx), |goal| Poll::Ready(Some(goal))) {
            Poll::Ready(Some(goal)) => goal,
            Poll::Ready(None) => {
                return Command::new(Motion::Stop, WakeCondition::on(EventMask::MESSAGE | EventMask::CONTACTS))
                    .with_stage(Stage::Waiting)
                    .with_info(NOTHING_TO_SEE);
            }
            Poll::Pending => {
                return Command::new(Motion::Stop, WakeCondition::NEXT_TICK)
                    .with_stage(Stage::Waiting)
                    .with_info("looks for a viewpoint");
            }
        };
        self.viewpoint = Some(goal);
        let Cell { x, y, z } = goal.cell;
        match ctx.go_to_cell(goal.cell, self.search_time) {
            NavigationStatus::Go(motion) => {
                let command = self.goes(motion).with_info(format!("goes to the viewpoint {x} {y} {z}"));
                self.with_relay_if_needed(command, observation, ctx)
            }
            NavigationStatus::Searching(wake) => {
                Command::new(Motion::Stop, wake).with_info(format!("searches a way to {x} {y} {z}"))
            }
            NavigationStatus::NoPath => {
                viewpoints.visit(ctx.map().extent(), goal.cell);
                self.viewpoint = None;
                Command::new(Motion::Stop, WakeCondition::NEXT_TICK)
            }
        }
    }
}

impl Controller for NearestFrontier {
    fn is_blocked(&self) -> bool {
        self.blockages.is_waiting()
    }

    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        // Before the first scan only the own cell is known. The task of the body, here none, is
        // unchanged.
        if observation.scan_tick.is_none() {
            return Command::keep(WakeCondition::NEXT_TICK);
        }
        if observation.events.intersects(EventMask::REVISED) {
            // The way there may be closed, and what could not be reached open.
            (self.goal, self.viewpoint, self.viewpoints) = (None, None, None);
            self.abandoned.clear();
        }
        // Events are those since the last decision; `observation.collision` would include old
        // collisions.
        if (self.goal.is_some() || self.viewpoint.is_some()) && observation.events.intersects(EventMask::COLLISION) {
            (self.goal, self.viewpoint) = (None, None);
            let has_met_agent = observation.collision.is_some_and(|collision| collision.with_agent);
            let mut blockages = std::mem::take(&mut self.blockages);
            let detour = |obstacles: &Obstacles| self.detour(ctx, obstacles);
            let standing = if has_met_agent { blockages.note_between_steps(observation, ctx, detour) } else { None };
            self.blockages = blockages;
            if let Some(Yield::Detour(command)) = standing {
                return self.with_relay_if_needed(command, observation, ctx);
            }
            return match standing {
                Some(Yield::Rest(command)) => command,
                _ => collision_recovery::step_aside(&mut self.rng, ctx),
            };
        }
        if let Some(command) = self.blockages.still_waits(observation, ctx) {
            return command;
        }
        if ctx.needs_viewpoints() {
            return self.go_to_viewpoint(observation, ctx);
        }
        let mut goal = self.goal.filter(|&goal| ctx.map().is_frontier(goal));
        if goal.is_some() && observation.is_active {
            return self.with_relay_if_needed(Command::keep(UNDER_WAY), observation, ctx);
        }
        if let Some(reached) = goal.filter(|&goal| goal == ctx.cell()) {
            self.abandoned.insert(reached);
            goal = None;
        }
        // A goal that is still a frontier is requested again: this polls a search that takes time.
        self.goal = goal.or_else(|| self.nearest(ctx));
        let Some(goal) = self.goal else {
            // All reachable space is explored. Maps of other agents may change that: they arrive on
            // contact, and map messages are merged before the controller is called.
            return Command::new(Motion::Stop, WakeCondition::on(EventMask::MESSAGE | EventMask::CONTACTS))
                .with_stage(Stage::Waiting)
                .with_info("knows no frontier");
        };
        let Cell { x, y, z } = goal;
        match ctx.go_to_cell(goal, self.search_time) {
            NavigationStatus::Go(motion) => {
                let command = self.goes(motion).with_info(format!("goes to the frontier {x} {y} {z}"));
                self.with_relay_if_needed(command, observation, ctx)
            }
            // The body must stay at rest, since the path begins where it is now.
            NavigationStatus::Searching(wake) => {
                Command::new(Motion::Stop, wake).with_info(format!("searches a way to {x} {y} {z}"))
            }
            NavigationStatus::NoPath => {
                self.abandoned.insert(goal);
                Command::new(Motion::Stop, WakeCondition::NEXT_TICK)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::collision_recovery::HOLD_TICKS;
    use super::*;
    use crate::testing::{World, flat};
    use agent::command::ScanRequest;
    use agent::observation::Contact;

    const CAVE: &str = "\
        ############\n\
        #....#.....#\n\
        #....#.....#\n\
        #..........#\n\
        ####.#####.#\n\
        #..#.#.....#\n\
        #....#.##.##\n\
        ############\n";

    fn controller(search_time: &str) -> NearestFrontier {
        let mut settings = Settings::parse(&[format!("search_time={search_time}")]).unwrap();
        NearestFrontier::new(&mut settings, voxels::random_streams::stream(1, 0, "test")).unwrap()
    }

    fn destination(world: &World, command: &Command) -> Cell {
        let Motion::Path(waypoints) = &command.motion else { panic!("{command:?}") };
        world.map.extent().cell_of(waypoints.last().unwrap())
    }

    #[test]
    fn explores_all_and_waits_for_map_updates() {
        for (search_time, goes_at_once) in [("instant", true), ("budgeted", false), ("background", false)] {
            let mut world = World::new(CAVE, flat(1, 6));
            let mut controller = controller(search_time);
            assert_eq!(world.ask(&mut controller), Command::keep(WakeCondition::NEXT_TICK), "nothing has been scanned");
            let mut decisions = 0;
            let mut searches = 0;
            let last = loop {
                decisions += 1;
                assert!(decisions < 200);
                world.sense();
                let command = world.ask(&mut controller);
                match &command.motion {
                    Motion::Path(_) => world.arrive(&command.motion),
                    Motion::Stop if !command.wake.events.is_empty() => break command,
                    Motion::Stop => {
                        searches += 1;
                        world.observation.tick = command.wake.at.max(world.observation.tick.next());
                    }
                    motion => panic!("{motion:?}"),
                }
            };
            assert_eq!(last.wake, WakeCondition::on(EventMask::MESSAGE | EventMask::CONTACTS));
            assert_eq!(world.map.frontier_count(), 0);
            assert_eq!(world.map.free(), CAVE.matches('.').count());
            assert_eq!(searches == 0, goes_at_once, "{search_time}");
        }
    }

    #[test]
    fn nearest_is_by_path_length_not_by_distance() {
        // The one to the right is two cells away, behind a wall.
        let mut world = World::known("?......\n#.####.\n#.#?#?.\n?.....#\n", flat(1, 2));
        world.observation.scan_tick = Some(Tick::ZERO);
        let command = world.ask(&mut controller("instant"));
        assert_eq!(destination(&world, &command), flat(1, 3));
        assert_eq!((command.info.as_str(), command.stage), ("goes to the frontier 1 3 0", Some(Stage::Relocating)));
    }

    #[test]
    fn goal_is_replaced_once_it_is_no_frontier() {
        let mut world = World::known("......?\n", flat(2, 0));
        world.observation.scan_tick = Some(Tick::ZERO);
        let mut controller = controller("instant");
        let go = world.ask(&mut controller);
        assert_eq!(destination(&world, &go), flat(5, 0));
        world.put(flat(3, 0));
        let keep = world.ask(&mut controller);
        assert_eq!(
            keep,
            Command::keep(WakeCondition::on(EventMask::TASK_DONE | EventMask::COLLISION | EventMask::NEW_CELL))
        );
        world.map.note_wall(&[6]);
        world.put(flat(4, 0));
        let stop = world.ask(&mut controller);
        assert_eq!((stop.motion, stop.info.as_str()), (Motion::Stop, "knows no frontier"));
        assert_eq!(stop.stage, Some(Stage::Waiting));
    }

    #[test]
    fn unresolvable_frontier_is_abandoned() {
        let mut world = World::known("?....?\n", flat(2, 0));
        world.observation.scan_tick = Some(Tick::ZERO);
        let mut controller = controller("instant");
        let first = world.ask(&mut controller);
        assert_eq!(destination(&world, &first), flat(1, 0));
        world.arrive(&first.motion);
        let second = world.ask(&mut controller);
        assert_eq!(destination(&world, &second), flat(4, 0));
        world.arrive(&second.motion);
        assert_eq!(world.ask(&mut controller).info, "knows no frontier");
        // A map update from another agent.
        world.map.note_free(&[5]);
        world.observation.events = EventMask::MESSAGE;
        assert_eq!(world.ask(&mut controller).info, "knows no frontier", "nothing beyond");
    }

    const ROOM: &str = "........\n........\n.......?\n";

    #[test]
    fn rests_before_a_body_that_stays() {
        let mut world = World::known(ROOM, flat(1, 1));
        world.observation.scan_tick = Some(Tick::ZERO);
        let mut controller = controller("instant");
        let meets = |world: &mut World, controller: &mut NearestFrontier| {
            world.ask(controller);
            world.wait(300);
            world.collide();
            world.ask(controller)
        };
        let rest = (0..20).map(|_| meets(&mut world, &mut controller)).find(|command| !command.wake.events.is_empty());
        let rest = rest.unwrap();
        assert_eq!(rest.info, "waits for the body in the way to move");
        let begun = world.observation.tick;
        assert!(rest.wake.at >= begun.after(500), "{:?}", rest.wake);
        // A message that changes nothing on the map is no reason to try again.
        world.wait(100);
        world.observation.events = EventMask::MESSAGE;
        assert_eq!(world.ask(&mut controller), Command::keep(rest.wake));
        world.map.note_wall(&[7]);
        assert_ne!(world.ask(&mut controller), Command::keep(rest.wake));
    }

    #[test]
    fn a_frontier_with_a_body_in_it_is_left_for_another_one() {
        let mut world = World::known("?........?\n", flat(2, 0));
        world.observation.scan_tick = Some(Tick::ZERO);
        let position = world.map.extent().centre(flat(1, 0));
        world.observation.contacts.push(Contact { agent: msgs::ids::AgentId(0), position });
        let mut controller = controller("instant");
        assert_eq!(world.ask(&mut controller).info, "goes to the frontier 1 0 0");
        let detour = (0..8).find_map(|_| {
            world.wait(500);
            world.collide();
            let command = world.ask(&mut controller);
            command.info.starts_with("goes past").then_some(command)
        });
        let detour = detour.unwrap();
        assert_eq!((destination(&world, &detour), detour.stage), (flat(8, 0), Some(Stage::Relocating)));
        world.wait(10);
        world.put(flat(3, 0));
        assert_eq!(world.ask(&mut controller).motion, Motion::Keep, "that is its goal now");
    }

    #[test]
    fn steps_aside_at_random_and_continues() {
        let mut waits = BTreeSet::new();
        let mut places = BTreeSet::new();
        let elsewhere = "????????\n".repeat(13);
        let mut world = World::known(&format!("{elsewhere}########\n{ROOM}"), flat(1, 1));
        world.observation.scan_tick = Some(Tick::ZERO);
        let mut controller = controller("instant");
        // Its map changes, so it does not take the other body to stay.
        for changed in (4 * 8..).take(100) {
            world.map.note_wall(&[changed]);
            let go = world.ask(&mut controller);
            assert_eq!(destination(&world, &go), flat(6, 0));
            world.wait(10);
            world.collide();
            let aside = world.ask(&mut controller);
            assert_eq!((aside.info.as_str(), aside.wake.events), ("makes way", EventMask::empty()));
            let wait = aside.wake.at.0 - world.observation.tick.0;
            assert!(HOLD_TICKS.contains(&wait));
            waits.insert(wait);
            places.insert(destination(&world, &aside));
            // The step aside fails as well: it holds all the same, and then continues.
            world.collide();
            world.observation.tick = aside.wake.at;
        }
        assert!(waits.len() > 30 && places.len() == 8, "{waits:?} {places:?}");
    }

    #[test]
    fn commands_only_motion() {
        let mut world = World::new(CAVE, flat(1, 6));
        world.sense();
        let command = world.ask(&mut controller("instant"));
        assert_eq!((command.lidar, command.want_view, command.messages.len()), (ScanRequest::Keep, false, 0));
    }
}
