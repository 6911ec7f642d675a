//! Boustrophedon: sweeps the free space line by line, as an ox ploughs a field, until the body has
//! been in every cell. It covers, and explores on the way.
//!
//! From where it is, the agent goes straight on through uncovered free cells: along x as far as
//! they reach, else one cell along y, else one along z, so that lines fill a layer and layers a
//! room (Choset and Pignon, Coverage Path Planning: The Boustrophedon Cellular Decomposition, FSR
//! 1997, but on the map so far instead of a map known beforehand). If no uncovered cell is beside
//! it, it takes the shortest path to the nearest one that no agent in contact is nearer to; else to
//! the nearest of all. Cells that others report as covered are left out.
//!
//! A confined body cannot be in every free cell: once it knows no other cell to be in, or its map
//! has not grown for long, it goes where it sees something unexplored (`viewpoints.rs`).
//!
//! It decides at the end of a line, so decisions are few. New free space is swept as soon as it is
//! seen.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::task::Poll;

use nalgebra::Point3;
use protocol::event_mask::EventMask;
use rand_chacha::ChaCha8Rng;
use voxels::Cell;

use super::blockage::{Blockages, Yield};
use super::dsvp::avoidance::{Waypoints, way_round};
use super::dsvp::obstacles::{self, Obstacles};
use super::settings::{SettingError, Settings};
use super::viewpoints::{Growth, NOTHING_TO_SEE, Viewpoints};
use super::{Controller, Ctx, collision_recovery};
use agent::command::{Command, Motion, Stage, WakeCondition};
use agent::exploration_map::{CellState, ExplorationMap};
use agent::navigation::{NavigationStatus, SearchTime};
use agent::observation::{Contact, Observation};

/// The directions of a line in order of preference, and the greatest length of each, cells.
const LINES: [(Cell, u32); 6] = [
    (Cell::new(1, 0, 0), LINE_CELLS_MAX),
    (Cell::new(-1, 0, 0), LINE_CELLS_MAX),
    (Cell::new(0, 1, 0), 1),
    (Cell::new(0, -1, 0), 1),
    (Cell::new(0, 0, 1), 1),
    (Cell::new(0, 0, -1), 1),
];

/// Greatest length of a line, cells: longer ones would only delay the next look at what other
/// agents have covered.
const LINE_CELLS_MAX: u32 = 32;

/// Ticks for which an agent holds after a collision with one that goes first: longer than that one
/// holds, and takes to the next cells; 5 to 10 s.
const LONG_HOLD_TICKS: RangeInclusive<u64> = 250..=500;

/// The present task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Task {
    /// None.
    None,
    /// A line, by its first cell and its step from cell to cell.
    Line(Cell, Cell),
    /// A path to this cell.
    Transit(Cell),
}

/// The controller of one agent.
#[derive(Debug)]
pub struct Boustrophedon {
    search_time: SearchTime,
    rng: ChaCha8Rng,
    task: Task,
    /// The agents that it has run into.
    blockages: Blockages,
    /// Cells without a path to them.
    abandoned: BTreeSet<Cell>,
    /// Of a confined body, once it knows no other cell to be in.
    viewpoints: Option<Viewpoints>,
    growth: Growth,
}

impl Boustrophedon {
    /// Settings: `search_time`, see [`Settings::search_time`].
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn new(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let search_time = settings.search_time()?;
        Ok(Self {
            search_time,
            rng,
            task: Task::None,
            blockages: Blockages::default(),
            abandoned: BTreeSet::new(),
            viewpoints: None,
            growth: Growth::default(),
        })
    }

    /// Marks the cells of the line up to the body as covered, since the controller is not called in
    /// each of them. The body may have been moved elsewhere (`set_entity_state`).
    fn mark_line_covered(ctx: &mut Ctx<'_>, from: Cell, step: Cell) {
        let here = ctx.cell();
        let line = std::iter::successors(Some(from), |&cell| Some(cell + step)).take(LINE_CELLS_MAX as usize + 1);
        if let Some(passed) = line.clone().position(|cell| cell == here) {
            line.take(passed).for_each(|cell| ctx.mark_covered(cell));
        }
    }

