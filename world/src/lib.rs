//! The true world and its fixed update: look, (compute, outside), communicate, move.
//!
//! A tick consists of three calls: [`World::sense`] casts the scans that are due; the caller sends
//! observations ([`World::observe`]) to the agents that are due and collects their commands;
//! [`World::step`] delivers messages, moves the bodies in the order of their ids, and ends the
//! tick. A body collides with the others at their present positions: lower ids have moved already,
//! higher ids not yet, so two bodies never overlap.
//!
//! Invariants: no body leaves free space or overlaps another or a moving obstacle, ground bodies
//! stand on a floor; results depend on the arguments alone. Helpers cast scans, each of which
//! writes to the memory of its own agent.
//!
//! Invariants of the crate: no ROS, no file, no network, no wall clock and no environment. It does
//! not decide which agent is due: see [`protocol::lockstep`].

#![warn(missing_docs)]

pub mod attainable;
pub mod body;
pub mod collision;
pub mod comms;
pub mod coverage;
pub mod energy;
pub mod lidar;
pub mod localisation;
pub mod map_change;
pub mod moving_obstacles;
pub mod noise;
mod observe;
mod params;
mod pending_observation;
mod presence;
mod radio_medium;
pub mod relays;
mod sensing;
pub mod spawn;
mod totals;
pub mod workers;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;
use protocol::body_model::BodyModel;
use protocol::command::Command;
use protocol::event_mask::EventMask;
use protocol::relay_id::RelayId;
use protocol::scan_request::ScanRequest;
use voxels::{Cell, Grid, OpenSpace, Terrain};

use crate::workers::Workers;

use attainable::Attainable;
use body::{Body, Motion, Pose};
use collision::{Obstacles, Sphere};
use comms::ContactTable;
use coverage::Coverage;
use energy::Batteries;
use lidar::{Bodies, CastCount, NotCast, SensorMemory, SensorSuite};
use localisation::Localisation;
use moving_obstacles::MovingObstacles;
use noise::Drift;
pub use params::{ScanSchedule, WorldParams};
use pending_observation::PendingObservation;
pub use presence::Presence;
use radio_medium::{RadioMedium, ReportedContacts};
pub use sensing::ExploredShares;
use sensing::{Lidar, Sensor};
pub use totals::Totals;

/// The true world at the start of a tick.
#[derive(Debug)]
pub struct World {
    tick: Tick,
    terrain: Grid<Terrain>,
    params: WorldParams,
    agents: Vec<AgentState>,
    spheres: Vec<Sphere>,
    moving_obstacles: MovingObstacles,
    /// `None` when more than positions may have changed.
    contacts: Option<ContactTable>,
    /// That of the terrain, once contacts have been asked for.
    open_space: Option<OpenSpace>,
    /// Whether the contacts are those of the present positions.
    has_present_contacts: bool,
    radio: RadioMedium,
    coverage: Coverage,
    /// Agents with scans that the coverage does not count yet.
    pending_scans: Vec<usize>,
    /// Agents that got a task in the last step.
    with_task: Vec<usize>,
    /// See [`World::defer_scans`].
    is_deferring: bool,
    totals: Totals,
    /// `None`: bodies need no energy.
    batteries: Option<Batteries>,
    /// `None`: agents know where they are.
    localisation: Option<Localisation>,
    /// Where the bodies started, or were put since, by agent.
    starts: Vec<Point3<f64>>,
    /// See [`World::attainable`].
    attainable: OnceLock<Option<Attainable>>,
    /// The tick of the last change of the map, before its scans.
    map_changed_at: Option<Tick>,
    /// See [`World::map_revision`].
    map_revision: u32,
}

