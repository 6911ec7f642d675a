//! What a controller may look at besides the observation, and what helps it to act.
//!
//! This module decides nothing.

use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};
use voxels::Cell;

use crate::bodies::{BodyKind, BodyModel};
use crate::command::Motion;
use crate::exploration_map::ExplorationMap;
use crate::navigation::{NavigationStatus, NavigationTask, SearchTime};
use crate::observation::{Observation, Pose, RunInfo};
use crate::path::{Goal, Graph, Moves, Neighbours, Path, Scratch, direct, find};

/// Largest coordinate of a waypoint, metres.
const COORDINATE_MAX: f64 = 1e6;

/// The agent as its controller sees it: who and where it is, what it believes, and how it gets to places.
#[derive(Debug)]
pub struct Ctx<'a> {
    agent: AgentId,
    run_info: &'a RunInfo,
    tick: Tick,
    pose: Pose,
    map: &'a mut ExplorationMap,
    navigation: &'a mut NavigationTask,
}

impl<'a> Ctx<'a> {
    /// For an observation that is in the map already.
    #[must_use]
    pub fn new(
        agent: AgentId,
        run_info: &'a RunInfo,
        observation: &Observation,
        map: &'a mut ExplorationMap,
        navigation: &'a mut NavigationTask,
    ) -> Self {
        Self { agent, run_info, tick: observation.tick, pose: observation.pose, map, navigation }
    }

    /// The agent.
    #[must_use]
    pub fn agent(&self) -> AgentId {
        self.agent
    }

    /// What its body can do.
    #[must_use]
    pub fn body(&self) -> &'a BodyModel {
        self.run_info.bodies.of(self.agent)
    }

    /// What is known of the run.
    #[must_use]
    pub fn run_info(&self) -> &'a RunInfo {
        self.run_info
    }

    /// The tick that is answered.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Where the body is, metres, frame `map`.
    #[must_use]
    pub fn position(&self) -> Point3<f64> {
        self.pose.position
    }

    /// Heading: 0 along x, positive to the left, in (-pi, pi].
    #[must_use]
    pub fn yaw_rad(&self) -> f64 {
        self.pose.yaw_rad
    }

    /// The cell that the body is in.
    #[must_use]
    pub fn cell(&self) -> Cell {
        self.map.extent().cell_of(&self.pose.position)
    }

    /// What the agent believes of the world: all it has sensed and been told.
    #[must_use]
    pub fn map(&self) -> &ExplorationMap {
        self.map
    }

    /// Marks a free cell as covered on the agent's map; the mark is shared with the map. Nothing happens in a wall or outside the
    /// map, and an unexplored cell becomes free by it.
    pub fn mark_covered(&mut self, cell: Cell) {
        self.map.note_covered(cell);
    }

    /// The turn by the shorter way to a heading (0 along x, positive to the left).
    #[must_use]
    pub fn turn_to(&self, yaw_rad: f64) -> Motion {
        Motion::turn(yaw_rad - self.pose.yaw_rad)
    }

    /// The motion straight on in a direction (heading and elevation, radians) until something is in the way, without a turn before
    /// it; none for a body that has to turn first.
    #[must_use]
    pub fn straight_towards(&self, heading_rad: f64, pitch_rad: f64) -> Option<Motion> {
        let (yaw_sin, yaw_cos) = libm::sincos(heading_rad);
        let (pitch_sin, pitch_cos) = libm::sincos(pitch_rad);
        let extent = self.map.extent();
        let across_m: f64 = extent.size().iter().map(|&cells| f64::from(cells) * extent.cell_m()).sum();
        let end = self.pose.position + Vector3::new(yaw_cos * pitch_cos, yaw_sin * pitch_cos, pitch_sin) * across_m;
        let can_be_told = end.iter().all(|along| along.abs() <= COORDINATE_MAX);
        (self.body().kind == BodyKind::Aerial && can_be_told).then(|| Motion::Path(vec![end]))
    }

    /// How to get to the centre of a cell: straight if the agent knows that to be clear, else along the cheapest path through
    /// cells that it knows to be free, of which neighbours share a face, an edge or a corner.
    ///
    /// If the search takes time, keep still, and ask for the same cell again when it says so.
    pub fn go_to_cell(&mut self, goal: Cell, time: SearchTime) -> NavigationStatus {
        self.go_to_cell_by(goal, Neighbours::TwentySix, time)
    }

    /// As [`Ctx::go_to_cell`], along a path with these neighbours.
    pub fn go_to_cell_by(&mut self, goal: Cell, neighbours: Neighbours, time: SearchTime) -> NavigationStatus {
        self.navigation.to_cell(self.map, &self.pose.position, goal, neighbours, time, self.tick)
    }

    /// From now on [`Ctx::go_to_cell`] finds no way if its search would have to look at more cells than so many. It bounds how
    /// long a decision takes: 10 000 cells are some milliseconds.
    pub fn limit_searches(&mut self, cells_max: u64) {
        self.navigation.limit_searches(cells_max);
    }

    /// The motion along a path that begins in the cell of the body, with as few legs as do.
    #[must_use]
    pub fn follow(&self, path: &Path) -> NavigationStatus {
        self.navigation.motion_along(self.map, &self.pose.position, path)
    }

    /// Whether the straight leg to the centre of a cell is known to be clear for the body.
    #[must_use]
    pub fn is_clear_to(&self, goal: Cell) -> bool {
        direct(self.map, &self.pose.position, goal, self.body().radius_m)
    }

    /// The cells beside the body's, across a face, an edge or a corner, that [`Ctx::is_clear_to`] holds for: where it can step
    /// aside to.
    #[must_use]
    pub fn clear_neighbours(&self) -> Vec<Cell> {
        self.cell().neighbours26().into_iter().filter(|&cell| self.is_clear_to(cell)).collect()
    }

    /// The cell with the shortest way to it, through neighbours across faces, edges and corners, of those that are wanted.
    pub fn nearest(&mut self, is_wanted: impl Fn(&ExplorationMap, Cell) -> bool) -> Option<Cell> {
        let start = self.cell();
        let (map, moves, scratch) = self.search_workspace(Neighbours::TwentySix);
        let path = find(Graph::new(map, moves), scratch, start, Goal::Where(&|cell| is_wanted(map, cell)))?;
        path.cells.last().copied()
    }

    /// For searches of one's own with [`crate::path`]: the map, the moves of the body, and what searches write on.
    pub fn search_workspace(&mut self, neighbours: Neighbours) -> (&ExplorationMap, &Moves, &mut Scratch) {
        let (moves, scratch) = self.navigation.search_workspace(neighbours);
        (self.map, moves, scratch)
    }
}
