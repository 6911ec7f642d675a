//! Localisation that drifts: where the agents believe to be, and where their scans enter their
//! maps.
//!
//! **Blocks.** Odometry has an error (`odometry`). An agent corrects it within the *block* of its
//! map that it is building, as scan matching does in a submap: there, what it sees is where it
//! believes it to be. So the frame of a block is that of the true map, moved by a whole number of
//! cells. Once odometry has drifted from a block by `DRIFT_CELLS` along an axis, the next
//! block begins: the sensor enters all it sees anew, which overrides what earlier blocks have
//! there. The grid of a block stays aligned with the axes: an error of the heading turns the way
//! that odometry measures, and not the cells of a block.
//!
//! **The boundary.** What goes to an agent passes through the frame of its present block, in
//! [`World::observe`]; what comes from it passes back, in [`World::step`]. Bodies, rays and radios
//! meet the true world.
//!
//! **Limits.** An agent knows the extent of the map. A block that would put its body into the
//! outermost layer or beyond is moved back, which corrects its odometry from then on. Cells that a
//! block moves out of the map are not entered.
//!
//! Invariants: a world without noise of odometry has none of this; what is believed depends on the
//! scenario and the true motion alone.

mod belief;
mod closure;
mod odometry;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use fixedbitset::FixedBitSet;
use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, SMatrix, Vector3};
use protocol::event_mask::EventMask;
use protocol::kinematics::turned;
use protocol::map_frame::MapFrame;
use protocol::observation::{AgentMessage, Cells, Peer};
use voxels::{Extent, Terrain};

use super::body::{Motion, Pose};
use super::{AgentState, PendingObservation, Presence, ScanSchedule, World};
pub use belief::MapErrors;
use belief::{Belief, Entered};
pub use closure::LoopClosures;
use closure::Loops;
pub use odometry::OdometryNoise;
use odometry::{Measured, Odometry};

/// How far odometry drifts from a block along an axis before the next one begins, cells. Half a
/// cell would be nearest; with more, noise does not lead to and fro between two blocks.
const DRIFT_CELLS: f64 = 0.75;

/// Ticks between two samples of the errors of the positions.
pub const SAMPLE_TICKS: u64 = 10;

/// The localisation of all agents.
#[derive(Debug)]
pub(super) struct Localisation {
    noise: OdometryNoise,
    agents: Vec<AgentLocalisation>,
}

/// The localisation of one agent.
#[derive(Debug)]
struct AgentLocalisation {
    odometry: Odometry,
    /// The error of the position by odometry with all corrections, metres, which the block follows.
    drift_m: Vector3<f64>,
    /// What the agent has corrected of the heading of its odometry, radians.
    heading_correction_rad: f64,
    belief: Belief,
    loops: Loops,
    /// The tick of the first scans of the present block.
    block_since: Tick,
    /// The frames at the last scan.
    at_last_scan: Frames,
    /// Free cells of the true map that its sensor has seen.
    seen: FixedBitSet,
    squared_errors_m2: f64,
    samples: u64,
}

/// The frames of an agent, all seen from the true map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frames {
    /// The true pose of the body.
    pub body: Pose,
    /// Where the agent's map has what is at the origin of the true one, metres.
    pub map_offset_m: Vector3<f64>,
    /// The pose of the body by odometry alone.
    pub odometry: Pose,
    /// The covariance of that: x, y, z (metres) and heading (radians).
    pub covariance: SMatrix<f64, 4, 4>,
}

/// What drift has done so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftTotals {
    /// Root mean square over agents and samples of the distance between the believed and the true
    /// position, metres: the absolute trajectory error, without alignment.
    pub position_error_m: f64,
    /// The errors of the maps, summed over the agents.
    pub map_errors: MapErrors,
    /// Number of blocks that agents have begun after their first.
    pub blocks: u64,
    /// Number of loops that agents have closed.
    pub closures: u64,
}

