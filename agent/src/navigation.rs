//! Navigation to cells for controllers: requests a path, holds the result back until its sim time,
//! and makes a motion of it.
//!
//! Invariants: a result is available in the tick fixed at the request, on any machine; every motion
//! leads only through cells that were known to be free at the request.
//!
//! For a confined body, wider than a cell or on the ground, the navigation task also knows which
//! cells it can reach ([`NavigationTask::approach`]), and searches no path to the others.
//!
//! Only one request is pending at a time: a request for another cell replaces it.

use std::num::NonZeroU64;
use std::task::Poll;

use msgs::ids::Tick;
use nalgebra::Point3;
use protocol::body_model::BodyModel;
use protocol::event_mask::EventMask;
use voxels::Cell;

use crate::command::{Motion, WakeCondition};
use crate::exploration_map::ExplorationMap;
use crate::path::{
    Background, Budgeted, Goal, Graph, Moves, Neighbours, Path, Reachable, Search, direct, straighten_from,
};

/// The sim time of a path search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchTime {
    /// None: the result is available at once.
    Instant,
    /// One tick per this many expanded cells; see [`SearchTime::BUDGETED`].
    Budgeted(NonZeroU64),
    /// A fixed number of ticks, while another thread searches.
    Background(u64),
}

impl SearchTime {
    /// The rate of the reference: 100 cells per tick.
    pub const BUDGETED: Self = Self::Budgeted(Budgeted::PER_TICK);
}

/// The status of a navigation request.
#[derive(Debug, Clone, PartialEq)]
pub enum NavigationStatus {
    /// A path exists: this motion follows it.
    Go(Motion),
    /// The search is pending: repeat the request when the wake-up condition is met.
    Searching(WakeCondition),
    /// No path is known.
    NoPath,
}

/// A result that is held back.
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

/// The navigation task of one agent: the pending path search, and what searches need.
#[derive(Debug)]
pub struct NavigationTask {
    to_faces: Moves,
    to_all: Moves,
    /// Limit of expanded cells of a search.
    cells_max: u64,
    pending: Option<Pending>,
    failures: u32,
    reachable: Reachable,
}

impl NavigationTask {
    /// For a body on cells with edges of `cell_m` metres.
    #[must_use]
    pub fn new(body: &BodyModel, cell_m: f64) -> Self {
        Self {
            to_faces: Moves::of(body, cell_m, Neighbours::Six),
            to_all: Moves::of(body, cell_m, Neighbours::TwentySix),
            cells_max: u64::MAX,
            pending: None,
            failures: 0,
            reachable: Reachable::default(),
        }
    }

    /// Ends the pending search and forgets the limit of searches, for another controller.
    pub fn reset(&mut self) {
        (self.cells_max, self.pending) = (u64::MAX, None);
    }

    /// Number of requests without a path.
    #[must_use]
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// The moves of the body.
    #[must_use]
    pub fn moves(&self, neighbours: Neighbours) -> &Moves {
        match neighbours {
            Neighbours::Six => &self.to_faces,
            Neighbours::TwentySix => &self.to_all,
        }
    }

    /// The cell whose place is nearest to a point (metres, frame `map`).
    #[must_use]
    pub fn cell_near(&self, map: &ExplorationMap, point: &Point3<f64>) -> Cell {
        self.to_all.lattice().cell_near(map.extent(), point)
    }

    /// Limits later searches to this number of expanded cells, beyond which they find no path,
    /// whatever their sim time.
    pub fn limit_searches(&mut self, cells_max: u64) {
        self.cells_max = cells_max;
    }

    /// Where a body goes to see a cell from nearby: that cell, or for a confined body the nearest
    /// one that it can reach from `from`, within a few cells beyond its radius, and from which the
    /// cell is in sight.
    pub fn approach(&mut self, map: &ExplorationMap, from: &Point3<f64>, cell: Cell) -> Option<Cell> {
        self.update_reachable(map, from);
        self.approach_as_known(map, cell)
    }

    /// Brings what a confined body can reach from `from` up to date with the map.
    pub fn update_reachable(&mut self, map: &ExplorationMap, from: &Point3<f64>) {
        if self.to_all.are_confined() {
            let graph = Graph::new(map, &self.to_all);
            self.reachable.update(graph, self.to_all.lattice().cell_near(map.extent(), from));
        }
    }

    /// [`NavigationTask::approach`] by what could be reached at the last update.
    #[must_use]
    pub fn approach_as_known(&self, map: &ExplorationMap, cell: Cell) -> Option<Cell> {
        if !self.to_all.are_confined() {
            return Some(cell);
        }
        let graph = Graph::new(map, &self.to_all);
        graph.cells_near(cell).find(|&near| self.reachable.holds(graph, near) && map.is_in_sight(near, cell))
    }

    /// The motion from a point (metres, frame `map`) to a cell: straight if that is clear, else
    /// along the cheapest path through `neighbours`, with as few legs as possible. A pending search
    /// continues with the same request and the body at rest.
    pub fn to_cell(
        &mut self,
        map: &ExplorationMap,
        from: &Point3<f64>,
        goal: Cell,
        neighbours: Neighbours,
        time: SearchTime,
        now: Tick,
    ) -> NavigationStatus {
        if direct(map, from, goal, &self.to_all) {
            self.pending = None;
            return NavigationStatus::Go(Motion::Path(vec![self.to_all.lattice().place(map.extent(), goal)]));
        }
        let start = self.cell_near(map, from);
        self.update_reachable(map, from);
        if self.to_all.are_confined() && !self.reachable.holds(Graph::new(map, &self.to_all), goal) {
            self.pending = None;
            return NavigationStatus::NoPath;
        }
        let Poll::Ready(path) = self.search(map, start, goal, neighbours, time, now) else {
            let at = self.pending.as_ref().map_or(Tick::ZERO, |pending| pending.answer.usable_at());
            return NavigationStatus::Searching(WakeCondition { at, events: EventMask::empty() });
        };
        self.pending = None;
        let status = path.map_or(NavigationStatus::NoPath, |path| self.motion_along(map, from, &path));
        self.failures += u32::from(status == NavigationStatus::NoPath);
        status
    }

    /// The motion along a path that begins in the cell of the body.
    #[must_use]
    pub fn motion_along(&self, map: &ExplorationMap, from: &Point3<f64>, path: &Path) -> NavigationStatus {
        let waypoints = straighten_from(from, path, map, &self.to_all);
        // A path of one cell whose centre cannot be reached straight: the body is as near as it can
        // get.
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
                let graph = Graph::new(map, self.moves(neighbours));
                let mut search = Search::new(graph, start, Goal::Cell(goal)).at_most(self.cells_max);
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
