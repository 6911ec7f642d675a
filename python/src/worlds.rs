//! Worlds that are stepped by hand: each step takes an action for every agent, and advances a fixed
//! number of ticks.
//!
//! It is the world of a run (`world`) with the agents' own maps, sharing and navigation
//! (`agent_node`); what agents observe and command passes through the messages of the protocol, so
//! that it has the same checks and bounds. The decisions come from outside, all in the same tick.
//!
//! Invariants: a world is a function of scenario, seed and actions; an illegal action leaves it
//! unchanged. There is no lock-step, no digest and no recording here: a run has them.

use std::collections::BTreeMap;

use agent_node::command::{Command, Motion, WakeCondition};
use agent_node::exploration_map::{CellState, ExplorationMap};
use agent_node::navigation::{NavigationStatus, NavigationTask, SearchTime};
use agent_node::observation::{Observation, RunInfo};
use agent_node::path::Neighbours;
use agent_node::sharing::Sharing;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::Observation as Fragment;
use nalgebra::{Point3, Vector3};
use protocol::limits::{AGENT_MESSAGE_BYTES_MAX, LIST_BYTES_MAX, POINT_BYTES};
use protocol::message_type::MessageType;
use protocol::observation::RequestKind;
use protocol::observation::fragments::{self, FragmentReassembler};
use sim_server::setup;
use simulation::scenario::{Origins, Scenario, StopRule};
use simulation::wire;
use voxels::{Cell, Terrain};
use world::World;
use world::workers::Workers;

use crate::frontiers::NearFrontiers;

/// How agents act and what they are shown.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    pub(crate) ticks_per_step: u64,
    /// Cells from the centre of a crop to its side.
    pub(crate) crop_radius: u32,
    /// Number of frontiers shown.
    pub(crate) frontiers: usize,
    pub(crate) actions: Actions,
    /// Greatest distance of a waypoint along each axis, metres.
    pub(crate) waypoint_m: f64,
}

/// The kind of all actions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Actions {
    /// Velocity in the frame of the body and turn rate, as shares of the greatest.
    Velocity,
    /// A point relative to the body, as shares of [`Shape::waypoint_m`].
    Waypoint,
    /// The index of a frontier that was shown; their number: continue.
    Frontier,
}

impl Actions {
    /// Numbers in an action.
    pub(crate) fn width(self) -> usize {
        match self {
            Self::Velocity => 4,
            Self::Waypoint => 3,
            Self::Frontier => 1,
        }
    }
}

/// Numbers that describe the own state.
pub(crate) const OWN_WIDTH: usize = 12;

/// Numbers that describe another agent or a frontier: relative position in metres, and 1 if it is
/// there.
pub(crate) const PLACE_WIDTH: usize = 4;

/// How far a share may be beyond -1 and 1 and counts as these: a unit of half precision there.
const SHARE_TOLERANCE: f32 = 1.0 / 1024.0;

/// Where the observation of one agent is written.
pub(crate) struct View<'a> {
    pub(crate) crop: &'a mut [u8],
    pub(crate) own: &'a mut [f32],
    pub(crate) contacts: &'a mut [f32],
    pub(crate) frontiers: &'a mut [f32],
}

/// What one step did for one agent.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Gain {
    /// Share of the free cells that it has seen for the first time, whether others had or not.
    pub(crate) explored: f64,
    /// Path length, metres.
    pub(crate) distance_m: f64,
    pub(crate) collided: bool,
}

/// The belief of one agent.
struct Explorer {
    map: ExplorationMap,
    sharing: Sharing,
    navigation: NavigationTask,
    reassembler: FragmentReassembler,
    observation: Option<Observation>,
    /// The frontiers that were shown, nearest first.
    shown: Vec<Cell>,
    near: NearFrontiers,
}

/// A world with its agents.
pub(crate) struct Environment {
    scenario: Scenario,
    shape: Shape,
    run_info: RunInfo,
    world: World,
    explorers: Vec<Explorer>,
    /// The thread that steps this world: worlds are stepped in parallel, not their scans.
    alone: Workers,
}

