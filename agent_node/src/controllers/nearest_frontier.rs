//! Nearest frontier: goes where the nearest unexplored cells are, until there are none. The example to start a controller from.
//!
//! A *frontier* is a cell known to be free that has an unexplored cell next to it. The agent searches its own map for the frontier
//! with the shortest way, goes there, and looks for the next one once that has become an ordinary cell, which mostly happens long
//! before it arrives.
//!
//! With `relays=on` it leaves relays behind where it would lose contact ([`super::relays`]). It does not coordinate: agents that know the same go to the same places. It finds no way round an agent that stays for ever in
//! a passage one cell wide.

use std::collections::BTreeSet;

use msgs::maes_msgs::Wake as Events;
use nalgebra::Point3;
use rand_chacha::ChaCha8Rng;
use voxels::Cell;

use super::relays::Relays;
use super::settings::{SettingError, Settings};
use super::{Controller, Ctx, aside};
use crate::command::{Command, Motion, Wake};
use crate::observation::Observation;
use crate::travel::{Journey, SearchTime};

/// The mark of relays that keep nothing.
const RELAY_MARK: u8 = 0;

/// The controller of one agent: what it remembers from one decision to the next.
#[derive(Debug, Clone)]
pub struct NearestFrontier {
    search_time: SearchTime,
    /// Its own stream of random numbers. Nothing else may be random, or a run could not be repeated.
    rng: ChaCha8Rng,
    /// The frontier it goes to.
    goal: Option<Cell>,
    /// Frontiers it has been in without seeing what is beyond, because the sensor does not reach there. It leaves them alone.
    given_up: BTreeSet<Cell>,
    relays: Relays,
    /// The way-points that it goes along.
    way: Vec<Point3<f64>>,
}

impl NearestFrontier {
    /// Settings: `search_time`, see [`Settings::search_time`], and `relays`, see [`Relays::new`].
    ///
    /// # Errors
    /// If a setting is not allowed.
    pub fn new(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let search_time = settings.search_time()?;
        let relays = Relays::new(settings)?;
        Ok(Self { search_time, rng, goal: None, given_up: BTreeSet::new(), relays, way: Vec::new() })
    }

    /// The frontier with the shortest way to it.
    fn nearest(&self, ctx: &mut Ctx<'_>) -> Option<Cell> {
        ctx.nearest(|map, cell| map.is_frontier(cell) && !self.given_up.contains(&cell))
    }

    /// The command, and a relay is left behind if this is the place for it.
    fn beside_relay(&mut self, command: Command, observation: &Observation, ctx: &Ctx<'_>) -> Command {
        let here = ctx.position();
        // Way-points behind it are passed.
        let passed = self.way.iter().position(|next| (next - here).norm() < ctx.map().extent().cell_m() / 2.0);
        self.way.drain(..passed.map_or(0, |passed| passed + 1));
        match self.relays.is_one_left(observation, ctx, &self.way) {
            true => command.leaving_relay(RELAY_MARK, Vec::new()),
            false => command,
        }
    }
}