/// The state of one agent in the world.
#[derive(Debug)]
struct AgentState {
    presence: Presence,
    has_radio: bool,
    body: Body,
    cell: Cell,
    distance_m: f64,
    sensor: Sensor,
    /// Whether its scans may have found what its pending observation does not have yet.
    has_results: bool,
    /// Whether it has scans that the coverage does not count yet.
    is_uncounted: bool,
    /// Cells (by index) that have changed since its sensor reported them.
    outdated: BTreeSet<u32>,
    next_scan: Option<Tick>,
    scan_period_ticks: Option<u32>,
    /// Pose and tick of the last scan.
    last_scan: Option<(Pose, Tick)>,
    /// The bodies that its rays could meet.
    last_bodies: Bodies,
    want_view: bool,
    pending_observation: PendingObservation,
    drift: Drift,
    reported_contacts: ReportedContacts,
    reported_relays: Vec<(RelayId, Point3<f64>)>,
}

impl AgentState {
    /// The sphere of its body; without a radius while it is not in the world.
    fn sphere(&self) -> Sphere {
        let sphere = self.body.sphere();
        if self.presence.is_in_world() { sphere } else { Sphere { radius_m: 0.0, ..sphere } }
    }
}

impl World {
    /// A world at tick 0 with a body at rest at each of `starts`, by agent; see [`spawn`] for
    /// starts that are free of walls and of each other.
    #[must_use]
    pub fn new(terrain: Grid<Terrain>, params: WorldParams, starts: &[Pose]) -> Self {
        let memory = SensorMemory::new(&terrain);
        let lidars = lidars(&params, starts.len());
        let extent = terrain.extent();
        // All others see the cells that their bodies are in.
        let memory_of = |lidar: &Lidar, body: &BodyModel| {
            memory.unused().of_body(if lidar.sensors.field_of_view().is_none() { 0.0 } else { body.radius_m })
        };
        let free_cells = terrain.as_slice().iter().filter(|&&cell| cell == Terrain::Free).count();
        let period_ticks = match params.schedule {
            ScanSchedule::OnRequest { period_ticks } => Some(period_ticks),
            ScanSchedule::TakeTurns => None,
        };
        let agents: Vec<AgentState> = ids()
            .zip(starts)
            .map(|(agent, &pose)| (agent, pose, *params.other_bodies.get(&agent).unwrap_or(&params.body)))
            .map(|(agent, pose, body)| AgentState {
                presence: if params.late.contains(&agent) { Presence::Absent } else { Presence::Active },
                has_radio: true,
                body: Body::at_rest(body, pose),
                cell: extent.cell_of(&pose.position),
                distance_m: 0.0,
                sensor: Sensor::new(agent, &lidars[agent.index()], memory_of(&lidars[agent.index()], &body)),
                has_results: false,
                is_uncounted: false,
                outdated: BTreeSet::new(),
                next_scan: period_ticks.filter(|_| !params.late.contains(&agent)).map(|_| Tick::ZERO),
                scan_period_ticks: period_ticks,
                last_scan: None,
                last_bodies: Bodies::default(),
                want_view: false,
                pending_observation: PendingObservation::default(),
                drift: Drift::new(&params.noise, agent),
                reported_contacts: ReportedContacts::new(starts.len()),
                reported_relays: Vec::new(),
            })
            .collect();
        let mut coverage =
            Coverage::new(extent.volume(), free_cells, agents.len()).with_base_stations(params.base_stations.clone());
        for (agent, state) in ids().zip(&agents).filter(|(_, state)| state.presence.is_in_world()) {
            coverage.cover(agent, index_of(&terrain, state.cell));
        }
        let spheres = agents.iter().map(AgentState::sphere).collect();
        let bodies = agents.iter().map(|state| (state.body.model(), *state.body.pose()));
        let batteries = params.energy.as_ref().map(|energy| Batteries::full(energy, bodies));
        let localisation = Localisation::new(&params.odometry, extent, starts);
        let moving_obstacles = MovingObstacles::new(&params.obstacles);
        Self {
            tick: Tick::ZERO,
            terrain,
            params,
            radio: RadioMedium::new(agents.len()),
            agents,
            spheres,
            moving_obstacles,
            contacts: None,
            open_space: None,
            has_present_contacts: false,
            coverage,
            pending_scans: Vec::new(),
            with_task: Vec::new(),
            is_deferring: false,
            totals: Totals::default(),
            batteries,
            localisation,
            starts: starts.iter().map(|pose| pose.position).collect(),
            attainable: OnceLock::new(),
            map_changed_at: None,
            map_revision: 0,
        }
    }

