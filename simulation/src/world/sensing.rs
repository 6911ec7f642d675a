//! The sensors of the agents, and the scans that are due and not cast yet.
//!
//! What a scan sees follows from the pose it is cast from and from the earlier scans of the same
//! sensor, so a helper may cast it later, while the loop continues with other agents and ticks. The
//! results are collected where something depends on them: those of an agent in its observation,
//! those of all agents in the coverage ([`World::settle`]).
//!
//! Invariants: a sensor casts its scans in the order in which they became due; coverage counts
//! them tick by tick; without helpers each scan is cast and counted at once.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use msgs::ids::{AgentId, Tick};
use voxels::Terrain;

use super::body::Pose;
use super::lidar::{NoisyScan, Scanner, SensorMemory};
use super::noise::SensorNoise;
use super::{AgentState, World};
use crate::workers::Workers;

/// What is common to the LiDARs of all agents.
#[derive(Debug)]
pub(super) struct Lidar {
    pub(super) scanner: Scanner,
    pub(super) noise: SensorNoise,
}

/// The sensor of one agent; clones are the same sensor.
#[derive(Debug, Clone)]
pub(super) struct Sensor(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    agent: AgentId,
    lidar: Arc<Lidar>,
    /// Poses and ticks of the scans that no thread has begun.
    due: Mutex<VecDeque<(Pose, Tick)>>,
    /// Whether a helper will look at `due`.
    is_announced: AtomicBool,
    state: Mutex<State>,
}

/// Held by the thread that casts.
#[derive(Debug)]
pub(super) struct State {
    pub(super) memory: SensorMemory,
    found: Found,
}

/// The results of scans that were not collected yet.
#[derive(Debug, Default)]
struct Found {
    /// New cells for the observation of the agent.
    free: Vec<u32>,
    wall: Vec<u32>,
    /// New free cells for the coverage, and where those of each tick end.
    explored: Vec<u32>,
    ends: Vec<(Tick, usize)>,
}

impl Sensor {
    pub(super) fn new(agent: AgentId, lidar: &Arc<Lidar>, memory: SensorMemory) -> Self {
        let state = Mutex::new(State { memory, found: Found::default() });
        let (lidar, due, is_announced) = (Arc::clone(lidar), Mutex::default(), AtomicBool::new(false));
        Self(Arc::new(Shared { agent, lidar, due, is_announced, state }))
    }

    /// Has a scan cast once its results are collected, or by a helper if one is free before.
    fn request(&self, pose: Pose, tick: Tick, helpers: Option<&Workers>) {
        self.0.due().push_back((pose, tick));
        let Some(workers) = helpers else { return };
        if !self.0.is_announced.swap(true, Ordering::AcqRel) {
            let shared = Arc::clone(&self.0);
            workers.spawn(move || {
                // First, so that what becomes due from now on is announced anew.
                shared.is_announced.store(false, Ordering::Release);
                shared.try_cast();
            });
        }
    }

    /// The state with all scans cast.
    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        let mut state = self.0.state();
        self.0.cast_due(&mut state);
        state
    }
}

impl Shared {
    fn due(&self) -> MutexGuard<'_, VecDeque<(Pose, Tick)>> {
        self.due.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Casts all scans, unless another thread is casting at present; returns whether it did. What
    /// that thread does not cast either is cast once the results are collected.
    fn try_cast(&self) -> bool {
        match self.state.try_lock() {
            Ok(mut state) => self.cast_due(&mut state),
            Err(TryLockError::Poisoned(poisoned)) => self.cast_due(&mut poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => return false,
        }
        true
    }

    fn cast_due(&self, state: &mut State) {
        loop {
            // Not held while casting.
            let next = self.due().pop_front();
            let Some((pose, tick)) = next else { return };
            state.cast(self.agent, &self.lidar, &pose, tick);
        }
    }
}

impl State {
    fn cast(&mut self, agent: AgentId, Lidar { scanner, noise }: &Lidar, pose: &Pose, tick: Tick) {
        let Self { memory, found: Found { free, wall, explored, ends } } = self;
        let first = free.len();
        if noise.affects_scans() {
            scanner.scan_noisy(memory, pose, NoisyScan { noise, agent, tick }, free, wall);
        } else {
            scanner.scan(memory, pose, free, wall);
        }
        explored.extend_from_slice(&free[first..]);
        ends.push((tick, explored.len()));
    }
}

/// The explored share of the team after each tick with scans, as they are counted.
#[derive(Debug, Clone, PartialEq)]
pub struct ExploredShares {
    before: f64,
    after: Vec<(Tick, f64)>,
}

impl ExploredShares {
    /// The share at the start of a tick.
    #[must_use]
    pub fn at_start_of(&self, tick: Tick) -> f64 {
        let passed = self.after.partition_point(|&(scanned, _)| scanned < tick);
        passed.checked_sub(1).map_or(self.before, |last| self.after[last].1)
    }
}

impl World {
    /// Lets the results of scans wait for later ticks, because nothing needs the coverage at the
    /// end of each tick. Without this, the thread of the loop keeps one scan of each tick for
    /// itself.
    pub fn defer_scans(&mut self) {
        self.is_deferring = true;
    }

