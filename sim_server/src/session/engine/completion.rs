//! When a team is done: nothing more can be seen, or all are back in their bases.

use msgs::ids::AgentId;
use protocol::stage::Stage;

use super::Engine;

/// Share of the free cells with which the time until the team is home is taken.
const EXPLORED_ENOUGH: f64 = 0.99;

/// Time in its bases after which a team without a goal has come back for good.
const WAITED_TICKS: u64 = 500;

impl Engine<'_> {
    /// Whether all agents rest and nothing more can be seen from where their bodies can be, with no
    /// event ahead that could change it. Call [`Engine::flush_scans`] before.
    pub(in crate::session) fn can_see_nothing_more(&mut self) -> bool {
        let rests =
            |agent: AgentId| self.stages[agent.index()] == Some(Stage::Waiting) && !self.world.body(agent).is_active();
        let is_team_at_rest = || self.world.agents().filter(|&agent| self.takes_part(agent)).all(rests);
        if !(self.schedule.is_empty() && self.joining.is_empty() && is_team_at_rest()) {
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
    /// more can be seen. Call [`Engine::flush_scans`] before.
    pub(in crate::session) fn is_known_at_base(&mut self) -> bool {
        let coverage = self.world.coverage();
        let (explored, is_explored) = (coverage.explored_count(), coverage.is_explored());
        let has_all = coverage.known_at_base_count().is_some_and(|known| known >= explored);
        has_all && (is_explored || self.can_see_nothing_more())
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
        self.schedule.is_empty() && self.joining.is_empty() && is_over
    }
}