/// What an environment has no part for, of the keys that a scenario has.
fn refusal(scenario: &Scenario) -> Option<String> {
    let agents = &scenario.agents;
    let rules = [
        (scenario.event.is_empty(), "event: expected none in an environment, whose worlds have no schedule"),
        (
            agents.reserve.is_empty(),
            "agents.reserve: expected [] in an environment, which has no service that lets agents join",
        ),
        (
            agents.base_stations.is_empty(),
            "agents.base_stations: expected [] in an environment: actions move each agent",
        ),
        (agents.mix.is_empty(), "agents.mix: expected none in an environment: actions take the place of controllers"),
        (!scenario.stop_when_back, "stop_when_back: expected false in an environment, where no controller goes back"),
    ];
    let broken = rules.into_iter().find(|(holds, _)| !holds).map(|(_, text)| text.to_owned());
    let of_ros =
        || agents.of_ros_only(false).map(|(key, value)| format!("{key} = {value}: expected [] in an environment"));
    broken.or_else(of_ros)
}

impl Environment {
    /// A world at tick 0, in which all agents have looked.
    ///
    /// # Errors
    /// If the world cannot be made, or needs what only a run has.
    pub(crate) fn new(scenario: &Scenario, seed: u64, shape: Shape) -> Result<Self, String> {
        let mut scenario = scenario.clone();
        scenario.seed = seed;
        if let Some(refusal) = refusal(&scenario) {
            return Err(refusal);
        }
        let resolved = setup::resolve(scenario, &Origins::new("the scenario", "", &[]));
        let scenario = resolved.map_err(|error| error.to_string())?;
        let (world, _report) = setup::build(&scenario).map_err(|error| error.to_string())?;
        let announced = wire::scenario(&scenario, &world.terrain().extent(), world.rays());
        // Controllers have no part in an environment.
        let run_info = RunInfo::from_message(&announced, AgentId(0)).map_err(|error| error.to_string())?;
        let explorers = world
            .agents()
            .map(|agent| Explorer {
                map: ExplorationMap::new(run_info.extent),
                sharing: Sharing::new(agent, run_info.share_period_ticks, run_info.agents),
                navigation: NavigationTask::new(run_info.bodies.of(agent), run_info.extent.cell_m()),
                reassembler: FragmentReassembler::default(),
                observation: None,
                shown: Vec::new(),
                near: NearFrontiers::default(),
            })
            .collect();
        let alone = Workers::new(1).map_err(|error| error.to_string())?;
        let mut environment = Self { scenario, shape, run_info, world, explorers, alone };
        environment.sense()?;
        Ok(environment)
    }

    /// An environment of this scenario and shape at tick 0 with a seed.
    ///
    /// # Errors
    /// See [`Self::new`].
    pub(crate) fn reset(&mut self, seed: u64) -> Result<(), String> {
        *self = Self::new(&self.scenario, seed, self.shape)?;
        Ok(())
    }

    pub(crate) fn world(&self) -> &World {
        &self.world
    }

    /// Whether all is explored, or covered, whichever the scenario stops for.
    pub(crate) fn is_done(&self) -> bool {
        match self.scenario.stop_rule() {
            StopRule::Explored => self.world.coverage().is_explored(),
            StopRule::Covered => self.world.coverage().is_covered(),
            // An environment has no base stations, and does not stop for bodies that are back.
            StopRule::Back | StopRule::KnownAtBase | StopRule::Duration => false,
        }
    }

    pub(crate) fn is_over_time(&self) -> bool {
        self.world.tick() >= self.scenario.duration_ticks()
    }

    /// Looks, and merges what every agent observes.
    fn sense(&mut self) -> Result<(), String> {
        self.world.sense(&self.alone);
        self.world.flush_scans();
        for agent in self.world.agents() {
            let observed = self.world.observe(agent, RequestKind::Scheduled);
            let explorer = &mut self.explorers[agent.index()];
            for part in fragments::split(observed, Fragment::RUNNING) {
                let reassembled = explorer.reassembler.take(part, &self.run_info).map_err(|error| error.to_string())?;
                if let Some(reassembled) = reassembled {
                    explorer.merge(reassembled.observation, &self.run_info);
                }
            }
            let known_free = u32::try_from(explorer.map.free()).unwrap_or(u32::MAX);
            self.world.note_belief(agent, known_free);
        }
        Ok(())
    }

    /// Checks the actions of all agents, which have the numbers of each agent in turn.
    ///
    /// # Errors
    /// Names the first agent and number that is not legal.
    pub(crate) fn check(&self, actions: &[f32]) -> Result<(), String> {
        let mut actions = self.world.agents().zip(actions.chunks_exact(self.shape.actions.width()));
        actions.try_for_each(|(agent, action)| self.check_one(agent, action))
    }

