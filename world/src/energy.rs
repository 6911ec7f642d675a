//! The batteries of the bodies: how they drain, where they charge, and what happens without energy.
//!
//! The rule is that of [`protocol::energy`]. A body that has run empty stops: its task ends with
//! [`EventMask::TASK_DONE`], and further motions are refused without an event. It stays an obstacle
//! that sees and talks. If a base charges it, its task has ended once more, so that its agent
//! decides anew. Agents that are not in the world, or have broken down, draw nothing.
//!
//! Invariant: the energy of a body is within 0 and its capacity, and rises only at rest in a base.
//! A world without batteries does nothing here.

use std::sync::Arc;

use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};
use protocol::body_model::{BodyKind, BodyModel};
use protocol::energy::{Base, Energy, EnergyModel};
use protocol::event_mask::EventMask;

use super::body::{Body, Motion, Pose};
use super::{Presence, World};

/// The parameters of the batteries of a team.
#[derive(Debug, Clone, PartialEq)]
pub struct EnergyParams {
    /// What a full battery holds.
    pub capacity: Capacity,
    /// Power that each body draws, W.
    pub idle_w: f64,
    /// Power that an aerial body draws in addition, W.
    pub hover_w: f64,
    /// Energy that a body draws in addition for each metre, J/m.
    pub move_j_per_m: f64,
    /// Power that a body gains at rest in a base, W.
    pub charge_w: f64,
    /// The centres of the bases, metres; `None`: the start of each agent is a base for it alone.
    pub bases: Option<Vec<Point3<f64>>>,
    /// Radius of a base, metres.
    pub base_radius_m: f64,
    /// Share of the capacity that an agent should have left when it is back.
    pub reserve: f64,
    /// Whether controllers are to go back in time.
    pub returns_home: bool,
}

/// What a full battery holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Capacity {
    /// So much energy, J.
    Energy(f64),
    /// What the body draws in so much time at rest, s.
    Endurance(f64),
}

impl EnergyParams {
    /// The power that a body draws, W.
    #[must_use]
    pub fn power_w(&self, body: &BodyModel) -> f64 {
        match body.kind {
            BodyKind::Submarine | BodyKind::Ground => self.idle_w,
            BodyKind::Aerial => self.idle_w + self.hover_w,
        }
    }

    fn bases_at(&self, centres: &[Point3<f64>]) -> Arc<[Base]> {
        centres.iter().map(|&position| Base { position, radius_m: self.base_radius_m }).collect()
    }

    fn model(&self, body: &BodyModel, bases: Arc<[Base]>) -> EnergyModel {
        let power_w = self.power_w(body);
        let capacity_j = match self.capacity {
            Capacity::Energy(energy_j) => energy_j,
            Capacity::Endurance(time_s) => time_s * power_w,
        };
        EnergyModel {
            capacity_j,
            power_w,
            move_j_per_m: self.move_j_per_m,
            charge_w: self.charge_w,
            reserve_j: self.reserve * capacity_j,
            returns_home: self.returns_home,
            bases,
        }
    }
}

/// The battery of one body.
#[derive(Debug)]
struct Battery {
    energy: Energy,
    used_j: f64,
    /// The distance that its body had travelled at the end of the last tick, metres.
    distance_m: f64,
}

/// The batteries of a team, by agent.
#[derive(Debug)]
pub(super) struct Batteries {
    batteries: Vec<Battery>,
    /// How often a body has run empty.
    ran_empty: u64,
    /// See [`World::note_team_is_home`].
    home_at: Option<Tick>,
}

/// What batteries have done so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyTotals {
    /// Energy that all bodies have drawn, J.
    pub used_j: f64,
    /// How often a body has run empty.
    pub ran_empty: u64,
    /// The first tick at whose start the whole team was home, with enough of the map explored.
    pub home_at: Option<Tick>,
}

