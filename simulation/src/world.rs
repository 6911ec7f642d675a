//! The true world and its fixed update: look, (compute, outside), communicate, move.
//!
//! A tick goes like this: [`World::look`] casts the scans that are due; the caller asks the agents that are due for commands
//! (with [`World::observe`]); [`World::step`] delivers the messages, moves the bodies in the order of their ids, and ends the
//! tick. Each body sees the others where they are at that moment: lower ids have moved already, higher ids not yet, so two
//! bodies can never come to overlap.
//!
//! Invariants: no body leaves free space or overlaps another; the result depends on the arguments alone. Threads only share
//! out scans, each of which writes to the memory of its own agent.
//!
//! This module knows no ROS, no file and no wall clock, and does not judge who is due: see [`crate::lockstep`].

pub mod body;
pub mod collision;
pub mod comms;
pub mod coverage;
mod interface;
pub mod lidar;
pub mod noise;
mod pending_observation;
mod radio_medium;
pub mod relays;
pub mod spawn;

use std::collections::BTreeMap;

use msgs::body_model::BodyModel;
use msgs::ids::{AgentId, Tick};
use msgs::relay_id::RelayId;
use msgs::scan_request::ScanRequest;
use nalgebra::Point3;
use rayon::ThreadPool;
use rayon::prelude::*;
use voxels::{Cell, Grid, Terrain};

use body::{Body, Pose};
use collision::{Obstacles, Sphere};
use comms::{Comms, ContactTable};
use coverage::Coverage;
pub use interface::{Action, COLLISION, CONTACTS, Commit, Events, NEW_CELL, Observation, PARCEL, TASK_DONE, Totals};
use lidar::{NoisyScan, Scanner, SensorMemory};
use noise::{Drift, SensorNoise};
use pending_observation::PendingObservation;
use radio_medium::RadioMedium;

/// Everything about a world that is not its terrain.
#[derive(Debug, Clone)]
pub struct WorldParams {
    /// What bodies can do.
    pub body: BodyModel,
    /// What those of some agents can do instead.
    pub other_bodies: BTreeMap<AgentId, BodyModel>,
    /// What LiDARs see.
    pub scanner: Scanner,
    /// When LiDARs scan.
    pub schedule: ScanSchedule,
    /// How agents communicate.
    pub comms: Comms,
    /// How agents err.
    pub noise: SensorNoise,
}

/// When LiDARs scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScanSchedule {
    /// Each as its agent asks; until it asks, every so many ticks, all in the same tick.
    OnRequest {
        /// At least 1.
        period_ticks: u32,
    },
    /// The reference's way: one agent in each tick, in turn, whatever they ask.
    TakeTurns,
}

/// The true world.
#[derive(Debug)]
pub struct World {
    tick: Tick,
    terrain: Grid<Terrain>,
    params: WorldParams,
    agents: Vec<AgentState>,
    spheres: Vec<Sphere>,
    contacts: Option<ContactTable>,
    radio: RadioMedium,
    coverage: Coverage,
    totals: Totals,
}

/// One agent as the world sees it.
#[derive(Debug)]
struct AgentState {
    body: Body,
    cell: Cell,
    distance_m: f64,
    memory: SensorMemory,
    next_scan: Option<Tick>,
    scan_period_ticks: Option<u32>,
    /// Where and when the last scan was cast.
    last_scan: Option<(Pose, Tick)>,
    want_view: bool,
    pending_observation: PendingObservation,
    drift: Drift,
    reported_contacts: Vec<AgentId>,
    reported_relays: Vec<(RelayId, Point3<f64>)>,
}

impl AgentState {
    /// The event that those in contact are others than were reported, if they are.
    fn change_of_contacts(&self, contacts: &[AgentId], relays: &[(RelayId, Point3<f64>)]) -> Events {
        let is_as_reported = contacts == self.reported_contacts && relays == self.reported_relays;
        if is_as_reported { 0 } else { CONTACTS }
    }
}