    /// The step and the last cell of the next line, if there is one.
    fn next_line(ctx: &Ctx<'_>, obstacles: &Obstacles) -> Option<(Cell, Cell)> {
        let here = ctx.cell();
        // Lines lead from place to place.
        if ctx.place(here) != ctx.position() {
            return None;
        }
        LINES.iter().find_map(|&(step, cells_max)| {
            let mut end = here;
            for _ in 0..cells_max {
                let next = end + step;
                if ctx.map().state(next) != CellState::Free || !ctx.is_clear_to(next) || obstacles.occupy(next) {
                    break;
                }
                end = next;
            }
            (end != here).then_some((step, end))
        })
    }

    /// The uncovered cell with the shortest path through open cells, among those that no agent in
    /// contact is nearer to if there are any.
    fn nearest(&self, observation: &Observation, ctx: &Ctx<'_>, is_open: &dyn Fn(Cell) -> bool) -> Option<Cell> {
        let here = ctx.position();
        let others: Vec<Point3<f64>> = observation.contacts.iter().map(|contact| contact.position).collect();
        let is_wanted =
            |map: &ExplorationMap, cell| map.state(cell) == CellState::Free && !self.abandoned.contains(&cell);
        let is_ours = |map: &ExplorationMap, cell: Cell| {
            let centre = map.extent().centre(cell);
            let own_m = (centre - here).norm();
            others.iter().all(|other| (centre - other).norm() >= own_m)
        };
        let ours = ctx.nearest_through(is_open, |map, cell| is_wanted(map, cell) && is_ours(map, cell));
        if ours.is_some() || others.is_empty() { ours } else { ctx.nearest_through(is_open, is_wanted) }
    }