impl Batteries {
    /// Full batteries for bodies at their starts.
    pub(super) fn full<'b>(params: &EnergyParams, bodies: impl Iterator<Item = (&'b BodyModel, Pose)>) -> Self {
        let common = params.bases.as_ref().map(|centres| params.bases_at(centres));
        let battery = |(body, start): (&BodyModel, Pose)| {
            let bases = common.clone().unwrap_or_else(|| params.bases_at(&[start.position]));
            let model = params.model(body, bases);
            Battery { energy: Energy { left_j: model.capacity_j, model }, used_j: 0.0, distance_m: 0.0 }
        };
        Self { batteries: bodies.map(battery).collect(), ran_empty: 0, home_at: None }
    }
}

impl World {
    /// The energy of an agent; `None` if bodies need none.
    #[must_use]
    pub fn energy(&self, agent: AgentId) -> Option<&Energy> {
        self.batteries.as_ref().map(|batteries| &batteries.batteries[agent.index()].energy)
    }

    /// The energy of an agent with its bases where they are from it, on its map; `None` if bodies
    /// need none.
    pub(super) fn energy_in_map_of(&self, agent: AgentId) -> Option<Energy> {
        let mut energy = self.energy(agent)?.clone();
        if self.frames(agent).is_some() {
            let moved = |base: &Base| Base { position: self.in_map_of(agent, &base.position), ..*base };
            energy.model.bases = energy.model.bases.iter().map(moved).collect();
        }
        Some(energy)
    }

    /// What the batteries have done so far; `None` without any.
    #[must_use]
    pub fn energy_totals(&self) -> Option<EnergyTotals> {
        self.batteries.as_ref().map(|Batteries { batteries, ran_empty, home_at }| EnergyTotals {
            used_j: batteries.iter().map(|battery| battery.used_j).sum(),
            ran_empty: *ran_empty,
            home_at: *home_at,
        })
    }

    /// Whether an agent is at rest in one of its bases.
    #[must_use]
    pub fn is_home(&self, agent: AgentId) -> bool {
        self.energy(agent).is_some_and(|energy| rests_in_base(self.body(agent), &energy.model))
    }

    /// Notes that the whole team is home in this tick, with enough of the map explored.
    pub fn note_team_is_home(&mut self) {
        if let Some(batteries) = &mut self.batteries {
            batteries.home_at.get_or_insert(self.tick);
        }
    }

    /// Whether a motion of an agent is refused, because its body is empty.
    pub(super) fn refuses(&self, agent: AgentId, motion: &Motion) -> bool {
        *motion != Motion::Keep && self.energy(agent).is_some_and(|energy| energy.left_j <= 0.0)
    }

    /// Drains and charges all batteries for the tick that ends.
    pub(super) fn drain(&mut self) {
        let Self { batteries: Some(batteries), agents, .. } = self else { return };
        for (battery, state) in batteries.batteries.iter_mut().zip(agents) {
            let Battery { energy: Energy { left_j, model }, used_j, distance_m } = battery;
            let moved_m = state.distance_m - std::mem::replace(distance_m, state.distance_m);
            if state.presence != Presence::Active {
                continue;
            }
            let (body, before_j) = (&mut state.body, *left_j);
            if rests_in_base(body, model) {
                *left_j = (before_j + model.charge_w * Tick::TICK_S).min(model.capacity_j);
                if before_j <= 0.0 && *left_j > 0.0 {
                    state.pending_observation.events |= EventMask::TASK_DONE;
                }
                continue;
            }
            *left_j = (before_j - model.drawn_j(Tick::TICK_S, moved_m)).max(0.0);
            *used_j += before_j - *left_j;
            if before_j > 0.0 && *left_j <= 0.0 {
                batteries.ran_empty += 1;
                if body.is_active() {
                    *body = Body::at_rest(*body.model(), *body.pose());
                    state.pending_observation.events |= EventMask::TASK_DONE;
                }
            }
        }
    }
}

/// Whether a body has no task, did not move in its last tick, and is in a base.
fn rests_in_base(body: &Body, model: &EnergyModel) -> bool {
    let is_still = body.velocity_in_body_m_s() == Vector3::zeros() && body.yaw_rate_rad_s() == 0.0;
    !body.is_active() && is_still && model.is_in_base(&body.pose().position)
}

#[cfg(test)]
mod tests;