impl World {
    /// A world at tick 0 with a body at each of `starts`, which have room (see [`spawn`]).
    #[must_use]
    pub fn new(terrain: Grid<Terrain>, params: WorldParams, starts: &[Pose]) -> Self {
        let memory = SensorMemory::new(&terrain);
        let extent = terrain.extent();
        let free_cells = terrain.as_slice().iter().filter(|&&cell| cell == Terrain::Free).count();
        let period_ticks = match params.schedule {
            ScanSchedule::OnRequest { period_ticks } => Some(period_ticks),
            ScanSchedule::TakeTurns => None,
        };
        let agents: Vec<AgentState> = ids()
            .zip(starts)
            .map(|(agent, &pose)| AgentState {
                body: Body::at_rest(*params.other_bodies.get(&agent).unwrap_or(&params.body), pose),
                cell: extent.cell_of(&pose.position),
                distance_m: 0.0,
                memory: memory.unused(),
                next_scan: period_ticks.map(|_| Tick::ZERO),
                scan_period_ticks: period_ticks,
                last_scan: None,
                want_view: false,
                pending_observation: PendingObservation::default(),
                drift: Drift::new(&params.noise, agent),
                reported_contacts: Vec::new(),
                reported_relays: Vec::new(),
            })
            .collect();
        let mut coverage = Coverage::new(extent.volume(), free_cells, agents.len());
        for (agent, state) in ids().zip(&agents) {
            coverage.cover(agent, index_of(&terrain, state.cell));
        }
        let spheres = agents.iter().map(|state| state.body.sphere()).collect();
        Self {
            tick: Tick::ZERO,
            terrain,
            params,
            radio: RadioMedium::new(agents.len()),
            agents,
            spheres,
            contacts: None,
            coverage,
            totals: Totals::default(),
        }
    }

    /// The present tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// The true map.
    #[must_use]
    pub fn terrain(&self) -> &Grid<Terrain> {
        &self.terrain
    }

    /// The score so far.
    #[must_use]
    pub fn coverage(&self) -> &Coverage {
        &self.coverage
    }

    /// Running totals.
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

    /// Where an agent is told that it is, metres, frame `map`: what it says to others, too.
    #[must_use]
    pub fn measured_position(&self, agent: AgentId) -> Point3<f64> {
        let state = &self.agents[agent.index()];
        state.drift.measured(&state.body.pose().position, self.terrain.extent())
    }