impl Localisation {
    /// Localisation without error yet of agents at `starts`; `None` with exact odometry.
    pub(super) fn new(noise: &OdometryNoise, extent: Extent, starts: &[Pose]) -> Option<Self> {
        if noise.is_exact() {
            return None;
        }
        let agents = (0..).map(AgentId).zip(starts).map(|(agent, &start)| {
            let odometry = Odometry::new(noise, agent, start);
            let mut localisation = AgentLocalisation {
                at_last_scan: Frames {
                    body: start,
                    map_offset_m: Vector3::zeros(),
                    odometry: odometry.pose(),
                    covariance: odometry.covariance(),
                },
                odometry,
                drift_m: Vector3::zeros(),
                heading_correction_rad: 0.0,
                belief: Belief::new(extent),
                loops: Loops::default(),
                block_since: Tick::ZERO,
                seen: FixedBitSet::with_capacity(extent.volume()),
                squared_errors_m2: 0.0,
                samples: 0,
            };
            localisation.sample();
            localisation
        });
        Some(Self { noise: *noise, agents: agents.collect() })
    }
}

impl AgentLocalisation {
    /// The error of the position that the agent believes, metres.
    fn error_m(&self) -> Vector3<f64> {
        self.belief.offset_m()
    }

    fn sample(&mut self) {
        self.squared_errors_m2 += self.error_m().norm_squared();
        self.samples += 1;
    }

    fn frames(&self, body: &Pose) -> Frames {
        Frames {
            body: *body,
            map_offset_m: self.belief.offset_m(),
            odometry: self.odometry.pose(),
            covariance: self.odometry.covariance(),
        }
    }

    /// The offset of the next block, cells, if the present one ends; `radius_m` is that of the
    /// body.
    fn next_block(&mut self, position: &Point3<f64>, radius_m: f64, extent: Extent) -> Option<[i32; 3]> {
        let cell_m = extent.cell_m();
        let drifted_m = self.drift_m;
        let present = self.belief.offset();
        let mut next = present;
        let has_drifted = (drifted_m / cell_m - Vector3::from(present.map(f64::from))).amax() > DRIFT_CELLS;
        for axis in 0..3 {
            if has_drifted {
                next[axis] = libm::round(drifted_m[axis] / cell_m) as i32;
            }
            // Whatever the true position is, 0 is allowed.
            let low = libm::ceil((cell_m + radius_m - position[axis]) / cell_m).min(0.0) as i32;
            let last_m = f64::from(extent.size()[axis] - 1) * cell_m;
            let high = libm::floor((last_m - radius_m - position[axis]) / cell_m).max(0.0) as i32;
            let allowed = next[axis].clamp(low, high);
            if allowed != next[axis] {
                next[axis] = allowed;
                self.drift_m[axis] = f64::from(allowed) * cell_m;
            }
        }
        (next != present).then_some(next)
    }
}

impl World {
    /// The localisation of an agent; `None` if it is exact.
    fn localisation_of(&self, agent: AgentId) -> Option<&AgentLocalisation> {
        self.localisation.as_ref().map(|localisation| &localisation.agents[agent.index()])
    }

    /// The frames of an agent; `None` if its localisation is exact.
    #[must_use]
    pub fn frames(&self, agent: AgentId) -> Option<Frames> {
        self.localisation_of(agent).map(|localisation| localisation.frames(self.body(agent).pose()))
    }

    /// The frames of an agent at its last scan; `None` if its localisation is exact.
    #[must_use]
    pub fn frames_at_last_scan(&self, agent: AgentId) -> Option<Frames> {
        self.localisation_of(agent).map(|localisation| localisation.at_last_scan)
    }

    /// What drift has done so far; `None` if localisation is exact.
    #[must_use]
    pub fn drift_totals(&self) -> Option<DriftTotals> {
        let agents = &self.localisation.as_ref()?.agents;
        let samples: u64 = agents.iter().map(|agent| agent.samples).sum();
        let squared_m2: f64 = agents.iter().map(|agent| agent.squared_errors_m2).sum();
        Some(DriftTotals {
            position_error_m: libm::sqrt(squared_m2 / samples.max(1) as f64),
            map_errors: agents.iter().map(|agent| agent.belief.errors()).sum(),
            blocks: agents.iter().map(|agent| agent.belief.blocks_begun()).sum(),
            closures: agents.iter().map(|agent| agent.loops.closed).sum(),
        })
    }