    /// Another agent is in the way: rests before one that stays, else steps aside; the one
    /// with the lowest id continues first, so that two agents do not meet again and again.
    fn give_way(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Command {
        let task = std::mem::replace(&mut self.task, Task::None);
        let mut blockages = std::mem::take(&mut self.blockages);
        let standing = blockages.note_between_steps(observation, ctx, |obstacles| {
            let goal = match task {
                Task::Transit(goal) if goal != ctx.cell() && !obstacles.occupy(goal) => Some(goal),
                _ => self.nearest(observation, ctx, &|cell| !obstacles.occupy(cell)),
            };
            let goal = goal.filter(|&goal| goal != ctx.cell())?;
            let motion = way_round(ctx, goal, obstacles, Waypoints::Fewest)?;
            self.task = Task::Transit(goal);
            let Cell { x, y, z } = goal;
            Some(Command::new(motion, WakeCondition::TASK_DONE).with_info(format!("goes past a body to {x} {y} {z}")))
        });
        self.blockages = blockages;
        if let Some(Yield::Rest(command) | Yield::Detour(command)) = standing {
            return command;
        }
        let is_near = |contact: &&Contact| {
            obstacles::is_near(contact, &ctx.position(), ctx.body().radius_m, &ctx.run_info().bodies)
        };
        let yields = observation.contacts.iter().filter(is_near).any(|contact| contact.agent < ctx.agent());
        let hold_ticks = if yields { LONG_HOLD_TICKS } else { collision_recovery::HOLD_TICKS };
        collision_recovery::step_aside_for(hold_ticks, &mut self.rng, ctx)
    }

    /// A goal that comes before the sweep, if the map has not grown for long.
    fn viewpoint_first(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Poll<Option<Cell>> {
        if !ctx.needs_viewpoints() || !self.growth.has_stalled(ctx.map(), observation.tick) {
            return Poll::Ready(None);
        }
        let found = self.viewpoint(ctx);
        if found == Poll::Ready(None) {
            self.growth.note_all_seen();
        }
        found
    }

    /// Where a body that needs viewpoints sees something unexplored.
    fn viewpoint(&mut self, ctx: &Ctx<'_>) -> Poll<Option<Cell>> {
        if !ctx.needs_viewpoints() {
            return Poll::Ready(None);
        }
        let viewpoints = self.viewpoints.get_or_insert_with(|| Viewpoints::new(ctx.run_info(), ctx.body().radius_m));
        viewpoints.visit(ctx.map().extent(), ctx.cell());
        viewpoints.next(ctx).map(|found| found.map(|viewpoint| viewpoint.cell))
    }
}

impl Controller for Boustrophedon {
    fn covers(&self) -> bool {
        true
    }

    fn is_blocked(&self) -> bool {
        self.blockages.is_waiting()
    }

    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        // Before the first scan only the own cell is known.
        if observation.scan_tick.is_none() {
            return Command::keep(WakeCondition::NEXT_TICK);
        }
        if let Task::Line(from, step) = self.task {
            Self::mark_line_covered(ctx, from, step);
        }
        if observation.events.intersects(EventMask::REVISED) {
            // The way may be closed, and what could not be reached open.
            (self.task, self.viewpoints) = (Task::None, None);
            self.abandoned.clear();
        }
        if self.task != Task::None && observation.events.intersects(EventMask::COLLISION) {
            return self.give_way(observation, ctx);
        }
        if let Some(command) = self.blockages.still_waits(observation, ctx) {
            return command;
        }
        let obstacles = Obstacles::of(observation, ctx);
        let under_way = match self.task {
            Task::Transit(goal) if goal != ctx.cell() && ctx.map().state(goal) == CellState::Free => Some(goal),
            _ => None,
        };
        let first = if under_way.is_none() { self.viewpoint_first(observation, ctx) } else { Poll::Ready(None) };
        let goal = if first == Poll::Ready(None) {
            if let Some((step, end)) = Self::next_line(ctx, &obstacles) {
                self.task = Task::Line(ctx.cell(), step);
                let motion = Motion::Path(vec![ctx.place(end)]);
                return Command::new(motion, WakeCondition::TASK_DONE).with_info("ploughs");
            }
            match under_way.or_else(|| self.nearest(observation, ctx, &|cell| !obstacles.occupy(cell))) {
                Some(goal) => Poll::Ready(Some(goal)),
                None if !obstacles.is_empty() && self.nearest(observation, ctx, &|_| true).is_some() => {
                    return self.give_way(observation, ctx);
                }
                None => self.viewpoint(ctx),
            }
        } else {
            first
        };
        let goal = match goal {
            Poll::Ready(Some(goal)) => goal,
            Poll::Ready(None) => {
                self.task = Task::None;
                let info = match ctx.needs_viewpoints() && ctx.map().frontier_count() > 0 {
                    true => NOTHING_TO_SEE,
                    false => "knows nothing to cover",
                };
                return Command::new(Motion::Stop, WakeCondition::on(EventMask::MESSAGE | EventMask::CONTACTS))
                    .with_stage(Stage::Waiting)
                    .with_info(info);
            }
            Poll::Pending => {
                return Command::new(Motion::Stop, WakeCondition::NEXT_TICK)
                    .with_stage(Stage::Waiting)
                    .with_info("looks for a viewpoint");
            }
        };
        self.task = Task::Transit(goal);
        match ctx.go_to_cell(goal, self.search_time) {
            NavigationStatus::Go(motion) => {
                let Cell { x, y, z } = goal;
                Command::new(motion, WakeCondition::TASK_DONE).with_info(format!("goes to {x} {y} {z}"))
            }
            // The body must stay at rest, since the path begins where it is now.
            NavigationStatus::Searching(wake) => Command::new(Motion::Stop, wake).with_info("searches a way"),
            NavigationStatus::NoPath => {
                self.abandoned.insert(goal);
                if let Some(viewpoints) = &mut self.viewpoints {
                    viewpoints.visit(ctx.map().extent(), goal);
                }
                self.task = Task::None;
                Command::new(Motion::Stop, WakeCondition::NEXT_TICK)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{World, flat};
    use agent::command::ScanRequest;
    use agent::observation::FieldOfView;
    use msgs::ids::Tick;

    const HALL: &str = "\
        ##########\n\
        #......#.#\n\
        #......#.#\n\
        #........#\n\
        ###.####.#\n\
        #....#...#\n\
        ##########\n";

    fn controller(search_time: &str) -> Boustrophedon {
        let mut settings = Settings::parse(&[format!("search_time={search_time}")]).unwrap();
        Boustrophedon::new(&mut settings, voxels::random_streams::stream(1, 0, "test")).unwrap()
    }

    #[test]
    fn what_is_left_to_see_comes_before_the_sweep_once_nothing_new_is_seen() {
        let mut world = World::known(&HALL.replace("#........#", "#.......?#"), flat(1, 1));
        let view = FieldOfView {
            horizontal_rad: std::f64::consts::TAU,
            lowest_rad: -0.3,
            highest_rad: 0.3,
            spacing_rad: 0.01,
            min_range_m: 0.0,
        };
        world.run_info.field_of_view = Some(view);
        world.run_info.lidar_range_m = 20.0;
        world.observation.scan_tick = Some(Tick::ZERO);
        let mut controller = controller("instant");
        let sweeps = world.ask(&mut controller);
        assert_eq!(sweeps.info, "ploughs");
        world.arrive(&sweeps.motion);
        world.wait(2000);
        let looks = world.ask(&mut controller);
        assert!(looks.info.starts_with("goes to "), "{looks:?}");
        world.arrive(&looks.motion);
        world.map.note_wall(&[world.map.extent().index(flat(8, 3)).unwrap() as u32]);
        world.ask(&mut controller);
        assert!(!controller.growth.has_stalled(&world.map, world.observation.tick));
    }

    #[test]
    fn covers_every_cell_with_few_revisits() {
        for search_time in ["instant", "budgeted", "background"] {
            let mut world = World::new(HALL, flat(1, 5));
            world.run(&mut controller(search_time), 3000);
            assert_eq!(world.left(&[CellState::Covered]), [], "{search_time}");
            let mut visited = world.been.clone();
            visited.sort();
            visited.dedup();
            let free = HALL.matches('.').count();
            assert_eq!(visited.len(), free, "{search_time}: the map says so, and so it was");
            assert!(world.been.len() < free * 3 / 2, "{search_time}: {} cells for {free}", world.been.len());
            assert_eq!(world.said.last().unwrap(), "knows nothing to cover");
        }
    }

    #[test]
    fn lines_are_straight_and_as_long_as_possible() {
        let mut world = World::new(HALL, flat(1, 5));
        world.sense();
        let command = world.ask(&mut controller("instant"));
        assert_eq!(command.motion, Motion::Path(vec![world.map.extent().centre(flat(6, 5))]));
        assert_eq!(
            (command.wake, command.lidar, command.messages.len()),
            (WakeCondition::TASK_DONE, ScanRequest::Keep, 0)
        );
    }

    #[test]
    fn cells_nearer_to_another_agent_come_last() {
        // Only two corners of a corridor are not covered.
        let mut world = World::known("#########\n#.......#\n#.......#\n#########\n", flat(3, 1));
        (1..8).for_each(|x| world.map.note_covered(flat(x, 2)));
        (2..7).for_each(|x| world.map.note_covered(flat(x, 1)));
        world.sense();
        let aside = Contact { agent: msgs::ids::AgentId(0), position: Point3::new(2.5, 2.5, 0.5) };
        world.observation.contacts = vec![aside];
        assert_eq!(world.ask(&mut controller("instant")).info, "goes to 7 1 0");
        world.map.note_covered(flat(7, 1));
        assert_eq!(world.ask(&mut controller("instant")).info, "goes to 1 1 0");
    }

    #[test]
    fn lines_and_paths_keep_clear_of_the_bodies_nearby() {
        let lane = "##########\n#........#\n##########\n";
        let mut world = World::known(lane, flat(4, 1));
        world.sense();
        let ahead = Contact { agent: msgs::ids::AgentId(0), position: Point3::new(6.5, 1.5, 0.5) };
        world.observation.contacts = vec![ahead];
        let command = world.ask(&mut controller("instant"));
        assert_eq!(command.motion, Motion::Path(vec![world.map.extent().centre(flat(5, 1))]));
        // It cannot pass, and gives way.
        (1..7).for_each(|x| world.map.note_covered(flat(x, 1)));
        assert_eq!(world.ask(&mut controller("instant")).info, "makes way");
        (7..9).for_each(|x| world.map.note_covered(flat(x, 1)));
        assert_eq!(world.ask(&mut controller("instant")).info, "knows nothing to cover");
    }

    #[test]
    fn continues_after_a_collision_with_an_agent() {
        let mut world = World::new(HALL, flat(1, 5));
        let mut controller = controller("instant");
        world.sense();
        world.ask(&mut controller);
        world.put(flat(3, 5));
        world.collide();
        assert_eq!(world.ask(&mut controller).info, "makes way");
        assert_eq!(world.map.state(flat(2, 5)), CellState::Covered, "it has been there");
        assert_eq!(world.map.state(flat(4, 5)), CellState::Free);
        world.run(&mut controller, 3000);
        assert_eq!(world.left(&[CellState::Covered]), []);
    }
}
