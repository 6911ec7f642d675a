//! A team that stands still: for long no body has left its place, and no agent waits for a time.
//!
//! Agents that wait for each other, or that see less from where they can be than the world would
//! show them, would do so until the duration is over. Small steps do not count, since bodies that
//! block each other make them for ever.
//!
//! Agents that name no stage, as nodes of users that know nothing of stages, may go on whenever they
//! like: a team with one of them never stands still.

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;

use super::Engine;

/// Time for which no body has left its place: 5 min.
const STANDSTILL_TICKS: u64 = 15_000;

/// How often the bodies are looked at: once a second.
const LOOK_TICKS: u64 = 50;

/// Longest wait of an agent that rests before a body in its way: 2 min. One that waits longer, but
/// not until the end of the run, waits for a time.
const WAIT_TICKS_MAX: u64 = 6000;

/// A body has left its place beyond so many times its radius, or the edge of a cell if that is more.
const STEP: f64 = 2.0;

/// Where the bodies have been since when.
#[derive(Debug, Default)]
pub(super) struct Standstill {
    since: Tick,
    /// By agent: the position and the energy, metres and J.
    places: Vec<(Point3<f64>, f64)>,
}

impl Standstill {
    /// Whether it has lasted long enough.
    pub(super) fn is_over(&self, now: Tick) -> bool {
        !self.places.is_empty() && now >= self.since.after(STANDSTILL_TICKS)
    }
}

impl Engine<'_> {
    /// Notes where the bodies are, for [`Engine::stands_still`]. Call it in every tick.
    pub(in crate::session) fn note_places(&mut self) {
        let now = self.tick();
        if now.0 % LOOK_TICKS != 0 {
            return;
        }
        if self.standstill.places.is_empty() || self.has_any_moved() {
            let energy_j = |agent| self.world.energy(agent).map_or(0.0, |energy| energy.left_j);
            let place = |agent| (self.world.body(agent).pose().position, energy_j(agent));
            self.standstill = Standstill { since: now, places: self.world.agents().map(place).collect() };
        }
    }

    /// Whether the team stands still, so that it will not see what is left.
    pub(in crate::session) fn stands_still(&self) -> bool {
        self.standstill.is_over(self.tick())
    }

    /// Whether a body has left its place or has been charged since the bodies were noted, or an
    /// agent waits for a time, or may go on by itself, or anything else may happen.
    fn has_any_moved(&self) -> bool {
        let now = self.tick();
        let end = self.scenario().duration_ticks().0.saturating_sub(1);
        let cell_m = self.world.terrain().extent().cell_m();
        let goes_on = |agent: AgentId| {
            let (place, energy_j) = self.standstill.places[agent.index()];
            let (body, wake) = (self.world.body(agent), self.wake_conditions[agent.index()]);
            let moved_m = (body.pose().position - place).norm();
            moved_m > STEP * body.model().radius_m.max(cell_m)
                || self.world.energy(agent).is_some_and(|energy| energy.left_j > energy_j)
                || self.stages[agent.index()].is_none()
                || (wake.at > now.after(WAIT_TICKS_MAX) && wake.at.0 < end)
        };
        let scenario = self.scenario();
        !self.schedule.is_empty()
            || !self.joining.is_empty()
            || !scenario.obstacle.is_empty()
            || !self.reserve().is_empty()
            || self.world.agents().filter(|&agent| self.takes_part(agent)).any(goes_on)
    }
}
