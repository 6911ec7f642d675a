//! For tests of controllers: a small world drawn as text, in which one agent moves along its way-points and sees all that is in
//! line of sight. The body here is a point that moves half a metre in a tick and turns at once; the real one is the server's.

use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, TAU};

use msgs::ids::{AgentId, Tick};
use msgs::limits::{INFO_BYTES_MAX, PARCEL_BYTES_MAX, PATH_POINTS_MAX};
use msgs::maes_msgs::Wake as Events;
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use voxels::{Cell, Extent, Grid, Terrain, line_of_sight};

use super::{Controller, Ctx};
use crate::command::{Command, LidarRequest, Motion, Wake};
use crate::exploration_map::{CellState, ExplorationMap};
use crate::observation::{Briefing, Cells, Collision, Contact, Observation, Pose, Received, Surface};
use crate::travel::Travel;

/// How far the body gets in a tick.
const STEP_M: f64 = 0.5;

/// Two bodies that come nearer than this collide.
const NEAR_M: f64 = 0.8;

/// A briefing for tests.
pub(crate) fn briefing(extent: Extent) -> Briefing {
    Briefing {
        duration: Tick(90_000),
        extent,
        agents: 3,
        agents_seed: 1,
        controller: "lvd".to_owned(),
        settings: Vec::new(),
        body_radius_m: 0.4,
        lidar_range_m: f64::INFINITY,
        lidar_period_ticks: 10,
        communication_range_m: f64::INFINITY,
        share_period_ticks: 251,
    }
}

/// A world with one agent, id 1.
pub(crate) struct TestWorld {
    terrain: Grid<Terrain>,
    briefing: Briefing,
    travel: Travel,
    pub(crate) map: ExplorationMap,
    pub(crate) tick: Tick,
    pub(crate) position: Point3<f64>,
    way: VecDeque<Point3<f64>>,
    events: u8,
    collision: Option<Collision>,
    wake: Wake,
    wants_view: bool,
    /// Others that are heard, and stand in the way.
    pub(crate) contacts: Vec<Contact>,
    /// What the agent has said.
    pub(crate) said: Vec<String>,
    pub(crate) decisions: u32,
    pub(crate) collisions: u32,
    /// Cells that the body has been in, in order.
    pub(crate) been: Vec<Cell>,
}

impl TestWorld {
    /// The agent at rest in a cell of a drawing, see [`Grid::from_text`].
    pub(crate) fn new(drawing: &str, start: Cell) -> Self {
        let terrain = Grid::from_text(drawing).unwrap();
        let extent = terrain.extent();
        assert_eq!(terrain.get(start), Some(&Terrain::Free));
        Self {
            terrain,
            briefing: briefing(extent),
            travel: Travel::new(0.4, 1.0),
            map: ExplorationMap::new(extent),
            tick: Tick::ZERO,
            position: extent.centre(start),
            way: VecDeque::new(),
            events: 0,
            collision: None,
            wake: Wake::NEXT_TICK,
            wants_view: false,
            contacts: Vec::new(),
            said: Vec::new(),
            decisions: 0,
            collisions: 0,
            been: vec![start],
        }
    }

    /// Runs so many ticks, asking the controller when it wants to be asked. Every command must be legal.
    pub(crate) fn run(&mut self, controller: &mut dyn Controller, ticks: u64) {
        let end = self.tick.after(ticks);
        while self.tick < end {
            if self.wake.is_due(self.tick, self.events) {
                let _ = self.ask(controller);
            }
            self.advance();
            self.tick = self.tick.next();
        }
    }

    /// Asks the controller now, and carries out what it says.
    pub(crate) fn ask(&mut self, controller: &mut dyn Controller) -> Command {
        let observation = self.observe();
        self.ask_about(controller, &observation)
    }

