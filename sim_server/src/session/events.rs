//! The events of a scenario, executed at their ticks: live, and in the same way when a run is
//! re-executed.
//!
//! An event takes effect at the start of its tick, changes of the map after all others, after the
//! state of that tick was recorded and before interventions and scans. It enters the digest there,
//! so that a run and its fork are the same up to that tick.
//!
//! Invariants: an event is executed once; an agent receives a change in the first observation
//! that it commits to afterwards; an agent that is out is never asked again.

use msgs::ids::AgentId;
use msgs::maes_msgs::Observation as Fragment;

use super::{RunError, SHUTDOWN_TIMEOUT, Session};
use protocol::observation::RequestKind;
use simulation::scenario::EventAction;

impl Session<'_, '_> {
    /// Executes the events of the present tick.
    pub(super) fn apply_events(&mut self) -> Result<(), RunError> {
        while let Some(action) = self.engine.next_event() {
            match action {
                EventAction::Join(agent) => self.engine.expect_join(agent),
                EventAction::Leave(agent) => {
                    self.retire(agent)?;
                    self.engine.withdraw(agent);
                }
                EventAction::BreakDown(agent) => {
                    self.retire(agent)?;
                    self.engine.break_down(agent);
                }
                EventAction::SwitchRadio(agent, is_on) => self.engine.switch_radio(agent, is_on),
                EventAction::Set(scenario) => self.engine.change(*scenario, &self.teleoperated),
                // The engine has put it aside.
                EventAction::ChangeMap(_) => {}
            }
        }
        self.engine.change_map(&mut self.log)?;
        self.engine.admit_late();
        Ok(())
    }

    /// Takes an agent out of the run.
    fn retire(&mut self, agent: AgentId) -> Result<(), RunError> {
        if self.engine.retire(agent) {
            if self.playback.is_none() {
                self.dismiss(agent)?;
            } else {
                self.engine.request(agent, RequestKind::Polled, Fragment::ENDED);
            }
            self.engine.lose(agent);
        }
        Ok(())
    }

    /// Sends an agent the shutdown message during the run. The observation stays pending, so that
    /// the end of the recording holds what was never committed.
    pub(super) fn dismiss(&mut self, agent: AgentId) -> Result<(), RunError> {
        let last = [self.engine.request(agent, RequestKind::Polled, Fragment::ENDED)];
        let tick = self.engine.tick();
        let (agents, mut context) = self.waiting();
        agents.shut_down(tick, &last, SHUTDOWN_TIMEOUT, &mut context)?;
        agents.sessions_mut().leave(agent);
        Ok(())
    }
}
