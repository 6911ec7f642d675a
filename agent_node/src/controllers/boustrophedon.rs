//! Boustrophedon: ploughs the free space line by line until the body has been in every cell, as an ox ploughs a field. It covers, and
//! explores on the way.
//!
//! From where it is, the agent goes straight on through free cells that nobody has covered: along x as far as they reach, or else one
//! cell along y, or else one along z, so that lines fill a layer and layers a hall (Choset and Pignon, Coverage Path Planning: The
//! Boustrophedon Cellular Decomposition, FSR 1997, with the map that is there in place of cells that are known before). Where no
//! such cell is left beside it, it goes by the shortest way to the nearest one that is not nearer to an agent in contact; then to
//! the nearest of all. What others say they have covered is on the map, and is left to them.
//!
//! It asks for the next line when one is at its end, and so takes few decisions. Unexplored space it ploughs as soon as it is seen.

use std::collections::BTreeSet;

use msgs::maes_msgs::Wake as Events;
use nalgebra::Point3;
use rand_chacha::ChaCha8Rng;
use voxels::Cell;

use super::settings::{SettingError, Settings};
use super::{Controller, Ctx, aside};
use crate::command::{Command, Motion, Wake};
use crate::exploration_map::{CellState, ExplorationMap};
use crate::observation::Observation;
use crate::travel::{Journey, SearchTime};

/// Where a line may lead, the first ones first, and how many cells far.
const LINES: [(Cell, u32); 6] = [
    (Cell::new(1, 0, 0), LINE_CELLS_MAX),
    (Cell::new(-1, 0, 0), LINE_CELLS_MAX),
    (Cell::new(0, 1, 0), 1),
    (Cell::new(0, -1, 0), 1),
    (Cell::new(0, 0, 1), 1),
    (Cell::new(0, 0, -1), 1),
];

/// Cells of a line at the most: more would not be a longer way between two decisions, but a later look at what others have done.
const LINE_CELLS_MAX: u32 = 32;

/// What an agent is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Task {
    /// Nothing.
    None,
    /// A line that has begun in this cell, by this step from cell to cell.
    Line(Cell, Cell),
    /// On its way to this cell.
    Way(Cell),
}

/// The controller of one agent.
#[derive(Debug, Clone)]
pub struct Boustrophedon {
    search_time: SearchTime,
    rng: ChaCha8Rng,
    task: Task,
    /// Cells to which there was no way.
    given_up: BTreeSet<Cell>,
}

impl Boustrophedon {
    /// Settings: `search_time`, see [`Settings::search_time`].
    ///
    /// # Errors
    /// If a setting is not allowed.
    pub fn new(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let search_time = settings.search_time()?;
        Ok(Self { search_time, rng, task: Task::None, given_up: BTreeSet::new() })
    }

    /// Notes the cells of a line that the body has been in: it was not asked in each of them. Somebody may have put it elsewhere.
    fn note_line(ctx: &mut Ctx<'_>, from: Cell, step: Cell) {
        let here = ctx.cell();
        let line = std::iter::successors(Some(from), |&cell| Some(cell + step)).take(LINE_CELLS_MAX as usize + 1);
        if let Some(passed) = line.clone().position(|cell| cell == here) {
            line.take(passed).for_each(|cell| ctx.mark_covered(cell));
        }
    }

    /// The step and the end of the line that is to be gone next, if there is one.
    fn line(ctx: &Ctx<'_>) -> Option<(Cell, Cell)> {
        let here = ctx.cell();
        // Lines lead from centre to centre.
        if ctx.map().extent().centre(here) != ctx.position() {
            return None;
        }
        LINES.iter().find_map(|&(step, cells_max)| {
            let mut end = here;
            for _ in 0..cells_max {
                let next = end + step;
                if ctx.map().state(next) != CellState::Free || !ctx.is_clear_to(next) {
                    break;
                }
                end = next;
            }
            (end != here).then_some((step, end))
        })
    }

