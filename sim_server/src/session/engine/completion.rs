//! When a team is done: nothing more can be seen, or all are back in their bases.

use msgs::ids::AgentId;
use protocol::stage::Stage;

use super::Engine;

/// Share of the free cells with which the time until the team is home is taken.
const EXPLORED_ENOUGH: f64 = 0.99;

/// Time without a new cell after which a team that does not rest has nothing more to see, if no
/// cell can be seen: 1 min.
const NOTHING_NEW_TICKS: u64 = 3000;

/// Time in its bases after which a team without a goal has come back for good.
const WAITED_TICKS: u64 = 500;

impl Engine<'_> {
    /// Notes what the team has seen, for [`Engine::can_see_nothing_more`]. Call it in every tick,
    /// and [`Engine::flush_scans`] before.
    pub(in crate::session) fn note_explored(&mut self) {
        let explored = self.world.coverage().explored_count();
        if self.last_new.0 != explored {
            self.last_new = (explored, self.tick());
        }
    }

    /// Whether nothing more can be seen from where the bodies of the team can be, with no event
    /// ahead that could change it, and all agents rest or have seen nothing new for long. Call
    /// [`Engine::flush_scans`] before.
    pub(in crate::session) fn can_see_nothing_more(&mut self) -> bool {
        let rests =
            |agent: AgentId| self.stages[agent.index()] == Some(Stage::Waiting) && !self.world.body(agent).is_active();
        let is_team_at_rest = || self.world.agents().filter(|&agent| self.takes_part(agent)).all(rests);
        let (_, last_new) = self.last_new;
        // A door may open before a body that comes near, and a reserve may be sent elsewhere.
        let is_nothing_ahead = self.map_changes.is_empty() && self.reserve().is_empty();
        let is_nothing_new = is_nothing_ahead && self.tick() >= last_new.after(NOTHING_NEW_TICKS);
        if self.is_event_ahead() || !(is_nothing_new || is_team_at_rest()) {
            return false;
        }
        let explored = self.world.coverage().explored_count();
        if self.rested_at == Some(explored) {
            return false;
        }
        self.rested_at = Some(explored);
        !self.world.is_anything_left()
    }

    /// Whether a base station knows every free cell, or all that the team has seen while nothing
    /// more can be seen, if `is_enough` says that this ends the run. Call [`Engine::flush_scans`]
    /// before.
    pub(in crate::session) fn is_known_at_base(&mut self, is_enough: bool) -> bool {
        let coverage = self.world.coverage();
        let (explored, is_explored) = (coverage.explored_count(), coverage.is_explored());
        let has_all = coverage.known_at_base_count().is_some_and(|known| known >= explored);
        has_all && (is_explored || (is_enough && self.can_see_nothing_more()))
    }

    /// Whether the whole team has come back to its bases for good: all is explored, or all agents
    /// have waited there, and no event is ahead. Notes the first time with [`EXPLORED_ENOUGH`].
    pub(in crate::session) fn is_team_back(&mut self) -> bool {
        if self.scenario.energy.is_none() {
            return false;
        }
        let mut team = self.world.agents().filter(|&agent| self.world.presence(agent).is_in_world()).peekable();
        if team.peek().is_none() || !team.all(|agent| self.world.is_home(agent)) {
            self.waiting_since = None;
            return false;
        }
        self.flush_scans();
        let is_explored = self.world.coverage().is_explored();
        if self.world.coverage().explored() >= EXPLORED_ENOUGH {
            self.world.note_team_is_home();
        }
        let waits = |agent: AgentId| self.stages[agent.index()] == Some(Stage::Waiting);
        let tick = self.tick();
        let do_all_wait = self.world.agents().filter(|&agent| self.takes_part(agent)).all(waits);
        self.waiting_since = do_all_wait.then(|| self.waiting_since.unwrap_or(tick));
        let is_over = is_explored || self.waiting_since.is_some_and(|since| tick >= since.after(WAITED_TICKS));
        !self.is_event_ahead() && is_over
    }

    /// Whether something is still to come at a time: an event, or an agent that joins late.
    pub(super) fn is_event_ahead(&self) -> bool {
        !self.schedule.is_empty() || !self.joining.is_empty()
    }
}
