//! The tasks of a map: viewpoints that together see what is behind the frontiers of some regions.
//!
//! Each region with frontiers offers its centre. Of all, the one that adds most expected free cells
//! is chosen first, then the one that adds most to that (greedy set cover), down to a least gain; a
//! region of which nothing is seen by those chosen is a task of its own, however little it may
//! hide.
//!
//! Source: C. Cao, H. Zhu, H. Choset, J. Zhang, "TARE: A Hierarchical Framework for Efficiently
//! Exploring Complex 3D Environments", RSS 2021 (viewpoints that cover all surfaces by a submodular
//! gain); here for frontiers and by probabilities.
//!
//! Invariant: the tasks depend on the map, the regions and the cells to leave out alone; what is
//! kept between two plans is memory to use again. This module plans no tours.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};
use std::ops::Range;

use voxels::{Cell, CellSet, Extent};

use super::avoidance::motion_to;
use super::expectation::{Expectation, Place};
use super::gain::{GainEstimator, WHOLE};
use super::goal::Goal;
use super::obstacles::Obstacles;
use super::relocation::{Sight, nearest_viewpoint, seen_from};
use super::{ATTEMPTS, Dsvp, Params, Plan, has_gain_left};
use crate::Ctx;
use agent::abstract_graph::{AbstractGraph, PathLengths, Region, RegionId, ShortestPaths};
use agent::exploration_map::{CellState, ExplorationMap};

/// A viewpoint to visit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Task {
    pub(super) region: RegionId,
    /// The viewpoint.
    pub(super) cell: Cell,
    /// A frontier of the region.
    pub(super) frontier: Cell,
    /// Expected number of free cells that it adds to those of the tasks chosen before.
    pub(super) expected_cells: f64,
}

/// A task with the length of the path to it from here, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ReachedTask {
    pub(super) task: Task,
    pub(super) own_m: f64,
}

/// What the planner has beside the state of its coordination.
pub(super) struct Surroundings<'p> {
    pub(super) graph: &'p AbstractGraph,
    pub(super) params: &'p Params,
    pub(super) paths: &'p mut ShortestPaths,
    gain_estimator: &'p mut GainEstimator,
    goal: Option<Goal>,
    abandoned: &'p mut BTreeSet<Cell>,
    unproductive: &'p mut BTreeSet<Cell>,
}

impl Surroundings<'_> {
    /// Finds the paths from a cell to all regions.
    pub(super) fn reach_all(&mut self, here: Cell) {
        self.paths.begin(self.graph, here);
        while self.paths.next(self.graph).is_some() {}
    }
}

impl<C> Dsvp<C> {
    /// What is around the agent, and its coordination.
    pub(super) fn split(&mut self) -> (Surroundings<'_>, &mut C) {
        let Self { params, graph, paths, gain_estimator, goal, abandoned, unproductive, coordination, .. } = self;
        (Surroundings { graph, params, paths, gain_estimator, goal: *goal, abandoned, unproductive }, coordination)
    }
}

/// Finds the tasks of an agent at each of its plans.
#[derive(Debug)]
pub(super) struct TaskSearch {
    viewpoints: Viewpoints,
    /// Most regions with frontiers, the nearest ones.
    regions: usize,
    /// Expected free cells from which on a viewpoint is a task.
    expected_min: f64,
}

impl TaskSearch {
    pub(super) fn new(extent: Extent, regions: usize, expected_min: f64) -> Self {
        Self { viewpoints: Viewpoints::new(extent), regions, expected_min }
    }

