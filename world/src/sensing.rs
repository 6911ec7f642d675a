//! The scans of the agents: when they are requested, and when their results are counted.
//!
//! What a scan sees follows from the pose it is cast from and from the earlier scans of the same
//! sensor, so a helper may cast it later, while the loop continues with other agents and ticks, or
//! ahead. The results are collected where something depends on them: those of an agent in its
//! observation, those of all agents in the coverage ([`World::flush_scans`]).
//!
//! Invariants: coverage counts scans tick by tick; without helpers each scan is cast and counted at
//! once.

mod sensor;

use msgs::ids::{AgentId, Tick};
use voxels::Terrain;

use super::{AgentState, World};
use crate::lidar::{NoisyScan, RayReturn, Scanner};
use crate::workers::Workers;
use sensor::ScanResult;
pub(super) use sensor::{Lidar, Sensor};

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

impl AgentState {
    /// Names the scans that are due next to the sensor; returns whether it casts any ahead.
    fn expect_scans(&self, tick: Tick) -> bool {
        let Self { body, sensor, next_scan, scan_period_ticks, last_scan, .. } = self;
        let last = last_scan.map(|(pose, _)| pose);
        match (next_scan, scan_period_ticks) {
            (Some(next), &Some(period_ticks)) if body.is_active() => {
                sensor.expect(body, last, next.0.saturating_sub(tick.0), period_ticks)
            }
            _ => false,
        }
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
        let is_own = self.pending_scans.is_empty() && !self.is_deferring;
        let state = &mut self.agents[index];
        state.sensor.request(*state.body.pose(), self.tick, state.last_bodies.clone());
        if !workers.has_helpers() {
            drop(state.sensor.state());
        } else if !is_own {
            state.expect_scans(self.tick);
            state.sensor.announce(workers);
        }
        state.has_results = true;
        if !std::mem::replace(&mut state.is_uncounted, true) {
            self.pending_scans.push(index);
        }
    }

    /// Has helpers cast scans ahead for the agents that got a task in the last tick.
    pub fn cast_ahead(&self, workers: &Workers) {
        if !workers.has_helpers() {
            return;
        }
        for &index in &self.with_task {
            let state = &self.agents[index];
            if state.expect_scans(self.tick) {
                state.sensor.announce(workers);
            }
        }
    }

    /// Collects what the scans of an agent have found for its observation.
    pub(super) fn collect_scans(&mut self, index: usize) {
        let Self { agents, localisation, .. } = self;
        let AgentState { sensor, pending_observation, has_results, outdated, .. } = &mut agents[index];
        if std::mem::take(has_results) {
            let mut found = sensor.found();
            if !outdated.is_empty() {
                pending_observation.note_revised(outdated, &found.free);
                pending_observation.note_revised(outdated, &found.wall);
            }
            match localisation {
                None => {
                    pending_observation.free.append(&mut found.free);
                    pending_observation.wall.append(&mut found.wall);
                }
                Some(localisation) => {
                    let ScanResult { free, wall, .. } = &mut *found;
                    localisation.enter(index, free, wall, pending_observation);
                    free.clear();
                    wall.clear();
                }
            }
        }
    }

    /// Whether all scans are cast and counted.
    #[must_use]
    pub fn has_no_pending_scans(&self) -> bool {
        self.pending_scans.is_empty()
    }

    /// Casts what is left of all scans, and counts them in the coverage.
    pub fn flush_scans(&mut self) -> ExploredShares {
        let mut shares = ExploredShares { before: self.coverage.explored(), after: Vec::new() };
        let agents = std::mem::take(&mut self.pending_scans);
        // From the end, for helpers begin with those that have waited longest; those that a helper
        // is casting come last.
        let is_busy = |&index: &usize| !self.agents[index].sensor.try_cast();
        let busy: Vec<usize> = agents.iter().rev().copied().filter(is_busy).collect();
        busy.into_iter().for_each(|index| drop(self.agents[index].sensor.found()));
        let mut scans = Vec::new();
        for index in agents {
            self.agents[index].is_uncounted = false;
            let ScanResult { explored, ends, .. } = &mut *self.agents[index].sensor.found();
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

    /// What the rays of a scanner in the place of a LiDAR of `agent` measure from the pose of its
    /// last scan, in the fixed order of the rays; empty before the first.
    #[must_use]
    pub fn returns(&self, agent: AgentId, lidar: usize, scanner: &Scanner) -> Vec<RayReturn> {
        let noise = &self.params.noise;
        let AgentState { sensor, last_scan, last_bodies, .. } = &self.agents[agent.index()];
        let &Some((pose, tick)) = last_scan else { return Vec::new() };
        let memory = &sensor.state().memory;
        let bodies = &last_bodies.met_by(scanner);
        match noise.affects_scans() {
            true => scanner.returns_noisy(memory, &pose, NoisyScan { noise, agent, lidar, tick, bodies }),
            false => scanner.returns(memory, &pose, bodies),
        }
    }

    /// Ticks between the scans of an agent; `None` if there is no period.
    #[must_use]
    pub fn scan_period_ticks(&self, agent: AgentId) -> Option<u32> {
        self.agents[agent.index()].scan_period_ticks
    }

    fn count_explored(&mut self, agent: AgentId, new_free: &[u32]) {
        if !self.params.noise.affects_scans() && self.localisation.is_none() {
            return self.coverage.explore(agent, new_free);
        }
        // A wall that noise makes look free is not explored.
        let is_free = |&cell: &u32| self.terrain.as_slice()[cell as usize] == Terrain::Free;
        let truly_free: Vec<u32> = new_free.iter().copied().filter(is_free).collect();
        let seen_first = self.seen_first(agent, &truly_free);
        self.coverage.explore(agent, &seen_first);
    }
}