    /// The current tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// The true map.
    #[must_use]
    pub fn terrain(&self) -> &Grid<Terrain> {
        &self.terrain
    }

    /// Explored and covered cells so far.
    ///
    /// # Panics
    /// If the world is not settled: see [`World::flush_scans`].
    #[must_use]
    pub fn coverage(&self) -> &Coverage {
        assert!(self.has_no_pending_scans(), "the coverage is read while scans are not counted");
        &self.coverage
    }

    /// What the team can reach and see from where its bodies have started or were put; `None`:
    /// everything, or it is not known ([`attainable::of_team`]). Computed once it is asked for.
    #[must_use]
    pub fn attainable(&self) -> Option<&Attainable> {
        self.attainable.get_or_init(|| attainable::of_team(self)).as_ref()
    }

    /// Share of the free cells that are attainable or have been seen all the same, from between the
    /// places of the bodies, 0 ..= 1; `None` as for [`World::attainable`].
    ///
    /// # Panics
    /// If the world is not settled: see [`World::flush_scans`].
    #[must_use]
    pub fn attainable_share(&self) -> Option<f64> {
        let coverage = self.coverage();
        let (explored, free_cells) = (coverage.explored_cells(), coverage.free_cells());
        self.attainable().map(|attainable| {
            let unseen = attainable.seen().iter().filter(|&cell| !explored.contains(cell)).count();
            (coverage.explored_count() + unseen) as f64 / free_cells as f64
        })
    }

    /// Whether the team can see a free cell that it has not seen, or may be able to.
    ///
    /// # Panics
    /// If the world is not settled: see [`World::flush_scans`].
    #[must_use]
    pub fn is_anything_left(&self) -> bool {
        let explored = self.coverage().explored_cells();
        self.attainable().is_none_or(|attainable| attainable.seen().iter().any(|cell| !explored.contains(cell)))
    }

    /// Share of the free cells that at least one agent has visited, 0 ..= 1.
    #[must_use]
    pub fn covered(&self) -> f64 {
        self.coverage.covered()
    }

    /// Running totals of scans, collisions and messages.
    #[must_use]
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// All agents, ascending.
    pub fn agents(&self) -> impl Iterator<Item = AgentId> + use<> {
        ids().take(self.agents.len())
    }

    /// The body of an agent.
    #[must_use]
    pub fn body(&self, agent: AgentId) -> &Body {
        &self.agents[agent.index()].body
    }