    /// The tasks of the nearest regions with frontiers, those that add most first.
    pub(super) fn tasks(&mut self, at: &mut Surroundings<'_>, ctx: &Ctx<'_>) -> Vec<ReachedTask> {
        let Surroundings { graph, params, paths, gain_estimator, goal, abandoned, unproductive } = at;
        let (map, here) = (ctx.map(), ctx.cell());
        if has_gain_left(*goal, here, map, gain_estimator, params.gain_min) {
            unproductive.insert(here);
        }
        let cell_m = map.extent().cell_m();
        let sight = Sight::of(ctx);
        let mut candidates = Vec::new();
        let mut own_m = BTreeMap::new();
        paths.begin(graph, here);
        while candidates.len() < self.regions
            && paths.has_frontiers_left()
            && let Some((id, region, length)) = paths.next(graph)
        {
            let Some(candidate) = Candidate::new(graph, sight, (id, region), here, abandoned) else { continue };
            if candidate.cell == here {
                abandoned.extend(seen_from(graph, (id, region), here));
                continue;
            }
            candidates.push(candidate);
            own_m.insert(id, length * cell_m);
        }
        let is_unproductive = |cell: Cell| cell == here || unproductive.contains(&cell);
        let tasks = self.viewpoints.tasks(map, gain_estimator, &candidates, &is_unproductive, self.expected_min);
        tasks.into_iter().map(|task| ReachedTask { task, own_m: own_m[&task.region] }).collect()
    }

    /// The plan to go to the first of some tasks to which a path avoids the other agents.
    pub(super) fn go<'t>(
        &self,
        tasks: impl IntoIterator<Item = &'t Task>,
        at: &mut Surroundings<'_>,
        ctx: &mut Ctx<'_>,
        obstacles: &Obstacles,
    ) -> Plan {
        let mut tried = Vec::new();
        for task in tasks.into_iter().take(ATTEMPTS) {
            tried.push(task.frontier);
            if let Some(motion) = motion_to(ctx, at.graph, at.paths, task.cell, obstacles, at.params.waypoints) {
                return Plan::Go(self.goal(task, at, ctx), motion);
            }
        }
        // No body blocks the paths: there are none.
        if obstacles.is_empty() && !tried.is_empty() {
            at.abandoned.extend(tried);
            return Plan::Pending;
        }
        Plan::Blocked
    }

    /// The goal of a task: its viewpoint, if that has a gain, or else its frontier.
    fn goal(&self, task: &Task, at: &mut Surroundings<'_>, ctx: &Ctx<'_>) -> Goal {
        let gain = at.gain_estimator.gain(ctx.map(), task.cell);
        if gain >= at.params.gain_min && task.expected_cells >= self.expected_min {
            Goal::Viewpoint { cell: task.cell, gain }
        } else {
            Goal::Frontier { cell: task.cell, frontier: task.frontier }
        }
    }
}

/// Lengths of the paths from task to task, cells; `None` where there is none.
///
/// A path is as long as the way back. The searches from the tasks that come first in `order` cover
/// the map, and those that are left stay among the tasks that come later: those farthest from here
/// come first.
pub(super) fn lengths_between(
    lengths: &mut PathLengths,
    graph: &AbstractGraph,
    tasks: &[Task],
    order: &[usize],
) -> Vec<Vec<Option<f64>>> {
    let mut between = vec![vec![None; tasks.len()]; tasks.len()];
    for (done, &from) in order.iter().enumerate() {
        let left = &order[done..];
        lengths.begin(graph, tasks[from].cell, left.iter().map(|&to| tasks[to].region));
        for &to in left {
            let length = lengths.to(graph, tasks[to].region);
            between[from][to] = length;
            between[to][from] = length;
        }
    }
    between
}

/// A region with frontiers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Candidate {
    pub(super) region: RegionId,
    pub(super) centre: Cell,
    /// The frontier nearest to the centre.
    pub(super) frontier: Cell,
    /// The viewpoint of the frontier.
    pub(super) cell: Cell,
}

impl Candidate {
    /// The candidate of a region, if it has a frontier that is not left out.
    pub(super) fn new(
        graph: &AbstractGraph,
        sight: Sight<'_>,
        (id, region): (RegionId, &Region),
        here: Cell,
        left_out: &BTreeSet<Cell>,
    ) -> Option<Self> {
        let (frontier, cell) = nearest_viewpoint(graph, sight, (id, region), here, left_out)?;
        Some(Self { region: id, centre: region.centre, frontier, cell })
    }
}