    /// The nearest cell that is to be covered, by way: one that is not nearer to another agent in contact, if there is one.
    fn nearest(&self, observation: &Observation, ctx: &mut Ctx<'_>) -> Option<Cell> {
        let here = ctx.position();
        let others: Vec<Point3<f64>> = observation.contacts.iter().map(|contact| contact.position).collect();
        let is_wanted =
            |map: &ExplorationMap, cell| map.state(cell) == CellState::Free && !self.given_up.contains(&cell);
        let is_ours = |map: &ExplorationMap, cell: Cell| {
            let centre = map.extent().centre(cell);
            let own_m = (centre - here).norm();
            others.iter().all(|other| (centre - other).norm() >= own_m)
        };
        let ours = ctx.nearest(|map, cell| is_wanted(map, cell) && is_ours(map, cell));
        if ours.is_some() || others.is_empty() { ours } else { ctx.nearest(is_wanted) }
    }
}

impl Controller for Boustrophedon {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        // Before the first scan it knows nothing but its own cell.
        if observation.scan_tick.is_none() {
            return Command::keep(Wake::NEXT_TICK);
        }
        if let Task::Line(from, step) = self.task {
            Self::note_line(ctx, from, step);
        }
        if self.task != Task::None && observation.events & Events::COLLISION != 0 {
            self.task = Task::None;
            return aside::make_way(&mut self.rng, ctx);
        }
        if let Some((step, end)) = Self::line(ctx) {
            self.task = Task::Line(ctx.cell(), step);
            let motion = Motion::Path(vec![ctx.map().extent().centre(end)]);
            return Command::new(motion, Wake::TASK_DONE).saying("ploughs");
        }
        let under_way = match self.task {
            Task::Way(goal) if goal != ctx.cell() && ctx.map().state(goal) == CellState::Free => Some(goal),
            _ => None,
        };
        let Some(goal) = under_way.or_else(|| self.nearest(observation, ctx)) else {
            self.task = Task::None;
            return Command::new(Motion::Stop, Wake::on(Events::PARCEL | Events::CONTACTS))
                .saying("knows nothing to cover");
        };
        self.task = Task::Way(goal);
        match ctx.go_to_cell(goal, self.search_time) {
            Journey::Go(motion) => {
                let Cell { x, y, z } = goal;
                Command::new(motion, Wake::TASK_DONE).saying(format!("goes to {x} {y} {z}"))
            }
            // The body has to keep still, or the way would begin where it is no more.
            Journey::Searching(wake) => Command::new(Motion::Stop, wake).saying("searches a way"),
            Journey::NoWay => {
                self.given_up.insert(goal);
                self.task = Task::None;
                Command::new(Motion::Stop, Wake::NEXT_TICK)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::LidarRequest;
    use crate::controllers::testing::{World, flat};
    use crate::observation::Contact;

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
        Boustrophedon::new(&mut settings, random_streams::stream(1, 0, "test")).unwrap()
    }

    #[test]
    fn the_body_is_in_every_cell_and_hardly_in_one_twice() {
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
    fn lines_are_straight_and_as_long_as_they_can_be() {
        let mut world = World::new(HALL, flat(1, 5));
        world.look();
        let command = world.ask(&mut controller("instant"));
        assert_eq!(command.motion, Motion::Path(vec![world.map.extent().centre(flat(6, 5))]));
        assert_eq!((command.wake, command.lidar, command.parcels.len()), (Wake::TASK_DONE, LidarRequest::Keep, 0));
    }

    #[test]
    fn what_is_nearer_to_another_agent_is_left_to_it_while_there_is_something_else() {
        // All is covered but both ends of a corridor.
        let mut world = World::known("#########\n#.......#\n#########\n", flat(3, 1));
        (2..7).for_each(|x| world.map.note_covered(flat(x, 1)));
        world.look();
        let aside = Contact { agent: msgs::ids::AgentId(0), position: Point3::new(2.5, 1.5, 0.5) };
        world.observation.contacts = vec![aside];
        assert_eq!(world.ask(&mut controller("instant")).info, "goes to 7 1 0");
        world.map.note_covered(flat(7, 1));
        assert_eq!(world.ask(&mut controller("instant")).info, "goes to 1 1 0");
    }

    #[test]
    fn goes_on_after_somebody_was_in_the_way() {
        let mut world = World::new(HALL, flat(1, 5));
        let mut controller = controller("instant");
        world.look();
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