    /// Moves a body to a pose, at rest, and ends its task with [`EventMask::TASK_DONE`]. A ground
    /// body is put on the floor below.
    ///
    /// # Errors
    /// The obstacle, if the body does not fit there; the world is unchanged then.
    pub fn place(&mut self, agent: AgentId, pose: Pose) -> Result<(), &'static str> {
        let model = *self.body(agent).model();
        let pose = Pose { position: self.room(agent, &pose.position)?, ..pose };
        let state = &mut self.agents[agent.index()];
        state.body = Body::at_rest(model, pose);
        state.pending_observation.events |= EventMask::TASK_DONE;
        self.contacts = None;
        self.localise_anew(agent);
        self.put(agent);
        self.update_position(agent.index());
        Ok(())
    }

    /// Notes that a body is where it has not come by itself.
    fn put(&mut self, agent: AgentId) {
        self.starts[agent.index()] = self.body(agent).pose().position;
        self.attainable = OnceLock::new();
    }

    /// Records how many free cells an agent reports to be on its map.
    pub fn note_belief(&mut self, agent: AgentId, known_free: u32) {
        self.coverage.believe(agent, known_free, self.tick);
    }

    /// Number of pairs of agents in contact in this tick.
    pub fn pairs_in_contact(&mut self) -> u32 {
        let higher =
            |agent, others: Vec<AgentId>| others.iter().filter(|&&other| other > agent).map(|_| 1).sum::<u32>();
        self.agents().map(|agent| higher(agent, self.contacts_of(agent))).sum()
    }

    /// Distance travelled so far, metres, by agent.
    #[must_use]
    pub fn distance_m(&self) -> Vec<f64> {
        self.agents.iter().map(|state| state.distance_m).collect()
    }

    /// The agents in contact with `agent` in this tick, ascending.
    pub fn in_contact_with(&mut self, agent: AgentId) -> Vec<AgentId> {
        self.contacts_of(agent)
    }

    /// Pose and tick of the last scan of an agent, `None` before its first.
    #[must_use]
    pub fn last_scan(&self, agent: AgentId) -> Option<(Pose, Tick)> {
        self.agents[agent.index()].last_scan
    }

    /// The LiDARs of an agent.
    #[must_use]
    pub fn sensors(&self, agent: AgentId) -> &SensorSuite {
        &self.agents[agent.index()].sensor.lidar().sensors
    }

    /// Number of rays of one scan, of the agent with most.
    #[must_use]
    pub fn rays(&self) -> u32 {
        self.agents().map(|agent| self.sensors(agent).rays()).max().unwrap_or_default()
    }

    /// Phase look: casts the scans that are due in this tick, or has helpers cast them; see
    /// [`World::flush_scans`].
    pub fn sense(&mut self, workers: &Workers) {
        let tick = self.tick;
        let team = self.agents.len() as u64;
        if self.params.schedule == ScanSchedule::TakeTurns {
            let turn = &mut self.agents[(tick.0 % team) as usize];
            turn.next_scan = (turn.presence == Presence::Active).then_some(tick);
        }
        for index in 0..self.agents.len() {
            let state = &mut self.agents[index];
            if state.next_scan != Some(tick) {
                continue;
            }
            state.next_scan = state.scan_period_ticks.map(|period| tick.after(period.into()));
            let pose = *state.body.pose();
            let since = self.map_changed_at.unwrap_or(Tick::ZERO).max(self.block_since(index));
            let state = &mut self.agents[index];
            let lidar = state.sensor.lidar();
            if lidar.sensors.meets_bodies() {
                let others = if lidar.sensors.sees_agents() { &self.spheres[..] } else { &[] };
                state.last_bodies = Bodies::others(others, index, self.moving_obstacles.solids());
            }
            let last = state.last_scan.filter(|scan| scan.1 >= since).map(|(last, _)| last);
            let same = |a: &Pose, b: &Pose| lidar.sensors.sees_the_same(a, b);
            let not_cast = NotCast::of_scan(same, lidar.scans_differ(), last.as_ref(), &pose);
            state.last_scan = Some((pose, tick));
            self.note_scan(index);
            match not_cast {
                Some(reason) => self.totals.scans.add(&CastCount::without(1, reason)),
                None => {
                    self.totals.scans.add(&CastCount::of(1));
                    self.request_scan(index, workers);
                }
            }
        }
        if !workers.has_helpers() && !self.has_no_pending_scans() {
            self.flush_scans();
        }
    }

    /// The events of an agent since its last committed observation, restricted to `asked` and to
    /// [`EventMask::REVISED`]. Contacts are computed only if `asked` names [`EventMask::CONTACTS`]
    /// or [`EventMask::FIRST_CONTACT`].
    pub fn events(&mut self, agent: AgentId, asked: EventMask) -> EventMask {
        if !self.agents[agent.index()].outdated.is_empty() {
            self.collect_scans(agent.index());
        }
        if asked.intersects(EventMask::FIRST_CONTACT) && self.has_first_contact(agent) {
            self.agents[agent.index()].pending_observation.events |= EventMask::FIRST_CONTACT;
        }
        let mut events = self.agents[agent.index()].pending_observation.events;
        if asked.intersects(EventMask::CONTACTS) {
            events |= self.change_of_contacts(agent);
        }
        events & (asked | EventMask::REVISED)
    }

    /// Phases communicate and move, and the end of the tick. Agents without a command continue
    /// their tasks.
    pub fn step(&mut self, commands: BTreeMap<AgentId, Command>) {
        self.communicate(&commands);
        self.with_task.clear();
        for (agent, command) in commands {
            let next_tick = self.tick.after(1);
            let is_refused = self.refuses(agent, &command.motion);
            let motion = self.in_world(agent, command.motion);
            let state = &mut self.agents[agent.index()];
            state.want_view = command.want_view;
            if motion != Motion::Keep && !is_refused {
                self.with_task.push(agent.index());
                state.body.set_task(motion);
            }
            match (command.lidar, self.params.schedule) {
                (ScanRequest::Keep, _) | (_, ScanSchedule::TakeTurns) => {}
                (ScanRequest::Never, _) => {
                    state.scan_period_ticks = None;
                    state.next_scan = None;
                }
                (ScanRequest::Once, _) => {
                    state.scan_period_ticks = None;
                    state.next_scan = Some(next_tick);
                }
                (ScanRequest::Every(period_ticks), _) => {
                    state.scan_period_ticks = Some(period_ticks);
                    state.next_scan = Some(next_tick);
                }
            }
        }
        self.move_obstacles();
        self.move_bodies();
        self.drain();
        self.localise();
        self.agents.iter_mut().for_each(|state| state.drift.advance(&self.params.noise));
        self.tick = self.tick.after(1);
    }

    fn move_bodies(&mut self) {
        for index in 0..self.agents.len() {
            let state = &mut self.agents[index];
            // Where no body is, none falls when its floor goes.
            if !state.presence.is_in_world() {
                continue;
            }
            let obstacles = Obstacles::new(&self.terrain, &self.spheres, index).and(self.moving_obstacles.solids());
            let moved = state.body.advance(&obstacles, Tick::TICK_S);
            state.distance_m += moved.distance_m;
            if moved.task_done {
                state.pending_observation.events |= EventMask::TASK_DONE;
            }
            if moved.collided {
                state.pending_observation.events |= EventMask::COLLISION;
                self.totals.collisions += 1;
            }
            self.update_position(index);
        }
    }

    /// Updates what depends on the position of a body: its collision sphere, its cell, the coverage
    /// and the contacts.
    fn update_position(&mut self, index: usize) {
        let state = &mut self.agents[index];
        let position = state.body.pose().position;
        if position == self.spheres[index].centre {
            return;
        }
        self.spheres[index].centre = position;
        self.has_present_contacts = false;
        let cell = self.terrain.extent().cell_of(&position);
        if cell != state.cell {
            assert_eq!(self.terrain.get(cell), Some(&Terrain::Free), "agent {index} has left free space");
            state.cell = cell;
            state.pending_observation.events |= EventMask::NEW_CELL;
            self.coverage.cover(AgentId::from_index(index), index_of(&self.terrain, cell));
        }
    }
}

