//! The admission of a run: every id gets its process before the clock starts.

use std::ops::ControlFlow;
use std::time::Duration;

use msgs::ids::Tick;

use super::agents::POLL_PERIOD;
use super::control::Phase;
use super::log::EntryKind;
use super::{EndReason, RunError, Session};
use recording::playback::Playback;
use transport::Level;

impl Session<'_, '_> {
    /// Waits until every id has a process. Breaks with the reason if the run ends before its first
    /// tick.
    pub(super) fn admit(&mut self) -> Result<ControlFlow<EndReason>, RunError> {
        if self.log.checker().is_some() {
            return self.admit_recorded();
        }
        let seconds = self.scenario.execution.join_timeout_s;
        let deadline = self.transport.now() + Duration::from_secs_f64(seconds);
        loop {
            let missing = self.agents.sessions().missing();
            if missing.is_empty() {
                break;
            }
            if self.is_stopped() {
                return Ok(ControlFlow::Continue(()));
            }
            if self.transport.now() >= deadline {
                return Err(RunError::AgentsMissing { missing, seconds });
            }
            if let Some(other) = self.transport.other_run() {
                self.log.discard();
                return Err(RunError::OtherServer { other });
            }
            self.observer.waiting(&missing);
            if self.answer_requests(Phase::Admission)?.is_break() {
                return Ok(ControlFlow::Continue(()));
            }
            let (agents, mut context) = self.waiting();
            agents.listen(Tick::ZERO, POLL_PERIOD, &mut context)?;
        }
        self.check_controllers()?;
        for (agent, join) in self.agents.joins() {
            self.log.write(EntryKind::Join(agent), Tick::ZERO, &join)?;
        }
        if self.playback.is_none() {
            self.log.publish()?;
        }
        self.observer.started();
        let agents = self.scenario.agents.count;
        self.transport.log(Level::Info, &format!("the run begins with {agents} agents"));
        Ok(ControlFlow::Continue(()))
    }

    /// Fails if an agent of a resumed run runs another controller than in the recording.
    fn check_controllers(&self) -> Result<(), RunError> {
        let recorded = self.playback.as_ref().map(Playback::joins);
        for (agent, join) in self.agents.joins() {
            if let Some(before) = recorded.and_then(|joins| joins.get(&agent))
                && before.controller != join.controller
            {
                let before = before.controller.clone();
                return Err(RunError::OtherController { agent, before, now: join.controller });
            }
        }
        Ok(())
    }
}
