//! Test harness for controllers: a small world drawn as text, with one agent.
//!
//! It is driven in one of two modes. Step by step: [`World::sense`], [`World::ask`], and then
//! [`World::arrive`] or [`World::collide`], which end a motion at once. Or in ticks:
//! [`World::run`], in which the agent scans before each decision and moves along its waypoints. The
//! body is a point that moves half a metre in a tick and turns at once, unlike the server's; only
//! velocities are followed as there.
//!
//! Invariant: every command of a controller is legal, or the test fails (`legal`).

mod legal;

use std::collections::VecDeque;

use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};
use protocol::event_mask::EventMask;
use protocol::kinematics::turned;
use voxels::{Cell, Extent, Grid, Terrain, line_of_sight};

use super::{Controller, Ctx, Setup};
use agent::bodies::{Bodies, BodyKind, BodyModel};
use agent::command::{Command, Motion, WakeCondition};
use agent::exploration_map::{CellState, ExplorationMap};
use agent::navigation::NavigationTask;
use agent::observation::{Cells, Collision, Contact, Observation, Pose, RunInfo, Surface};
use agent::path::{BodyState, HeldVelocity};
use agent::testing::idle_at;
pub(crate) use agent::testing::{RADIUS_M, drawn, flat};

/// The id of the agent.
const AGENT: AgentId = AgentId(1);

/// Distance covered in a tick.
const STEP_M: f64 = 0.5;

/// Distance between bodies below which they collide.
const NEAR_M: f64 = 2.0 * RADIUS_M;

/// At rest in the middle of a cube of ten cells, in the first tick, without events and before the
/// first scan.
pub(crate) fn idle() -> Observation {
    idle_at(AGENT, Point3::new(5.5, 5.5, 5.5))
}

/// The same after a collision with rock.
pub(crate) fn collided(observation: Observation, surface: Surface) -> Observation {
    Observation { collision: Some(Collision { surface, with_agent: false }), ..observation }
}

/// One agent in a world.
pub(crate) struct World {
    terrain: Grid<Terrain>,
    pub(crate) run_info: RunInfo,
    navigation: NavigationTask,
    pub(crate) map: ExplorationMap,
    /// The next observation. Agents in contact are obstacles when it moves in ticks.
    pub(crate) observation: Observation,
    waypoints: VecDeque<Point3<f64>>,
    /// The turn that it makes in the next tick.
    turn_rad: Option<f64>,
    /// The velocity that the body holds, if it does.
    held: Option<HeldVelocity>,
    wake: WakeCondition,
    wants_view: bool,
    /// The texts for people so far.
    pub(crate) said: Vec<String>,
    pub(crate) decisions: u32,
    pub(crate) collisions: u32,
    /// Cells visited by the body while it moved in ticks, in order.
    pub(crate) been: Vec<Cell>,
}

impl World {
    /// At the centre of a free cell of a drawn world; `?` is wall there, and nothing is known.
    pub(crate) fn new(text: &str, start: Cell) -> Self {
        let terrain = Grid::from_text(&text.replace('?', "#")).unwrap();
        assert_eq!(terrain.get(start), Some(&Terrain::Free));
        Self::of(terrain, start)
    }

    /// The same with all cells but `?` known, before the first scan.
    pub(crate) fn known(text: &str, start: Cell) -> Self {
        Self { map: drawn(text), ..Self::new(text, start) }
    }

    /// The world with bodies that need not turn first.
    pub(crate) fn aerial(mut self) -> Self {
        self.run_info.bodies =
            team_of(BodyModel { kind: BodyKind::Aerial, radius_m: RADIUS_M, ..BodyModel::SUBMARINE });
        self
    }

    /// The world with bodies of a model.
    pub(crate) fn with_body(mut self, body: BodyModel) -> Self {
        self.navigation = NavigationTask::new(&body, self.map.extent().cell_m());
        self.run_info.bodies = team_of(body);
        self
    }

    /// The empty, unexplored cube of [`idle`].
    pub(crate) fn empty() -> Self {
        Self::of(Grid::new(Extent::new([10; 3], 1.0).unwrap(), Terrain::Free), Cell::new(5, 5, 5))
    }

    fn of(terrain: Grid<Terrain>, start: Cell) -> Self {
        let extent = terrain.extent();
        let run_info = RunInfo {
            duration: Tick(90_000),
            extent,
            agents: 3,
            agents_seed: 1,
            controller: String::new(),
            settings: Vec::new(),
            bodies: team_of(BodyModel { radius_m: RADIUS_M, ..BodyModel::SUBMARINE }),
            lidar_range_m: f64::INFINITY,
            field_of_view: None,
            lidar_period_ticks: 10,
            communication_range_m: f64::INFINITY,
            relays_per_agent: 2,
            share_period_ticks: 251,
            base_stations: Vec::new(),
        };
        let pose = Pose { position: extent.centre(start), yaw_rad: 0.0 };
        Self {
            terrain,
            run_info,
            navigation: NavigationTask::new(&BodyModel { radius_m: RADIUS_M, ..BodyModel::SUBMARINE }, 1.0),
            map: ExplorationMap::new(extent),
            observation: Observation { pose, ..idle() },
            waypoints: VecDeque::new(),
            turn_rad: None,
            held: None,
            wake: WakeCondition::NEXT_TICK,
            wants_view: false,
            said: Vec::new(),
            decisions: 0,
            collisions: 0,
            been: vec![start],
        }
    }