    /// Executes the actions of all agents, which [`Self::check`] accepted, and advances to the next
    /// decision.
    ///
    /// # Errors
    /// If an observation is not what an explorer accepts.
    pub(crate) fn step(&mut self, actions: &[f32]) -> Result<Vec<Gain>, String> {
        let width = self.shape.actions.width();
        let before = (self.world.coverage().explored_by(), self.world.distance_m());
        let mut commands = BTreeMap::new();
        for (agent, action) in self.world.agents().zip(actions.chunks_exact(width)) {
            commands.insert(agent, self.action(agent, action)?);
        }
        self.world.step(commands);
        for _ in 1..self.shape.ticks_per_step {
            if self.is_over_time() {
                break;
            }
            self.world.sense(&self.alone);
            self.world.flush_scans();
            self.world.step(BTreeMap::new());
        }
        self.sense()?;
        let (explored, distance_m) = (self.world.coverage().explored_by(), self.world.distance_m());
        let gain = |agent: AgentId| {
            let index = agent.index();
            Gain {
                explored: explored[index] - before.0[index],
                distance_m: distance_m[index] - before.1[index],
                collided: self.explorers[index].observation.as_ref().is_some_and(|seen| seen.collision.is_some()),
            }
        };
        Ok(self.world.agents().map(gain).collect())
    }