    /// Asks the controller about an observation, and carries out what it says.
    pub(crate) fn ask_about(&mut self, controller: &mut dyn Controller, observation: &Observation) -> Command {
        self.decisions += 1;
        let Self { briefing, map, travel, .. } = self;
        let command = controller.decide(observation, &mut Ctx::new(AgentId(1), briefing, observation, map, travel));
        assert_legal(&command);
        match &command.motion {
            Motion::Keep => {}
            Motion::Stop => self.way.clear(),
            Motion::Path(points) => self.way = points.iter().copied().collect(),
            other => panic!("this world has no {other:?}"),
        }
        self.wake = command.wake;
        self.wants_view = command.want_view;
        if !command.info.is_empty() {
            self.said.push(command.info.clone());
        }
        command
    }

    /// What the agent learns now; it is on its map afterwards.
    pub(crate) fn observe(&mut self) -> Observation {
        let view = self.view();
        let is_new =
            |&cell: &u32| self.map.state(self.terrain.extent().cell_at(cell as usize)) == CellState::Unexplored;
        let of_new = |cells: &[u32]| cells.iter().copied().filter(is_new).collect();
        let seen = Cells { free: of_new(&view.free), wall: of_new(&view.wall) };
        self.map.note_free(&seen.free);
        self.map.note_wall(&seen.wall);
        self.map.note_covered(self.terrain.extent().cell_of(&self.position));
        Observation {
            tick: self.tick,
            pose: Pose { position: self.position, yaw_rad: 0.0 },
            velocity_m_s: Vector3::zeros(),
            yaw_rate_rad_s: 0.0,
            is_active: !self.way.is_empty(),
            collision: self.collision,
            events: std::mem::take(&mut self.events),
            contacts: self.contacts.clone(),
            parcels: Vec::new(),
            scan_tick: Some(self.tick),
            seen,
            view: self.wants_view.then_some(view),
        }
    }

    /// All free cells in line of sight, and the walls beside them.
    pub(crate) fn view(&self) -> Cells {
        let extent = self.terrain.extent();
        let mut view = Cells::default();
        let is_seen = |cell: Cell| {
            self.terrain.get(cell) == Some(&Terrain::Free)
                && line_of_sight(&self.terrain, &self.position, &extent.centre(cell))
        };
        for (index, cell) in (0..).zip(extent.cells()) {
            if is_seen(cell) {
                view.free.push(index);
            } else if self.terrain.get(cell) == Some(&Terrain::Wall) && cell.neighbours6().into_iter().any(is_seen) {
                view.wall.push(index);
            }
        }
        view
    }

    fn advance(&mut self) {
        let Some(&target) = self.way.front() else { return };
        let way = target - self.position;
        let next = if way.norm() <= STEP_M { target } else { self.position + way.normalize() * STEP_M };
        let is_hit = |other: &Contact| {
            let (before, after) = ((other.position - self.position).norm(), (other.position - next).norm());
            after < NEAR_M && after < before
        };
        if self.contacts.iter().any(is_hit) {
            self.collisions += 1;
            self.collision = Some(Collision { surface: Surface::Wall, with_agent: true });
            self.events |= Events::COLLISION | Events::TASK_DONE;
            self.way.clear();
            return;
        }
        self.collision = None;
        self.position = next;
        let cell = self.terrain.extent().cell_of(&next);
        assert_eq!(self.terrain.get(cell), Some(&Terrain::Free), "the agent ran into a wall");
        if self.been.last() != Some(&cell) {
            self.been.push(cell);
            self.events |= Events::NEW_CELL;
        }
        if next == target {
            self.way.pop_front();
            if self.way.is_empty() {
                self.events |= Events::TASK_DONE;
            }
        }
    }

    /// Free cells of the world that are not in one of these states on the agent's map.
    pub(crate) fn left(&self, states: &[CellState]) -> Vec<Cell> {
        let free = self.terrain.iter().filter(|(_, terrain)| **terrain == Terrain::Free);
        free.map(|(cell, _)| cell).filter(|&cell| !states.contains(&self.map.state(cell))).collect()
    }
}

