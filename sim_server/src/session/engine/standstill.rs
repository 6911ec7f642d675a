//! A team that stands still: for long no body has left its place, and no agent waits for a time.
//!
//! Agents that wait for each other, or that see less from where they can be than the world would
//! show them, would do so until the duration is over. Small steps do not count, since bodies that
//! block each other make them for ever.
//!
//! Agents that name no stage, as nodes of users that know nothing of stages, may go on whenever
//! they like: a team with one of them never stands still.

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;

use super::Engine;

/// Time for which no body has left its place: 5 min.
const STANDSTILL_TICKS: u64 = 15_000;

/// How often the bodies are checked: once a second.
const CHECK_PERIOD_TICKS: u64 = 50;

/// Longest wait of an agent that rests before a body in its way: 2 min. One that waits longer, but
/// not until the end of the run, waits for a time; shorter waits that are repeated for ever are
/// part of a standstill.
const WAIT_TICKS_MAX: u64 = 6000;

/// A body has left its place beyond so many times its radius, or the edge of a cell if that is
/// more.
const PLACE_RADII: f64 = 2.0;

/// What the team was like, and since when it has been so.
#[derive(Debug, Default)]
pub(super) struct Standstill {
    since: Tick,
    /// By agent: the position and the energy, metres and J.
    places: Vec<(Point3<f64>, f64)>,
    /// Cells that a base station knew.
    known_at_base: Option<usize>,
}

impl Engine<'_> {
    /// Notes where the bodies are, for [`Engine::stands_still`]. Call it in every tick, and
    /// [`Engine::note_explored`] before.
    pub(in crate::session) fn note_places(&mut self) {
        let now = self.tick();
        if !now.0.is_multiple_of(CHECK_PERIOD_TICKS) {
            return;
        }
        if self.standstill.places.is_empty() || self.is_anything_going_on() {
            let energy_j = |agent| self.world.energy(agent).map_or(0.0, |energy| energy.left_j);
            let place = |agent| (self.world.body(agent).pose().position, energy_j(agent));
            let places = self.world.agents().map(place).collect();
            let known_at_base = self.world.coverage().known_at_base_count();
            self.standstill = Standstill { since: now, places, known_at_base };
        }
    }

    /// Whether the team stands still, so that it will not see what is left: for five minutes, or
    /// for twice the time in which its slowest body can leave its place.
    pub(in crate::session) fn stands_still(&self) -> bool {
        let Standstill { since, places, .. } = &self.standstill;
        if places.is_empty() || self.tick() < since.after(STANDSTILL_TICKS) {
            return false;
        }
        let leaving_s = |agent: AgentId| self.place_m(agent) / self.world.body(agent).model().speed_max_m_s;
        let slowest_s = self.world.agents().map(leaving_s).fold(0.0, f64::max);
        self.tick() >= since.after((2.0 * slowest_s / Tick::TICK_S) as u64)
    }

    /// How far from where it was a body is still in its place, metres.
    fn place_m(&self, agent: AgentId) -> f64 {
        let cell_m = self.world.terrain().extent().cell_m();
        PLACE_RADII * self.world.body(agent).model().radius_m.max(cell_m)
    }

    /// Whether a body has left its place or has been charged since the bodies were noted, an
    /// obstacle has moved or will, cells have been seen or have become known at a base, an agent
    /// waits for a time or may go on by itself, or an event is ahead.
    fn is_anything_going_on(&self) -> bool {
        let now = self.tick();
        let end = self.scenario().duration_ticks().0.saturating_sub(1);
        let goes_on = |agent: AgentId| {
            let (place, energy_j) = self.standstill.places[agent.index()];
            let (body, wake) = (self.world.body(agent), self.wake_conditions[agent.index()]);
            (body.pose().position - place).norm() > self.place_m(agent)
                || self.world.energy(agent).is_some_and(|energy| energy.left_j > energy_j)
                || self.stages[agent.index()].is_none()
                || (wake.at > now.after(WAIT_TICKS_MAX) && wake.at.0 < end)
        };
        let (_, last_new) = self.last_new;
        last_new > self.standstill.since
            || self.standstill.known_at_base != self.world.coverage().known_at_base_count()
            || self.is_event_ahead()
            || self.world.have_obstacles_moved_since(self.standstill.since)
            || !self.reserve().is_empty()
            || self.world.agents().filter(|&agent| self.takes_part(agent)).any(goes_on)
    }
}
