//! The context of a decision: what a controller can query besides the observation, and helpers for
//! its motion.
//!
//! This module decides nothing.

use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};
use voxels::Cell;
use voxels::footing::Climb;

use agent::bodies::{BodyKind, BodyModel};
use agent::command::Motion;
use agent::exploration_map::ExplorationMap;
use agent::navigation::{NavigationStatus, NavigationTask, SearchTime};
use agent::observation::{Contact, Energy, Observation, Pose, RunInfo};
use agent::path::{Goal, Graph, Moves, Neighbours, Path, Search, direct, find};

/// A body nearer to a leg than this is on it, metres.
const ON_LEG_M: f64 = 1e-6;

/// Most cells that a search for a detour expands, some tens of milliseconds: bodies that stay may
/// leave open all of a large map but what is wanted.
const DETOUR_CELLS_MAX: u64 = 1 << 16;

/// Largest coordinate of a waypoint, metres.
const COORDINATE_MAX: f64 = 1e6;

/// The agent as its controller sees it: identity, pose, map, and navigation.
#[derive(Debug)]
pub struct Ctx<'a> {
    agent: AgentId,
    run_info: &'a RunInfo,
    tick: Tick,
    pose: Pose,
    pub(super) energy: Option<Energy>,
    pub(super) contacts: Vec<Contact>,
    map: &'a mut ExplorationMap,
    navigation: &'a mut NavigationTask,
}

impl<'a> Ctx<'a> {
    /// The context of an observation that has been merged into the map.
    #[must_use]
    pub fn new(
        agent: AgentId,
        run_info: &'a RunInfo,
        observation: &Observation,
        map: &'a mut ExplorationMap,
        navigation: &'a mut NavigationTask,
    ) -> Self {
        // The way home keeps clear of them.
        let contacts = if observation.energy.is_some() { observation.contacts.clone() } else { Vec::new() };
        let energy = observation.energy.as_deref().cloned();
        Self { agent, run_info, tick: observation.tick, pose: observation.pose, energy, contacts, map, navigation }
    }

    /// The id of the agent.
    #[must_use]
    pub fn agent(&self) -> AgentId {
        self.agent
    }

