//! Ways to cells for controllers: asks for a path, keeps the answer back until it may be used, and makes a motion of it.
//!
//! Invariants: an answer comes in the tick that was declared when it was asked for, whatever the machine; a motion that comes
//! out of here leads only through cells that the agent knew to be free when it asked.
//!
//! This module keeps no goals: a controller that asks for another cell gives up the answer it was waiting for.

use std::num::NonZeroU64;
use std::task::Poll;

use msgs::ids::Tick;
use nalgebra::Point3;
use voxels::Cell;

use crate::command::{Motion, Trigger};
use crate::exploration_map::ExplorationMap;
use crate::path::{
    Background, Budgeted, Goal, Graph, Moves, Neighbours, Path, Scratch, Search, direct, straighten_from,
};

/// What a search for a path costs in sim time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchTime {
    /// Nothing: the answer is there at once.
    Instant,
    /// A tick for every so many cells that are looked at; see [`SearchTime::BUDGETED`].
    Budgeted(NonZeroU64),
    /// So many ticks, however hard it is. Meanwhile it is searched for on another thread.
    Background(u64),
}

impl SearchTime {
    /// The reference's pace: 100 cells in a tick.
    pub const BUDGETED: Self = Self::Budgeted(Budgeted::PER_TICK);
}

/// What came of the wish to go to a cell.
#[derive(Debug, Clone, PartialEq)]
pub enum NavigationStatus {
    /// There is a way: this motion leads there.
    Go(Motion),
    /// The search goes on; to be asked for again then.
    Searching(Trigger),
    /// The agent knows of no way.
    NoPath,
}

/// An answer that is kept back.
#[derive(Debug)]
enum Answer {
    Budgeted(Budgeted),
    Background(Background),
}

impl Answer {
    fn poll(&mut self, now: Tick) -> Poll<Option<Path>> {
        match self {
            Self::Budgeted(search) => search.poll(now).map(Option::<&Path>::cloned),
            Self::Background(search) => search.poll(now).map(Option::<&Path>::cloned),
        }
    }

    fn usable_at(&self) -> Tick {
        match self {
            Self::Budgeted(search) => search.usable_at(),
            Self::Background(search) => search.usable_at(),
        }
    }
}

#[derive(Debug)]
struct Pending {
    question: (Cell, Cell, Neighbours, SearchTime),
    answer: Answer,
}

/// The searches of one agent.
#[derive(Debug)]
pub struct NavigationTask {
    radius_m: f64,
    to_faces: Moves,
    to_all: Moves,
    scratch: Scratch,
    /// Searches give up after so many cells.
    cells_max: u64,
    pending: Option<Pending>,
    failures: u32,
}

impl NavigationTask {
    /// For a body of `radius_m` metres on cells with edges of `cell_m` metres.
    #[must_use]
    pub fn new(radius_m: f64, cell_m: f64) -> Self {
        Self {
            radius_m,
            to_faces: Moves::new(radius_m, cell_m, Neighbours::Six),
            to_all: Moves::new(radius_m, cell_m, Neighbours::TwentySix),
            scratch: Scratch::new(),
            cells_max: u64::MAX,
            pending: None,
            failures: 0,
        }
    }

    /// How often there was no way to a cell.
    #[must_use]
    pub fn failures(&self) -> u32 {
        self.failures
    }

    fn moves(&self, neighbours: Neighbours) -> &Moves {
        match neighbours {
            Neighbours::Six => &self.to_faces,
            Neighbours::TwentySix => &self.to_all,
        }
    }

    /// From now on searches find no way if they would have to look at more cells than so many, whatever they cost in sim time.
    pub fn limit_searches(&mut self, cells_max: u64) {
        self.cells_max = cells_max;
    }

    /// The moves of the body, and what its searches write on.
    pub fn search_workspace(&mut self, neighbours: Neighbours) -> (&Moves, &mut Scratch) {
        match neighbours {
            Neighbours::Six => (&self.to_faces, &mut self.scratch),
            Neighbours::TwentySix => (&self.to_all, &mut self.scratch),
        }
    }

    /// How to get from a point (metres, frame `map`) to a cell: straight if that is clear, else along the cheapest path through
    /// `neighbours`, with as few legs as do. If the search takes time, it goes on with the same question and the body at rest.
    pub fn to_cell(
        &mut self,
        map: &ExplorationMap,
        from: &Point3<f64>,
        goal: Cell,
        neighbours: Neighbours,
        time: SearchTime,
        now: Tick,
    ) -> NavigationStatus {
        if direct(map, from, goal, self.radius_m) {
            self.pending = None;
            return NavigationStatus::Go(Motion::Path(vec![map.extent().centre(goal)]));
        }
        let start = map.extent().cell_of(from);
        let Poll::Ready(path) = self.search(map, start, goal, neighbours, time, now) else {
            let at = self.pending.as_ref().map_or(Tick::ZERO, |pending| pending.answer.usable_at());
            return NavigationStatus::Searching(Trigger { at, events: 0 });
        };
        self.pending = None;
        let status = path.map_or(NavigationStatus::NoPath, |path| self.motion_along(map, from, &path));
        self.failures += u32::from(status == NavigationStatus::NoPath);
        status
    }

    /// The motion along a path that begins in the cell of the body.
    #[must_use]
    pub fn motion_along(&self, map: &ExplorationMap, from: &Point3<f64>, path: &Path) -> NavigationStatus {
        let waypoints = straighten_from(from, path, map, self.radius_m);
        // A path of one cell whose centre cannot be reached straight: the body is as near as it can get.
        if waypoints.is_empty() { NavigationStatus::NoPath } else { NavigationStatus::Go(Motion::Path(waypoints)) }
    }

    fn search(
        &mut self,
        map: &ExplorationMap,
        start: Cell,
        goal: Cell,
        neighbours: Neighbours,
        time: SearchTime,
        now: Tick,
    ) -> Poll<Option<Path>> {
        let question = (start, goal, neighbours, time);
        let pending = self.pending.take().filter(|pending| pending.question == question);
        let mut answer = match (pending, time) {
            (Some(pending), _) => pending.answer,
            (None, SearchTime::Background(ticks)) => {
                let moves = self.moves(neighbours);
                Answer::Background(Background::start(map, moves, start, vec![goal], self.cells_max, now.after(ticks)))
            }
            (None, SearchTime::Instant | SearchTime::Budgeted(_)) => {
                let cells_max = self.cells_max;
                let (moves, scratch) = self.search_workspace(neighbours);
                let mut search =
                    Search::new(Graph::new(map, moves), scratch, start, Goal::Cell(goal)).at_most(cells_max);
                match time {
                    SearchTime::Budgeted(per_tick) => Answer::Budgeted(Budgeted::new(search, now, per_tick)),
                    _ => return Poll::Ready(search.run()),
                }
            }
        };
        let polled = answer.poll(now);
        if polled.is_pending() {
            self.pending = Some(Pending { question, answer });
        }
        polled
    }
}

#[cfg(test)]
mod tests;