/// Chooses the tasks of one agent.
#[derive(Debug)]
pub(super) struct Viewpoints {
    expectation: Expectation,
    extent: Extent,
    /// The unexplored cells that the rays of the viewpoints offered meet, viewpoint by viewpoint,
    /// with their probabilities to be free and seen, in units of 1 / [`WHOLE`].
    seen: Vec<(u32, u32)>,
    /// What the tasks chosen see.
    covered: CellSet,
}

/// A viewpoint that a region offers.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Offer {
    /// Sum of the probabilities of the cells that it adds to the tasks chosen before.
    gain: u64,
    /// The number of its candidate; of equal gains the first one is chosen.
    number: Reverse<usize>,
    /// The number of tasks that had been chosen when the gain was computed.
    as_of: usize,
    /// The place of its cells in [`Viewpoints::seen`].
    seen: (usize, usize),
}

impl Offer {
    fn seen(&self) -> Range<usize> {
        self.seen.0..self.seen.1
    }
}

impl Viewpoints {
    pub(super) fn new(extent: Extent) -> Self {
        let covered = CellSet::new(extent.volume());
        Self { expectation: Expectation::new(), extent, seen: Vec::new(), covered }
    }

    /// The tasks of some regions, those that add most first. `is_unproductive` names viewpoints
    /// from which a scan did not show what was expected.
    pub(super) fn tasks(
        &mut self,
        map: &ExplorationMap,
        gain_estimator: &mut GainEstimator,
        candidates: &[Candidate],
        is_unproductive: &dyn Fn(Cell) -> bool,
        expected_min: f64,
    ) -> Vec<Task> {
        self.seen.clear();
        let mut offers = BinaryHeap::new();
        for (number, &Candidate { centre, .. }) in candidates.iter().enumerate() {
            if is_unproductive(centre) {
                continue;
            }
            let start = self.seen.len();
            gain_estimator.expected(map, centre, &self.expectation, &mut self.seen);
            let gain = self.seen[start..].iter().map(|&(_, chance)| u64::from(chance)).sum();
            offers.push(Offer { gain, number: Reverse(number), as_of: 0, seen: (start, self.seen.len()) });
        }
        self.covered.clear();
        let mut tasks = Vec::new();
        // A gain only falls as others are chosen: one that is up to date and still the greatest is
        // the greatest of all.
        while let Some(offer) = offers.pop() {
            let expected_cells = offer.gain as f64 / f64::from(WHOLE);
            if expected_cells < expected_min {
                break;
            }
            let seen = &self.seen[offer.seen()];
            if offer.as_of < tasks.len() {
                let left = seen.iter().filter(|&&(index, _)| !self.covered.contains(index as usize));
                let gain = left.map(|&(_, chance)| u64::from(chance)).sum();
                offers.push(Offer { gain, as_of: tasks.len(), ..offer });
                continue;
            }
            seen.iter().for_each(|&(index, _)| self.covered.insert(index as usize));
            let Candidate { region, frontier, centre, .. } = candidates[offer.number.0];
            tasks.push(Task { region, cell: centre, frontier, expected_cells });
        }
        let chosen: BTreeSet<RegionId> = tasks.iter().map(|task| task.region).collect();
        let left = candidates.iter().filter(|candidate| !chosen.contains(&candidate.region));
        tasks.extend(left.filter_map(|candidate| self.remnant(map, candidate, expected_min)));
        tasks
    }

    /// The task of a region of which the tasks chosen see nothing.
    fn remnant(&self, map: &ExplorationMap, candidate: &Candidate, expected_min: f64) -> Option<Task> {
        let unexplored = candidate.frontier.neighbours6().into_iter().filter_map(|beside| {
            (map.state(beside) == CellState::Unexplored).then_some((beside, self.extent.index(beside)?))
        });
        let mut chances = 0;
        for (beside, index) in unexplored {
            if self.covered.contains(index) {
                return None;
            }
            chances += self.expectation.of(map.around(beside), Place::AtFrontier);
        }
        let expected_cells = (f64::from(chances) / f64::from(WHOLE)).min(expected_min);
        let Candidate { region, cell, frontier, .. } = *candidate;
        Some(Task { region, cell, frontier, expected_cells })
    }
}