/// The LiDARs by agent; agents with the same ones share them.
fn lidars(params: &WorldParams, agents: usize) -> Vec<Arc<Lidar>> {
    let has_obstacles = !params.obstacles.is_empty();
    let mut known: Vec<(&SensorSuite, Arc<Lidar>)> = Vec::new();
    let lidar = |agent: AgentId| {
        let sensors = params.other_sensors.get(&agent).unwrap_or(&params.sensors);
        if let Some((_, lidar)) = known.iter().find(|(other, _)| *other == sensors) {
            return Arc::clone(lidar);
        }
        let in_world = sensors.map(|scanner| scanner.clone().meeting_obstacles(has_obstacles));
        let lidar = Arc::new(Lidar::new(in_world, params.noise, agents as u32));
        known.push((sensors, Arc::clone(&lidar)));
        lidar
    };
    ids().take(agents).map(lidar).collect()
}

fn ids() -> impl Iterator<Item = AgentId> {
    (0..).map(AgentId)
}

/// Index of a cell that lies inside the map.
fn index_of(terrain: &Grid<Terrain>, cell: Cell) -> u32 {
    let index = terrain.extent().index(cell).expect("bodies are inside the map");
    u32::try_from(index).expect("an extent has at most 2^30 cells")
}

#[cfg(test)]
mod tests;