/// What msgs/msg/Task.msg, LidarRequest.msg and the limits allow.
pub(crate) fn assert_legal(command: &Command) {
    match &command.motion {
        Motion::Keep | Motion::Stop => {}
        Motion::Move { pitch_rad, distance_m } => {
            assert!(pitch_rad.abs() <= FRAC_PI_2 && *distance_m >= 0.0, "{command:?}");
        }
        Motion::Turn { angle_rad } => assert!(angle_rad.abs() <= TAU, "{command:?}"),
        Motion::Path(points) => {
            assert!((1..=PATH_POINTS_MAX).contains(&points.len()), "{command:?}");
            assert!(points.iter().all(|point| point.iter().all(|along| along.is_finite())), "{command:?}");
        }
        Motion::Velocity { linear_in_body_m_s, yaw_rate_rad_s } => {
            assert!(linear_in_body_m_s.iter().all(|along| along.is_finite()) && yaw_rate_rad_s.is_finite());
        }
    }
    assert_ne!(command.lidar, LidarRequest::Every(0));
    assert!(command.info.len() <= INFO_BYTES_MAX);
    assert!(command.parcels.iter().map(|parcel| parcel.data.len()).sum::<usize>() <= PARCEL_BYTES_MAX);
}

/// Any observation, of a world of 6 x 5 x 4 cells: what is said need not be true, nor be possible.
pub(crate) fn any_observation() -> impl Strategy<Value = Observation> {
    let coordinate = || prop_oneof![8 => 0.0..6.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => -1e300..1e300];
    let point = move || (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| Point3::new(x, y, z));
    let cells = || {
        let some = || prop::collection::btree_set(0u32..120, 0..60).prop_map(|cells| cells.into_iter().collect());
        (some(), some()).prop_map(|(free, wall)| Cells { free, wall })
    };
    let surface = prop_oneof![Just(Surface::Wall), Just(Surface::Floor), Just(Surface::Ceiling)];
    let collision = (surface, any::<bool>()).prop_map(|(surface, with_agent)| Collision { surface, with_agent });
    let contact = (0u32..4, point()).prop_map(|(agent, position)| Contact { agent: AgentId(agent), position });
    let parcel = (0u32..4, any::<u8>(), prop::collection::vec(any::<u8>(), 0..20))
        .prop_map(|(from, kind, data)| Received { from: AgentId(from), kind, data });
    let body = (point(), -3.2..3.2, any::<bool>(), prop::option::of(collision), 0u8..32);
    let heard = (prop::collection::vec(contact, 0..3), prop::collection::vec(parcel, 0..3));
    (body, heard, 0u64..400, cells(), prop::option::of(cells())).prop_map(|(body, heard, tick, seen, view)| {
        let (position, yaw_rad, is_active, collision, events) = body;
        Observation {
            tick: Tick(tick),
            pose: Pose { position, yaw_rad },
            velocity_m_s: Vector3::zeros(),
            yaw_rate_rad_s: 0.0,
            is_active,
            collision,
            events,
            contacts: heard.0,
            parcels: heard.1,
            scan_tick: Some(Tick(tick)),
            seen,
            view,
        }
    })
}

/// Asks a controller about any observations, one after the other; what it answers must be legal.
pub(crate) fn assert_always_legal(controller: &mut dyn Controller, observations: &[Observation]) {
    let extent = Extent::new([6, 5, 4], 1.0).unwrap();
    let briefing = briefing(extent);
    let mut map = ExplorationMap::new(extent);
    let mut travel = Travel::new(0.4, 1.0);
    for observation in observations {
        map.note_free(&observation.seen.free);
        map.note_wall(&observation.seen.wall);
        let mut ctx = Ctx::new(AgentId(1), &briefing, observation, &mut map, &mut travel);
        assert_legal(&controller.decide(observation, &mut ctx));
    }
}