    /// What a controller of the agent is built from.
    pub(crate) fn setup(&self) -> Setup<'_> {
        Setup { agent: AGENT, run_info: &self.run_info, rng: voxels::random_streams::stream(1, 0, "test") }
    }

    /// All free cells in line of sight, and the walls beside them.
    pub(crate) fn view(&self) -> Cells {
        let extent = self.terrain.extent();
        let here = self.observation.pose.position;
        let is_free = |cell: Cell| self.terrain.get(cell) == Some(&Terrain::Free);
        let is_seen = |cell: Cell| is_free(cell) && line_of_sight(&self.terrain, &here, &extent.centre(cell));
        let free: Vec<Cell> = extent.cells().filter(|&cell| is_seen(cell)).collect();
        let mut wall: Vec<Cell> = free.iter().flat_map(|cell| cell.neighbours6()).collect();
        wall.retain(|&cell| extent.contains(cell) && !is_free(cell));
        let indices = |cells: Vec<Cell>| {
            let mut indices: Vec<u32> = cells.into_iter().map(|cell| extent.index(cell).unwrap() as u32).collect();
            indices.sort_unstable();
            indices.dedup();
            indices
        };
        Cells { free: indices(free), wall: indices(wall) }
    }

    /// A scan: reveals all visible cells, and includes the view if the controller has requested it.
    pub(crate) fn sense(&mut self) {
        let view = self.view();
        let extent = self.map.extent();
        let is_new = |&cell: &u32| self.map.state(extent.cell_at(cell as usize)) == CellState::Unexplored;
        let of_new = |cells: &[u32]| cells.iter().copied().filter(is_new).collect();
        let seen = Cells { free: of_new(&view.free), wall: of_new(&view.wall) };
        self.map.note_free(&seen.free);
        self.map.note_wall(&seen.wall);
        self.map.note_covered(extent.cell_of(&self.observation.pose.position));
        self.observation.seen = seen;
        self.observation.view = self.wants_view.then_some(view);
        self.observation.scan_tick = Some(self.observation.tick);
    }

    /// Replaces the last scan by these cells.
    pub(crate) fn show(&mut self, cells: &[Cell]) {
        let mut free: Vec<u32> = cells.iter().map(|&cell| self.map.extent().index(cell).unwrap() as u32).collect();
        free.sort_unstable();
        self.observation.view = Some(Cells { free, wall: Vec::new() });
        self.observation.scan_tick = Some(self.observation.tick);
    }

    /// Requests a decision; its task is then under way, and the observation delta is empty.
    pub(crate) fn ask(&mut self, controller: &mut dyn Controller) -> Command {
        let observation = self.observation.clone();
        let command = self.ask_about(controller, &observation);
        self.observation.events = EventMask::empty();
        self.observation.seen = Cells::default();
        match &command.motion {
            Motion::Keep => {}
            Motion::Stop => self.ends(),
            motion => {
                let continues = self.held.is_some() && matches!(motion, Motion::Velocity { .. });
                if !continues {
                    self.ends();
                }
                self.observation.is_active = true;
                match motion {
                    Motion::Path(points) => self.waypoints = points.iter().copied().collect(),
                    &Motion::Turn { angle_rad } => self.turn_rad = Some(angle_rad),
                    &Motion::Velocity { linear_in_body_m_s, yaw_rate_rad_s, .. } => {
                        self.held = Some(HeldVelocity { linear_in_body_m_s, yaw_rate_rad_s });
                    }
                    _ => {}
                }
            }
        }
        self.wake = command.wake;
        self.wants_view = command.want_view;
        if !command.info.is_empty() {
            self.said.push(command.info.clone());
        }
        command
    }

    /// The context of a decision on the present observation.
    pub(crate) fn ctx(&mut self) -> Ctx<'_> {
        Ctx::new(AGENT, &self.run_info, &self.observation, &mut self.map, &mut self.navigation)
    }

    /// Requests a decision on any observation, and ignores it.
    pub(crate) fn ask_about(&mut self, controller: &mut dyn Controller, observation: &Observation) -> Command {
        self.decisions += 1;
        let Self { run_info, map, navigation, .. } = self;
        map.note_covered(map.extent().cell_of(&observation.pose.position));
        let command = controller.decide(observation, &mut Ctx::new(AGENT, run_info, observation, map, navigation));
        legal::assert_legal(&command);
        command
    }

    /// Runs for this many ticks, with decisions whenever the wake-up condition is met. Only paths,
    /// turns and velocities are supported.
    pub(crate) fn run(&mut self, controller: &mut dyn Controller, ticks: u64) {
        let end = self.observation.tick.after(ticks);
        while self.observation.tick < end {
            if self.wake.is_met(self.observation.tick, self.observation.events) {
                self.sense();
                let motion = self.ask(controller).motion;
                assert!(!matches!(motion, Motion::Move { .. }), "this world has no {motion:?}");
            }
            self.advance();
            self.wait(1);
        }
    }

    fn advance(&mut self) {
        if let Some(turn_rad) = self.turn_rad.take() {
            self.observation.pose.yaw_rad += turn_rad;
            self.observation.is_active = false;
            self.observation.events |= EventMask::TASK_DONE;
            return;
        }
        let here = self.observation.pose.position;
        let target = self.waypoints.front().copied();
        let next = match (&self.held, target) {
            (Some(held), _) => {
                let mut state = self.state();
                state.advance(self.run_info.bodies.of(AGENT), held);
                self.observation.pose.yaw_rad = state.yaw_rad;
                self.observation.velocity_in_map_m_s = turned(&state.velocity_in_body_m_s, state.yaw_rad);
                self.observation.yaw_rate_rad_s = state.yaw_rate_rad_s;
                state.position
            }
            (None, Some(target)) => {
                let offset = target - here;
                if offset.norm() <= STEP_M { target } else { here + offset.normalize() * STEP_M }
            }
            (None, None) => return,
        };
        let is_hit = |other: &Contact| {
            let (before, after) = ((other.position - here).norm(), (other.position - next).norm());
            after < NEAR_M && after < before
        };
        if self.observation.contacts.iter().any(is_hit) {
            self.collisions += 1;
            self.collide();
            self.observation.events |= EventMask::TASK_DONE;
            return;
        }
        self.observation.collision = None;
        self.observation.pose.position = next;
        if self.held.is_none() && (next.x, next.y) != (here.x, here.y) {
            self.observation.pose.yaw_rad = libm::atan2(next.y - here.y, next.x - here.x);
        }
        let cell = self.terrain.extent().cell_of(&next);
        assert_eq!(self.terrain.get(cell), Some(&Terrain::Free), "the agent ran into a wall");
        if self.been.last() != Some(&cell) {
            self.been.push(cell);
            self.observation.events |= EventMask::NEW_CELL;
        }
        if Some(next) == target {
            self.waypoints.pop_front();
            if self.waypoints.is_empty() {
                self.observation.is_active = false;
                self.observation.events |= EventMask::TASK_DONE;
            }
        }
    }

    /// The body in motion.
    fn state(&self) -> BodyState {
        let Observation { pose, velocity_in_map_m_s, yaw_rate_rad_s, .. } = &self.observation;
        let velocity_in_body_m_s = turned(velocity_in_map_m_s, -pose.yaw_rad);
        BodyState {
            velocity_in_body_m_s,
            yaw_rate_rad_s: *yaw_rate_rad_s,
            ..BodyState::at_rest(pose.position, pose.yaw_rad)
        }
    }

    fn ends(&mut self) {
        (self.held, self.turn_rad) = (None, None);
        self.observation.velocity_in_map_m_s = Vector3::zeros();
        self.observation.yaw_rate_rad_s = 0.0;
        self.waypoints.clear();
        self.observation.is_active = false;
    }

    /// Lets ticks pass in which nothing moves.
    pub(crate) fn wait(&mut self, ticks: u64) {
        self.observation.tick = self.observation.tick.after(ticks);
    }

    /// Completes a task; a path ends at its last waypoint.
    pub(crate) fn arrive(&mut self, motion: &Motion) {
        if let Motion::Path(waypoints) = motion {
            self.observation.pose.position = *waypoints.last().unwrap();
            self.observation.events |= EventMask::NEW_CELL;
        }
        self.observation.collision = None;
        self.observation.events |= EventMask::TASK_DONE;
        self.ends();
    }

    /// A collision with another agent.
    pub(crate) fn collide(&mut self) {
        self.observation.collision = Some(Collision { surface: Surface::Wall, with_agent: true });
        self.observation.events |= EventMask::COLLISION;
        self.ends();
    }

    /// Moves the body elsewhere.
    pub(crate) fn put(&mut self, cell: Cell) {
        self.observation.pose.position = self.map.extent().centre(cell);
        self.observation.events |= EventMask::NEW_CELL;
    }

    /// Free cells of the world that are in none of these states on the agent's map.
    pub(crate) fn left(&self, states: &[CellState]) -> Vec<Cell> {
        let free = self.terrain.iter().filter(|(_, terrain)| **terrain == Terrain::Free);
        free.map(|(cell, _)| cell).filter(|&cell| !states.contains(&self.map.state(cell))).collect()
    }
}

/// A team of equal bodies, with one agent more than the run has, since observations here may be
/// inconsistent.
fn team_of(body: BodyModel) -> Bodies {
    Bodies::new(vec![body], vec![0; 4]).unwrap()
}