    /// Casts a scan of an agent, or has a helper cast it.
    pub(super) fn request_scan(&mut self, index: usize, workers: &Workers) {
        let is_own = self.uncounted.is_empty() && !self.is_deferring;
        let state = &mut self.agents[index];
        let pose = *state.body.pose();
        if workers.has_helpers() {
            state.sensor.request(pose, self.tick, (!is_own).then_some(workers));
        } else {
            state.sensor.state().cast(AgentId::from_index(index), &self.lidar, &pose, self.tick);
        }
        state.has_results = true;
        if !std::mem::replace(&mut state.is_uncounted, true) {
            self.uncounted.push(index);
        }
    }

    /// Collects what the scans of an agent have found for its observation.
    pub(super) fn collect_scans(&mut self, index: usize) {
        let AgentState { sensor, pending_observation, has_results, .. } = &mut self.agents[index];
        if std::mem::take(has_results) {
            let mut state = sensor.state();
            pending_observation.free.append(&mut state.found.free);
            pending_observation.wall.append(&mut state.found.wall);
        }
    }

    /// Whether all scans are cast and counted.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.uncounted.is_empty()
    }

    /// Casts what is left of all scans, and counts them in the coverage.
    pub fn settle(&mut self) -> ExploredShares {
        let mut shares = ExploredShares { before: self.coverage.explored(), after: Vec::new() };
        let agents = std::mem::take(&mut self.uncounted);
        // From the end, for helpers begin with those that have waited longest; those that a helper
        // is casting come last.
        let is_busy = |&index: &usize| !self.agents[index].sensor.0.try_cast();
        let busy: Vec<usize> = agents.iter().rev().copied().filter(is_busy).collect();
        busy.into_iter().for_each(|index| drop(self.agents[index].sensor.state()));
        let mut scans = Vec::new();
        for index in agents {
            self.agents[index].is_uncounted = false;
            let Found { explored, ends, .. } = &mut self.agents[index].sensor.state().found;
            let mut start = 0;
            for (tick, end) in ends.drain(..) {
                scans.push((tick, index, explored[start..end].to_vec()));
                start = end;
            }
            explored.clear();
        }
        scans.sort_by_key(|&(tick, index, _)| (tick, index));
        for scans in scans.chunk_by(|(one, ..), (other, ..)| one == other) {
            for (_, index, new_free) in scans {
                self.count_explored(AgentId::from_index(*index), new_free);
            }
            let tick = scans[0].0;
            self.coverage.note_milestones(tick);
            shares.after.push((tick, self.coverage.explored()));
        }
        shares
    }

    fn count_explored(&mut self, agent: AgentId, new_free: &[u32]) {
        if !self.lidar.noise.affects_scans() {
            return self.coverage.explore(agent, new_free);
        }
        // A wall that noise makes look free is not explored.
        let is_free = |&cell: &u32| self.terrain.as_slice()[cell as usize] == Terrain::Free;
        let truly_free: Vec<u32> = new_free.iter().copied().filter(is_free).collect();
        self.coverage.explore(agent, &truly_free);
    }
}