    /// A point of the true world in the map of an agent (metres), clamped to the map.
    pub(super) fn in_map_of(&self, agent: AgentId, point: &Point3<f64>) -> Point3<f64> {
        match self.localisation_of(agent).map(|localisation| localisation.belief.offset_m()) {
            Some(offset_m) if offset_m != Vector3::zeros() => {
                super::noise::within(&(point + offset_m), self.terrain.extent())
            }
            _ => *point,
        }
    }

    /// The maps of others in that of an agent, as far as they are elsewhere: of the agents that are
    /// in contact or have sent one of the messages.
    pub(super) fn map_frames(&self, agent: AgentId, contacts: &[AgentId], messages: &[AgentMessage]) -> Vec<MapFrame> {
        let Some(own) = self.localisation_of(agent).map(AgentLocalisation::error_m) else { return Vec::new() };
        let senders = messages.iter().filter_map(|message| match message.peer {
            Peer::One(sender) => Some(sender),
            Peer::Broadcast | Peer::Relay(_) | Peer::NewRelay | Peer::Server => None,
        });
        let others: BTreeSet<AgentId> = contacts.iter().copied().chain(senders).collect();
        let frame = |agent| {
            let origin = Point3::from(own - self.localisation_of(agent)?.error_m());
            (origin != Point3::origin()).then_some(MapFrame { agent, origin })
        };
        others.into_iter().filter_map(frame).collect()
    }

    /// Cells of the true map as cells of the map of an agent.
    pub(super) fn cells_in_map_of(&self, agent: AgentId, cells: Cells) -> Cells {
        let Some(localisation) = self.localisation_of(agent) else { return cells };
        let moved = |cells: Vec<u32>| cells.into_iter().filter_map(|cell| localisation.belief.cell_of(cell)).collect();
        Cells { free: moved(cells.free), wall: moved(cells.wall) }
    }

    /// A motion that an agent has planned on its map, in the true world.
    pub(super) fn in_world(&self, agent: AgentId, motion: Motion) -> Motion {
        let Some(offset_m) = self.localisation_of(agent).map(AgentLocalisation::error_m) else { return motion };
        let moved = |path: Vec<Point3<f64>>| path.into_iter().map(|waypoint| waypoint - offset_m).collect();
        match motion {
            Motion::Path(path) => Motion::Path(moved(path)),
            Motion::Velocity { linear_in_body_m_s, yaw_rate_rad_s, path } => {
                Motion::Velocity { linear_in_body_m_s, yaw_rate_rad_s, path: moved(path) }
            }
            motion @ (Motion::Keep | Motion::Stop | Motion::Move { .. } | Motion::Turn { .. }) => motion,
        }
    }

    /// Takes note that a body was put where it is.
    pub(super) fn localise_anew(&mut self, agent: AgentId) {
        let pose = *self.body(agent).pose();
        if let Some(localisation) = &mut self.localisation {
            localisation.agents[agent.index()].odometry.put(pose);
        }
    }

    /// Notes the frames of a scan of this tick.
    pub(super) fn note_scan(&mut self, index: usize) {
        if let Some(localisation) = &mut self.localisation {
            let agent = &mut localisation.agents[index];
            agent.at_last_scan = agent.frames(self.agents[index].body.pose());
        }
    }

    /// The tick from which on scans of an agent belong to its present block.
    pub(super) fn block_since(&self, index: usize) -> Tick {
        self.localisation.as_ref().map_or(Tick::ZERO, |localisation| localisation.agents[index].block_since)
    }