    /// The model of its body.
    #[must_use]
    pub fn body(&self) -> &'a BodyModel {
        self.run_info.bodies.of(self.agent)
    }

    /// The static information on the run.
    #[must_use]
    pub fn run_info(&self) -> &'a RunInfo {
        self.run_info
    }

    /// The tick of the observation.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Position of the body, metres, frame `map`.
    #[must_use]
    pub fn position(&self) -> Point3<f64> {
        self.pose.position
    }

    /// Heading: 0 along x, positive to the left, in (-pi, pi].
    #[must_use]
    pub fn yaw_rad(&self) -> f64 {
        self.pose.yaw_rad
    }

    /// The cell whose place is nearest to the body: for most bodies the one that contains its
    /// centre ([`voxels::BodyLattice`]).
    #[must_use]
    pub fn cell(&self) -> Cell {
        self.cell_near(&self.pose.position)
    }

    /// The cell whose place is nearest to a point (metres, frame `map`).
    #[must_use]
    pub fn cell_near(&self, point: &Point3<f64>) -> Cell {
        self.navigation.cell_near(self.map, point)
    }

    /// Where the body is in a cell on its paths, metres, frame `map`: mostly at its centre
    /// ([`voxels::BodyLattice`]).
    #[must_use]
    pub fn place(&self, cell: Cell) -> Point3<f64> {
        self.moves().lattice().place(self.map.extent(), cell)
    }

    /// The map of the agent: all it has sensed and received.
    #[must_use]
    pub fn map(&self) -> &ExplorationMap {
        self.map
    }

    /// Marks a cell of the agent's map as covered, and with it as free if it is unexplored; the
    /// mark is shared with the map. Ignored in walls and outside the map.
    pub fn mark_covered(&mut self, cell: Cell) {
        self.map.note_covered(cell);
    }

    /// [`Ctx::mark_covered`] for cells, in this order.
    pub fn mark_all_covered(&mut self, cells: &[Cell]) {
        self.map.note_all_covered(cells);
    }

    /// The turn to a heading (0 along x, positive to the left), the shorter way round.
    #[must_use]
    pub fn turn_to(&self, yaw_rad: f64) -> Motion {
        Motion::turn(yaw_rad - self.pose.yaw_rad)
    }

    /// The motion straight on in a direction (heading and elevation, radians) until a collision,
    /// without a turn before it; `None` for a body that has to turn first.
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

    /// The motion to the [place](Ctx::place) of a cell: straight if that is known to be clear, else
    /// along the cheapest path through cells known to be free, with 26 neighbours.
    ///
    /// If the search takes time, the body must stay at rest until the wake-up condition of
    /// [`NavigationStatus::Searching`] fires; then call again with the same cell.
    pub fn go_to_cell(&mut self, goal: Cell, time: SearchTime) -> NavigationStatus {
        self.go_to_cell_by(goal, Neighbours::TwentySix, time)
    }

    /// [`Ctx::go_to_cell`] with a choice of neighbours.
    pub fn go_to_cell_by(&mut self, goal: Cell, neighbours: Neighbours, time: SearchTime) -> NavigationStatus {
        if let Some(motion) = self.recentring() {
            return NavigationStatus::Go(motion);
        }
        self.navigation.to_cell(self.map, &self.pose.position, goal, neighbours, time, self.tick)
    }

    /// Where the body goes to see a cell from nearby: that cell, or for a confined body
    /// the nearest one that it can reach within a few cells beyond its radius, and from which the
    /// cell is in sight.
    pub fn approach(&mut self, cell: Cell) -> Option<Cell> {
        self.navigation.approach(self.map, &self.pose.position, cell)
    }

    /// Brings what a confined body can reach up to date with the map, for
    /// [`Ctx::can_approach`].
    pub fn update_reachable(&mut self) {
        self.navigation.update_reachable(self.map, &self.pose.position);
    }

    /// Whether there was a cell to see `cell` from nearby ([`Ctx::approach`]) at the last update of
    /// what the body can reach.
    #[must_use]
    pub fn can_approach(&self, cell: Cell) -> bool {
        self.navigation.approach_as_known(self.map, cell).is_some()
    }

    /// Limits all later path searches to this number of expanded cells, beyond which they find no
    /// path. This bounds the wall time of a decision: 10 000 cells take some milliseconds.
    pub fn limit_searches(&mut self, cells_max: u64) {
        self.navigation.limit_searches(cells_max);
    }

    /// The motion to the place of a cell nearby that the body has to make before it can follow
    /// paths, which lead from place to place: a confined body that was stopped between
    /// them may not reach that of its own cell, because a wall is too near to it. `None` for all
    /// others, and if there is no such cell.
    #[must_use]
    pub fn recentring(&self) -> Option<Motion> {
        self.recentrings().into_iter().next()
    }

    /// [`Ctx::recentring`] and other such motions, in order of preference: a ground body that hangs
    /// over the edge of a step may also drive on over it, or back up if another body is below.
    pub(super) fn recentrings(&self) -> Vec<Motion> {
        let here = self.cell();
        if !self.is_confined() || self.is_clear_to(here) {
            return Vec::new();
        }
        let graph = self.graph(Neighbours::TwentySix);
        let level = graph.cells_near(here).find(|&cell| self.is_clear_to(cell));
        let body = self.body();
        let climb = Climb::new(body.step_max_m, body.slope_max_rad, self.map.extent().cell_m());
        let is_ground = body.kind == BodyKind::Ground && !graph.is_usable(here);
        let depths = 1..=if is_ground { climb.cells_max() } else { 0 };
        let over_edge = depths.map(|depth| here - Cell::new(0, 0, depth)).find(|&cell| graph.is_usable(cell));
        let mut steps = graph.steps();
        let up = over_edge.into_iter().flat_map(|below| {
            let is_up = |&cell: &Cell| graph.is_usable(cell) && self.is_on_step(below, cell);
            steps.next_to(here, true).filter(is_up).collect::<Vec<Cell>>()
        });
        let cells: Vec<Cell> = level.into_iter().chain(over_edge).chain(up).collect();
        cells.into_iter().map(|cell| Motion::Path(vec![self.place(cell)])).collect()
    }

    /// Whether the body is on the horizontal leg between the places of two cells.
    fn is_on_step(&self, from: Cell, to: Cell) -> bool {
        let [here, from, to] = [self.position(), self.place(from), self.place(to)].map(|place| place.xy());
        let by = to - from;
        let share = (here - from).dot(&by) / by.norm_squared();
        (0.0..=1.0).contains(&share) && (from + by * share - here).norm() < ON_LEG_M
    }

    /// The motion along a path that begins in the cell of the body, with as few legs as possible.
    #[must_use]
    pub fn follow(&self, path: &Path) -> NavigationStatus {
        self.navigation.motion_along(self.map, &self.pose.position, path)
    }

    /// Whether the straight leg to the place of a cell is known to be clear for the body.
    #[must_use]
    pub fn is_clear_to(&self, goal: Cell) -> bool {
        direct(self.map, &self.pose.position, goal, self.moves())
    }

    /// The 26 neighbours of the body's cell that are [clear](Ctx::is_clear_to).
    #[must_use]
    pub fn clear_neighbours(&self) -> Vec<Cell> {
        self.cell().neighbours26().into_iter().filter(|&cell| self.is_clear_to(cell)).collect()
    }

    /// The wanted cell with the shortest path to it, with 26 neighbours.
    pub fn nearest(&self, is_wanted: impl Fn(&ExplorationMap, Cell) -> bool) -> Option<Cell> {
        let is_goal = |cell| is_wanted(self.map, cell);
        let path = find(self.graph(Neighbours::TwentySix), self.cell(), Goal::Where(&is_goal))?;
        path.cells.last().copied()
    }

    /// [`Ctx::nearest`] with a path through open cells alone.
    pub fn nearest_through(
        &self,
        is_open: &dyn Fn(Cell) -> bool,
        is_wanted: impl Fn(&ExplorationMap, Cell) -> bool,
    ) -> Option<Cell> {
        let is_goal = |cell| is_wanted(self.map, cell);
        let search = Search::new(self.graph(Neighbours::TwentySix), self.cell(), Goal::Where(&is_goal));
        search.within(is_open).run()?.cells.last().copied()
    }

    /// The frontier among some with the shortest path through open cells alone, other than the cell
    /// of the body, unless more than [`DETOUR_CELLS_MAX`] cells are nearer.
    pub(crate) fn frontier_through(
        &self,
        is_open: &dyn Fn(Cell) -> bool,
        is_left: impl Fn(Cell) -> bool,
    ) -> Option<Cell> {
        let (map, here) = (&*self.map, self.cell());
        let is_left = |cell: Cell| cell != here && is_left(cell);
        // Without any, the search would visit all cells up to its limit.
        if !map.frontiers().any(|index| is_left(map.extent().cell_at(index as usize))) {
            return None;
        }
        let is_goal = |cell: Cell| map.is_frontier(cell) && is_left(cell);
        let search = Search::new(self.graph(Neighbours::TwentySix), here, Goal::Where(&is_goal));
        search.within(is_open).at_most(DETOUR_CELLS_MAX).run()?.cells.last().copied()
    }

    /// Whether there are free cells that the body cannot be in: it is wider than a cell, or needs a
    /// floor.
    #[must_use]
    pub fn is_confined(&self) -> bool {
        self.moves().are_confined()
    }

    /// The moves of the body, to 26 neighbours.
    #[must_use]
    pub fn moves(&self) -> &Moves {
        self.navigation.moves(Neighbours::TwentySix)
    }

    /// Whether the body has to look at some frontiers from elsewhere: because it is wider than a
    /// cell and cannot be in them, or as its LiDAR sees neither all above nor all below it.
    #[must_use]
    pub fn needs_viewpoints(&self) -> bool {
        self.is_confined() || self.run_info.field_of_view.is_some()
    }

    /// The moves of the body on its map, for path searches of a controller's own; see
    /// [`agent::path`].
    #[must_use]
    pub fn graph(&self, neighbours: Neighbours) -> Graph<'_> {
        Graph::new(self.map, self.navigation.moves(neighbours))
    }
}