    /// Puts a body somewhere, at rest. Its task has ended, as its agent is told.
    ///
    /// # Errors
    /// What is in the way, if there is no room; then nothing changes.
    pub fn place(&mut self, agent: AgentId, pose: Pose) -> Result<(), &'static str> {
        let model = *self.body(agent).model();
        let others = self.spheres.iter().enumerate().filter(|(other, _)| *other != agent.index());
        spawn::check_room(&self.terrain, others.map(|(_, sphere)| sphere), &pose.position, model.radius_m)?;
        let state = &mut self.agents[agent.index()];
        state.body = Body::at_rest(model, pose);
        state.pending_observation.events |= TASK_DONE;
        self.contacts = None;
        self.settle(agent.index());
        Ok(())
    }

    /// Notes how many free cells an agent says are on its map.
    pub fn note_belief(&mut self, agent: AgentId, known_free: u32) {
        self.coverage.believe(agent, known_free);
    }

    /// Pairs of agents in contact now.
    pub fn pairs_in_contact(&mut self) -> u32 {
        let higher =
            |agent, others: Vec<AgentId>| others.iter().filter(|&&other| other > agent).map(|_| 1).sum::<u32>();
        self.agents().map(|agent| higher(agent, self.contacts_of(agent))).sum()
    }

    /// Way travelled by each agent in metres, by agent.
    #[must_use]
    pub fn distance_m(&self) -> Vec<f64> {
        self.agents.iter().map(|state| state.distance_m).collect()
    }

    /// Agents in contact with an agent now, ascending.
    pub fn in_contact_with(&mut self, agent: AgentId) -> Vec<AgentId> {
        self.contacts_of(agent)
    }

    /// From where and when the last scan of an agent was.
    #[must_use]
    pub fn last_scan(&self, agent: AgentId) -> Option<(Pose, Tick)> {
        self.agents[agent.index()].last_scan
    }

    /// Where the rays of a scan of an agent from a pose meet walls, metres, frame `map`, in the scanner's own fixed order.
    #[must_use]
    pub fn hits_from(&self, agent: AgentId, pose: &Pose) -> Vec<Point3<f64>> {
        let Self { params: WorldParams { scanner, noise, .. }, agents, .. } = self;
        let AgentState { memory, last_scan, .. } = &agents[agent.index()];
        match last_scan {
            Some((_, tick)) if noise.affects_scans() => {
                scanner.hits_noisy(memory, pose, NoisyScan { noise, agent, tick: *tick })
            }
            _ => scanner.hits(memory, pose),
        }
    }

    /// Rays of one scan.
    #[must_use]
    pub fn rays(&self) -> u32 {
        self.params.scanner.rays()
    }

    /// Phase look: casts the scans that are due in this tick, of several agents at a time on the threads of `pool`.
    pub fn look(&mut self, pool: &ThreadPool) {
        let tick = self.tick;
        let team = self.agents.len() as u64;
        let (scanner, noise) = (&self.params.scanner, &self.params.noise);
        if self.params.schedule == ScanSchedule::TakeTurns {
            let turn = (tick.0 % team) as usize;
            self.agents[turn].next_scan = Some(tick);
        }
        let mut due: Vec<(usize, &mut AgentState)> =
            self.agents.iter_mut().enumerate().filter(|(_, state)| state.next_scan == Some(tick)).collect();
        if due.is_empty() {
            return;
        }
        self.totals.scans += due.len() as u64;
        for (_, state) in &mut due {
            state.next_scan = state.scan_period_ticks.map(|period| tick.after(period.into()));
        }
        let mut cast = Vec::with_capacity(due.len());
        for (index, state) in due {
            let pose = *state.body.pose();
            let sees_the_same = state.last_scan.is_some_and(|(last, _)| scanner.sees_the_same(&last, &pose));
            state.last_scan = Some((pose, tick));
            // A second look errs otherwise than the first.
            if noise.affects_scans() || !sees_the_same {
                cast.push((index, state));
            }
        }
        self.totals.scans_cast += cast.len() as u64;
        let scan = |(index, state): &mut (usize, &mut AgentState)| {
            let first = state.pending_observation.free.len();
            let pose = *state.body.pose();
            let pending_observation = &mut state.pending_observation;
            if noise.affects_scans() {
                let blur = NoisyScan { noise, agent: AgentId::from_index(*index), tick };
                scanner.scan_noisy(
                    &mut state.memory,
                    &pose,
                    blur,
                    &mut pending_observation.free,
                    &mut pending_observation.wall,
                );
            } else {
                scanner.scan(&mut state.memory, &pose, &mut pending_observation.free, &mut pending_observation.wall);
            }
            (*index, first)
        };
        let scanned: Vec<(usize, usize)> = if cast.len() > 1 && pool.current_num_threads() > 1 {
            pool.install(|| cast.par_iter_mut().map(scan).collect())
        } else {
            cast.iter_mut().map(scan).collect()
        };
        for (index, first) in scanned {
            let new_free = &self.agents[index].pending_observation.free[first..];
            let agent = AgentId::from_index(index);
            if self.params.noise.affects_scans() {
                // What is taken for free and is wall is no score.
                let is_free = |&cell: &u32| self.terrain.as_slice()[cell as usize] == Terrain::Free;
                let truly_free: Vec<u32> = new_free.iter().copied().filter(is_free).collect();
                self.coverage.explore(agent, &truly_free);
            } else {
                self.coverage.explore(agent, new_free);
            }
        }
        self.coverage.note_milestones(tick);
    }

    /// What has happened to an agent since its last observation that counted, as far as `asked` names it: a change of contacts
    /// is looked for only if it is asked for.
    pub fn events(&mut self, agent: AgentId, asked: Events) -> Events {
        let mut events = self.agents[agent.index()].pending_observation.events;
        if asked & CONTACTS != 0 {
            let (contacts, relays) = (self.contacts_of(agent), self.relays_of(agent));
            events |= self.agents[agent.index()].change_of_contacts(&contacts, &relays);
        }
        events & asked
    }

    /// What an agent learns in this tick. With [`Commit::Committed`] it counts as told afterwards.
    pub fn observe(&mut self, agent: AgentId, commit: Commit) -> Observation {
        let (contacts, relays) = (self.contacts_of(agent), self.relays_of(agent));
        let contact_positions = contacts.iter().map(|&other| (other, self.measured_position(other))).collect();
        let position = self.measured_position(agent);
        let (scanner, noise) = (&self.params.scanner, &self.params.noise);
        let state = &mut self.agents[agent.index()];
        let delta = match commit {
            Commit::Committed => state.pending_observation.commit(),
            Commit::Speculative => state.pending_observation.speculate(),
        };
        let events = delta.events | state.change_of_contacts(&contacts, &relays);
        let mut observation = Observation {
            tick: self.tick,
            agent,
            pose: Pose { position, ..*state.body.pose() },
            velocity_in_map_m_s: state.body.velocity_in_map_m_s(),
            yaw_rate_rad_s: state.body.yaw_rate_rad_s(),
            is_active: state.body.is_active(),
            collision: state.body.collision(),
            events,
            contacts: contact_positions,
            relays: relays.clone(),
            messages: delta.messages,
            scan_tick: state.last_scan.map(|(_, tick)| tick),
            seen_free: delta.free,
            seen_wall: delta.wall,
            view: None,
        };
        if state.want_view
            && let Some((pose, tick)) = &state.last_scan
        {
            observation.view = Some(match noise.affects_scans() {
                true => scanner.view_noisy(&state.memory, pose, NoisyScan { noise, agent, tick: *tick }),
                false => scanner.view(&state.memory, pose),
            });
        }
        if commit == Commit::Committed {
            (state.reported_contacts, state.reported_relays) = (contacts, relays);
        }
        observation
    }

    /// Phases communicate and move, and the end of the tick. Agents without an action go on as before.
    pub fn step(&mut self, actions: BTreeMap<AgentId, Action>) {
        self.communicate(&actions);
        for (agent, action) in actions {
            let next_tick = self.tick.after(1);
            let state = &mut self.agents[agent.index()];
            state.want_view = action.want_view;
            state.body.set_task(action.motion);
            match (action.lidar, self.params.schedule) {
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
        self.move_bodies();
        self.agents.iter_mut().for_each(|state| state.drift.advance(&self.params.noise));
        self.contacts = None;
        self.tick = self.tick.after(1);
    }

    fn move_bodies(&mut self) {
        for index in 0..self.agents.len() {
            let state = &mut self.agents[index];
            let obstacles = Obstacles::new(&self.terrain, &self.spheres, index);
            let moved = state.body.advance(&obstacles, Tick::TICK_S);
            state.distance_m += moved.distance_m;
            if moved.task_done {
                state.pending_observation.events |= TASK_DONE;
            }
            if moved.collided {
                state.pending_observation.events |= COLLISION;
                self.totals.collisions += 1;
            }
            self.settle(index);
        }
    }

    /// Takes note of where a body has come to.
    fn settle(&mut self, index: usize) {
        let state = &mut self.agents[index];
        let position = state.body.pose().position;
        self.spheres[index].centre = position;
        let cell = self.terrain.extent().cell_of(&position);
        if cell != state.cell {
            assert_eq!(self.terrain.get(cell), Some(&Terrain::Free), "agent {index} has left free space");
            state.cell = cell;
            state.pending_observation.events |= NEW_CELL;
            self.coverage.cover(AgentId::from_index(index), index_of(&self.terrain, cell));
        }
    }
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