    /// Measures the motions of this tick by odometry, and begins blocks.
    pub(super) fn localise(&mut self) {
        let Self { localisation: Some(localisation), agents, terrain, .. } = self else { return };
        let extent = terrain.extent();
        let next_tick = self.tick.after(1);
        let mut next_blocks = Vec::new();
        for (index, (own, state)) in localisation.agents.iter_mut().zip(agents).enumerate() {
            if !state.presence.is_in_world() {
                continue;
            }
            let AgentState { body, .. } = state;
            if let Some(Measured { motion_m, believed_m }) = own.odometry.measure(&localisation.noise, body.pose()) {
                own.drift_m += turned(&believed_m, own.heading_correction_rad) - motion_m;
                own.loops.travelled_m += motion_m.norm();
            }
            if own.belief.has_room()
                && let Some(offset) = own.next_block(&body.pose().position, body.model().radius_m, extent)
            {
                next_blocks.push((index, offset));
            }
        }
        for (index, offset) in next_blocks {
            self.begin_block(index, offset);
        }
        if next_tick.0.is_multiple_of(SAMPLE_TICKS) {
            self.close_loops();
            let Some(localisation) = &mut self.localisation else { return };
            let in_world = localisation.agents.iter_mut().zip(&self.agents);
            in_world.filter(|(_, state)| state.presence.is_in_world()).for_each(|(own, _)| own.sample());
        }
    }

    /// Begins a block of the map of an agent: its sensor enters anew what it sees from the next
    /// tick on, in which the agent is due.
    fn begin_block(&mut self, index: usize, offset: [i32; 3]) {
        // What was seen so far belongs to the block that ends.
        self.collect_scans(index);
        let (next_tick, schedule) = (self.tick.after(1), self.params.schedule);
        let state = &mut self.agents[index];
        state.sensor.forget_all();
        state.pending_observation.events |= EventMask::REVISED;
        if state.presence == Presence::Active && matches!(schedule, ScanSchedule::OnRequest { .. }) {
            state.next_scan = Some(next_tick);
        }
        let Some(localisation) = &mut self.localisation else { return };
        let own = &mut localisation.agents[index];
        own.belief.begin_block(offset);
        own.loops.begin_block(own.belief.present());
        own.block_since = next_tick;
    }

    /// Removes the cells that an agent has seen before, and notes the others.
    pub(super) fn seen_first(&mut self, agent: AgentId, cells: &[u32]) -> Vec<u32> {
        let Some(localisation) = &mut self.localisation else { return cells.to_vec() };
        let seen = &mut localisation.agents[agent.index()].seen;
        cells.iter().copied().filter(|&cell| !seen.put(cell as usize)).collect()
    }

    /// What the memory of a sensor does not know of a change of the map, because it is that of a
    /// block: which of the cells (by index) the agent has on its map, and how many of them counted
    /// as explored by it. Forgets them. `None` if localisation is exact.
    pub(super) fn revise_belief(&mut self, index: usize, changed: &[u32]) -> Option<(Vec<u32>, usize)> {
        let own = &mut self.localisation.as_mut()?.agents[index];
        let mut explored = 0;
        for &cell in changed {
            explored += usize::from(own.seen.contains(cell as usize));
            own.seen.set(cell as usize, false);
        }
        let known = changed.iter().copied().filter(|&cell| own.belief.knows(cell)).collect();
        let in_map: Vec<u32> = changed.iter().filter_map(|&cell| own.belief.cell_of(cell)).collect();
        own.belief.forget(self.agents[index].pending_observation.forget(&in_map));
        Some((known, explored))
    }
}

impl Localisation {
    /// Enters cells of the true map that the sensor of an agent has found into what it has pending.
    pub(super) fn enter(&mut self, index: usize, free: &[u32], wall: &[u32], pending: &mut PendingObservation) {
        let belief = &mut self.agents[index].belief;
        let (free, wall) = (belief.enter(free, Terrain::Free), belief.enter(wall, Terrain::Wall));
        pending.enter(free, wall);
    }
}

impl PendingObservation {
    /// Adds cells that have become free or wall on the map of the agent. Of a cell that is pending
    /// in another state, it learns the last one alone.
    fn enter(&mut self, free: Entered, wall: Entered) {
        let mut revised = [free.revised, wall.revised].concat();
        if !revised.is_empty() {
            revised.sort_unstable();
            self.forget(&revised);
        }
        self.free.extend(free.new);
        self.wall.extend(wall.new);
    }
}