#[cfg(test)]
mod tests {
    use msgs::ids::AgentId;
    use nalgebra::Point3;
    use voxels::Extent;

    use super::*;
    use crate::dsvp::avoidance::{Waypoints, way_round};
    use crate::dsvp::obstacles::Obstacles;
    use crate::testing::World;
    use agent::bodies::BodyModel;
    use agent::observation::Contact;

    /// A body that stood before the last frontiers had the whole map searched before each rest.
    #[test]
    fn search_for_a_detour_is_bounded() {
        let extent = Extent::new([100, 30, 30], 1.0).unwrap();
        let mut world = World::empty();
        world.map = ExplorationMap::new(extent);
        let behind = |cell: Cell| cell.x == 99;
        let known = extent.cells().filter(|&cell| !behind(cell)).filter_map(|cell| extent.index(cell));
        world.map.note_free(&known.map(|index| index as u32).collect::<Vec<u32>>());
        // From the other end more cells are nearer than a search may expand.
        for (x, found) in [(95.5, Some(Cell::new(98, 15, 15))), (0.5, None)] {
            world.observation.pose.position = Point3::new(x, 15.5, 15.5);
            assert_eq!(world.ctx().frontier_through(&|_| true, |_| true), found, "{x}");
        }
    }

    /// A ground body that had been stopped on its way down a step went on down into the body below
    /// it for ever, which wanted to get up.
    #[test]
    fn body_on_a_step_goes_back_up_if_another_one_is_below() {
        let extent = Extent::new([5, 9, 6], 1.0).unwrap();
        let body = BodyModel { radius_m: 0.4, step_max_m: 1.0, ..BodyModel::GROUND };
        let mut world = World::empty().with_body(body);
        world.map = ExplorationMap::new(extent);
        for (index, cell) in (0..).zip(extent.cells()) {
            let is_border = [(cell.x, 4), (cell.y, 8), (cell.z, 5)].iter().any(|&(at, last)| at == 0 || at == last);
            let is_floor = cell.z <= if cell.y <= 4 { 1 } else { 0 };
            if is_border || is_floor { world.map.note_wall(&[index]) } else { world.map.note_free(&[index]) }
        }
        world.observation.pose.position = Point3::new(2.5, 5.4, 2.0);
        let way = |world: &mut World| {
            let observation = world.observation.clone();
            let ctx = world.ctx();
            let to = Cell::new(2, 2, 2);
            way_round(&ctx, to, &Obstacles::of(&observation, &ctx), Waypoints::Fewest)
        };
        assert_eq!(way(&mut world), Some(Motion::Path(vec![Point3::new(2.5, 5.5, 1.5)])));
        let position = Point3::new(2.5, 6.02, 1.5);
        world.observation.contacts.push(Contact { agent: AgentId(0), position });
        assert_eq!(way(&mut world), Some(Motion::Path(vec![Point3::new(2.5, 4.5, 2.5)])));
    }
}