impl Controller for NearestFrontier {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        // Before the first scan it knows nothing but its own cell. The task of the body, here none, is left as it is.
        if observation.scan_tick.is_none() {
            return Command::keep(Wake::NEXT_TICK);
        }
        // Events tell what has happened since the last decision; `observation.collision` would tell of old collisions as well.
        if self.goal.is_some() && observation.events & Events::COLLISION != 0 {
            self.goal = None;
            return aside::make_way(&mut self.rng, ctx);
        }
        // Under way it wants to be asked in each new cell, because from there it may have seen what is beyond the frontier.
        let under_way = Wake::on(Events::TASK_DONE | Events::COLLISION | Events::NEW_CELL);
        let mut goal = self.goal.filter(|&goal| ctx.map().is_frontier(goal));
        if goal.is_some() && observation.is_active {
            return self.beside_relay(Command::keep(under_way), observation, ctx);
        }
        if let Some(reached) = goal.filter(|&goal| goal == ctx.cell()) {
            self.given_up.insert(reached);
            goal = None;
        }
        // A goal that is still one is gone to again: a search that takes time is asked for its answer like this.
        self.goal = goal.or_else(|| self.nearest(ctx));
        let Some(goal) = self.goal else {
            // All is explored that it can get to. What others know may change that: they are heard when they come into contact, and
            // map parcels are in the map before the controller is asked.
            return Command::new(Motion::Stop, Wake::on(Events::PARCEL | Events::CONTACTS)).saying("knows no frontier");
        };
        let Cell { x, y, z } = goal;
        match ctx.go_to_cell(goal, self.search_time) {
            Journey::Go(motion) => {
                if let Motion::Path(way) = &motion {
                    self.way.clone_from(way);
                }
                let command = Command::new(motion, under_way).saying(format!("goes to the frontier {x} {y} {z}"));
                self.beside_relay(command, observation, ctx)
            }
            // The body has to keep still, or the way would begin where it is no more.
            Journey::Searching(wake) => {
                Command::new(Motion::Stop, wake).saying(format!("searches a way to {x} {y} {z}"))
            }
            Journey::NoWay => {
                self.given_up.insert(goal);
                Command::new(Motion::Stop, Wake::NEXT_TICK)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use msgs::ids::Tick;

    use super::aside::PATIENCE_TICKS;
    use super::*;
    use crate::command::LidarRequest;
    use crate::controllers::testing::{World, flat};

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
        NearestFrontier::new(&mut settings, random_streams::stream(1, 0, "test")).unwrap()
    }

    fn destination(world: &World, command: &Command) -> Cell {
        let Motion::Path(way_points) = &command.motion else { panic!("{command:?}") };
        world.map.extent().cell_of(way_points.last().unwrap())
    }

    #[test]
    fn explores_all_and_waits_for_news() {
        for (search_time, goes_at_once) in [("instant", true), ("budgeted", false), ("background", false)] {
            let mut world = World::new(CAVE, flat(1, 6));
            let mut controller = controller(search_time);
            assert_eq!(world.ask(&mut controller), Command::keep(Wake::NEXT_TICK), "nothing has been scanned");
            let mut decisions = 0;
            let mut searches = 0;
            let last = loop {
                decisions += 1;
                assert!(decisions < 200);
                world.look();
                let command = world.ask(&mut controller);
                match &command.motion {
                    Motion::Path(_) => world.arrive(&command.motion),
                    Motion::Stop if command.wake.events != 0 => break command,
                    Motion::Stop => {
                        searches += 1;
                        world.observation.tick = command.wake.at.max(world.observation.tick.next());
                    }
                    motion => panic!("{motion:?}"),
                }
            };
            assert_eq!(last.wake, Wake::on(Events::PARCEL | Events::CONTACTS));
            assert_eq!(world.map.frontier_count(), 0);
            assert_eq!(world.map.free(), CAVE.matches('.').count());
            assert_eq!(searches == 0, goes_at_once, "{search_time}");
        }
    }

    #[test]
    fn goes_to_the_nearest_by_way_and_not_by_distance() {
        // The one to the right is two cells away, behind a wall.
        let mut world = World::known("?......\n#.####.\n#.#?#?.\n?.....#\n", flat(1, 2));
        world.observation.scan_tick = Some(Tick::ZERO);
        let command = world.ask(&mut controller("instant"));
        assert_eq!(destination(&world, &command), flat(1, 3));
        assert_eq!(command.info, "goes to the frontier 1 3 0");
    }

    #[test]
    fn looks_for_another_one_as_soon_as_the_goal_is_none() {
        let mut world = World::known("......?\n", flat(2, 0));
        world.observation.scan_tick = Some(Tick::ZERO);
        let mut controller = controller("instant");
        let go = world.ask(&mut controller);
        assert_eq!(destination(&world, &go), flat(5, 0));
        world.put(flat(3, 0));
        let keep = world.ask(&mut controller);
        assert_eq!(keep, Command::keep(Wake::on(Events::TASK_DONE | Events::COLLISION | Events::NEW_CELL)));
        world.map.note_wall(&[6]);
        world.put(flat(4, 0));
        let stop = world.ask(&mut controller);
        assert_eq!((stop.motion, stop.info.as_str()), (Motion::Stop, "knows no frontier"));
    }

    #[test]
    fn leaves_a_frontier_alone_that_it_cannot_look_beyond() {
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
        // News of another agent.
        world.map.note_free(&[5]);
        world.observation.events = Events::PARCEL;
        assert_eq!(world.ask(&mut controller).info, "knows no frontier", "nothing beyond");
    }

    #[test]
    fn makes_way_at_random_and_goes_on() {
        let mut waits = BTreeSet::new();
        let mut places = BTreeSet::new();
        let mut world = World::known("........\n........\n.......?\n", flat(1, 1));
        world.observation.scan_tick = Some(Tick::ZERO);
        let mut controller = controller("instant");
        for _ in 0..100 {
            let go = world.ask(&mut controller);
            assert_eq!(destination(&world, &go), flat(6, 0));
            world.wait(10);
            world.collide();
            let aside = world.ask(&mut controller);
            assert_eq!((aside.info.as_str(), aside.wake.events), ("makes way", 0));
            let wait = aside.wake.at.0 - world.observation.tick.0;
            assert!(PATIENCE_TICKS.contains(&wait));
            waits.insert(wait);
            places.insert(destination(&world, &aside));
            // The step aside is refused as well: it waits all the same, and then goes on.
            world.collide();
            world.observation.tick = aside.wake.at;
        }
        assert!(waits.len() > 30 && places.len() == 8, "{waits:?} {places:?}");
    }

    #[test]
    fn asks_for_nothing_but_motion() {
        let mut world = World::new(CAVE, flat(1, 6));
        world.look();
        let command = world.ask(&mut controller("instant"));
        assert_eq!((command.lidar, command.want_view, command.parcels.len()), (LidarRequest::Keep, false, 0));
    }
}