    fn check_one(&self, agent: AgentId, action: &[f32]) -> Result<(), String> {
        let wrong = |number: usize, expected: &str| {
            Err(format!("action of agent {agent}: number {number} is {}: expected {expected}", action[number]))
        };
        for (number, &value) in action.iter().enumerate() {
            match self.shape.actions {
                Actions::Velocity | Actions::Waypoint if value.is_nan() || value.abs() > 1.0 + SHARE_TOLERANCE => {
                    return wrong(number, "-1 to 1");
                }
                Actions::Frontier
                    if !(value >= 0.0 && value <= self.shape.frontiers as f32 && value.fract() == 0.0) =>
                {
                    return wrong(number, &format!("a whole number from 0 to {}", self.shape.frontiers));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// A checked action in the world.
    fn action(&mut self, agent: AgentId, action: &[f32]) -> Result<Command, String> {
        let body = self.run_info.bodies.of(agent);
        let tick = self.world.tick();
        let Explorer { map, sharing, navigation, observation, shown, .. } = &mut self.explorers[agent.index()];
        let Some(observation) = observation else { return Ok(Command::LOST) };
        let position = observation.pose.position;
        let mut go_to = |goal| go_to(map, navigation, position, goal, tick);
        let share = |number: usize| f64::from(action[number].clamp(-1.0, 1.0));
        let motion = match self.shape.actions {
            Actions::Velocity => Motion::Velocity {
                linear_in_body_m_s: Vector3::new(share(0), share(1), share(2)) * body.speed_max_m_s,
                yaw_rate_rad_s: share(3) * body.turn_rate_max_rad_s,
                path: Vec::new(),
            },
            Actions::Waypoint => {
                let offset = Vector3::new(share(0), share(1), share(2)) * self.shape.waypoint_m;
                let goal = self.run_info.extent.cell_of(&(position + offset));
                go_to(goal)
            }
            Actions::Frontier => {
                // Whole and in range, see `check_one`.
                let chosen = shown.get(action[0] as usize).copied();
                chosen.map_or(Motion::Keep, go_to)
            }
        };
        let mut command = Command::new(motion, WakeCondition::NEXT_TICK);
        let waypoints = if let Motion::Path(waypoints) = &command.motion { waypoints.len() } else { 0 };
        let budget = AGENT_MESSAGE_BYTES_MAX.min(LIST_BYTES_MAX.saturating_sub(POINT_BYTES * waypoints));
        command.messages = sharing.outgoing(map, &observation.contacts, tick, budget);
        Command::from_message(&command.into_message(agent, tick), self.run_info.agents)
    }

    /// Writes what an agent is shown. `self` keeps which frontiers that were.
    pub(crate) fn show(&mut self, agent: AgentId, view: View<'_>) {
        let body = self.run_info.bodies.of(agent);
        let extent = self.run_info.extent;
        let explorer = &mut self.explorers[agent.index()];
        let Some(observation) = &explorer.observation else { return };
        let position = observation.pose.position;
        let centre = extent.cell_of(&position);
        let radius = self.shape.crop_radius.cast_signed();
        let mut crop = view.crop.iter_mut();
        for x in -radius..=radius {
            for y in -radius..=radius {
                for (z, out) in (-radius..=radius).zip(&mut crop) {
                    let cell = Cell { x: centre.x + x, y: centre.y + y, z: centre.z + z };
                    *out = explorer.map.state(cell) as u8;
                }
            }
        }
        let size_m = extent.size().map(|cells| f64::from(cells) * extent.cell_m());
        let velocity = observation.velocity_in_map_m_s / body.speed_max_m_s;
        let known = explorer.map.free() + explorer.map.wall();
        let own = [
            position.x / size_m[0],
            position.y / size_m[1],
            position.z / size_m[2],
            velocity.x,
            velocity.y,
            velocity.z,
            libm::cos(observation.pose.yaw_rad),
            libm::sin(observation.pose.yaw_rad),
            observation.yaw_rate_rad_s / body.turn_rate_max_rad_s,
            f64::from(u8::from(observation.is_active)),
            f64::from(u8::from(observation.collision.is_some())),
            known as f64 / extent.volume() as f64,
        ];
        view.own.iter_mut().zip(own).for_each(|(out, value)| *out = value.clamp(-1.0, 1.0) as f32);
        view.contacts.fill(0.0);
        let contacts = observation.contacts.iter().map(|contact| contact.position);
        write_places(view.contacts, &position, contacts);
        explorer.shown = explorer.near.nearest(&explorer.map, &position, self.shape.frontiers);
        view.frontiers.fill(0.0);
        write_places(view.frontiers, &position, explorer.shown.iter().map(|&cell| extent.centre(cell)));
    }

    /// The state of all for a central critic: for each agent its position in metres and its
    /// heading.
    pub(crate) fn poses(&self, out: &mut [f32]) {
        for (agent, out) in self.world.agents().zip(out.chunks_exact_mut(4)) {
            let pose = self.world.body(agent).pose();
            let values = [pose.position.x, pose.position.y, pose.position.z, pose.yaw_rad];
            out.iter_mut().zip(values).for_each(|(out, value)| *out = value as f32);
        }
    }

    /// The states of all cells as the team knows them, by index: 1 for cells that some agent has
    /// seen to be free.
    pub(crate) fn team_map(&self) -> Vec<u8> {
        let mut known = vec![CellState::Unexplored as u8; self.run_info.extent.volume()];
        for cell in self.world.coverage().explored_cells().ones() {
            known[cell] = CellState::Free as u8;
        }
        known
    }

    /// The `CellState`s of a layer of cells, x fastest: the walls of the true map, free cells that
    /// some agent has seen, and unexplored ones. Empty outside the map.
    pub(crate) fn layer(&self, z: u32) -> Vec<u8> {
        let [x, y, layers] = self.run_info.extent.size();
        if z >= layers {
            return Vec::new();
        }
        let area = x as usize * y as usize;
        let first = z as usize * area;
        let explored = self.world.coverage().explored_cells();
        let state = |(place, terrain): (usize, &Terrain)| match terrain {
            Terrain::Wall => CellState::Wall as u8,
            Terrain::Free if explored.contains(first + place) => CellState::Free as u8,
            Terrain::Free => CellState::Unexplored as u8,
        };
        self.world.terrain().as_slice()[first..first + area].iter().enumerate().map(state).collect()
    }
}

impl Explorer {
    /// As `agent_node::control_loop` does.
    fn merge(&mut self, mut observation: Observation, run_info: &RunInfo) {
        self.map.note_free(&observation.seen.free);
        self.map.note_wall(&observation.seen.wall);
        self.map.note_covered(run_info.extent.cell_of(&observation.pose.position));
        self.sharing.set_frames(&observation.map_frames);
        self.sharing.incoming(&mut self.map, &observation.messages);
        observation.messages.retain(|message| !message.is_from_agent(MessageType::Map));
        self.observation = Some(observation);
    }
}

/// The motion to a cell; stops if no path is known.
fn go_to(map: &ExplorationMap, navigation: &mut NavigationTask, from: Point3<f64>, goal: Cell, tick: Tick) -> Motion {
    match navigation.to_cell(map, &from, goal, Neighbours::TwentySix, SearchTime::Instant, tick) {
        NavigationStatus::Go(motion) => motion,
        NavigationStatus::Searching(_) | NavigationStatus::NoPath => Motion::Stop,
    }
}

fn write_places(out: &mut [f32], from: &Point3<f64>, places: impl Iterator<Item = Point3<f64>>) {
    for (out, place) in out.chunks_exact_mut(PLACE_WIDTH).zip(places) {
        let offset = place - from;
        let values = [offset.x as f32, offset.y as f32, offset.z as f32, 1.0];
        out.copy_from_slice(&values);
    }
}
