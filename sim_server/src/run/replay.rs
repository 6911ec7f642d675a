//! The part of a run that is known from its recording: the loop is the same, but nobody is asked.
//!
//! Invariants: what is written down is what was written down before; a recording that does not fit to what comes of the scenario
//! here is not gone on with.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::Duration;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::Intervention;

use super::exchange::{Answer, Asked, Meanwhile, Patience, recorded_join};
use super::log::Kind;
use super::{COVERED, DURATION, EXPLORED, INTERRUPTED, QUIT, Run, RunError};
use crate::link::Level;
use crate::playback::{Ending, Playback, RecordedTick};
use simulation::scenario::OnAgentLoss;
use simulation::wire;
use simulation::world::Since;

impl Run<'_> {
    /// Whether nobody is asked, because it is known what they have answered.
    pub(super) fn is_replaying(&self) -> bool {
        self.playback.is_some()
    }

    /// Fails if somebody runs something else than in the run that is to go on.
    pub(super) fn check_controllers(&self) -> Result<(), RunError> {
        let Some(playback) = &self.playback else { return Ok(()) };
        for (agent, join) in self.exchange.joins() {
            if let Some(before) = playback.joins().get(&agent)
                && before.controller != join.controller
            {
                let before = before.controller.clone();
                return Err(RunError::OtherController { agent, before, now: join.controller });
            }
        }
        Ok(())
    }

    /// Has those take part who took part in a run that is checked. Breaks with the reason if there was no tick.
    pub(super) fn admit_again(&mut self) -> Result<ControlFlow<String>, RunError> {
        let joins = self.playback.as_ref().map(Playback::joins).into_iter().flatten();
        let joins: Vec<(AgentId, String)> = joins.map(|(&agent, join)| (agent, join.controller.clone())).collect();
        let is_complete = joins.len() == self.wakes.len();
        for (agent, controller) in joins.into_iter().filter(|(agent, _)| agent.index() < self.wakes.len()) {
            self.log.write(Kind::Join(agent), Tick::ZERO, &recorded_join(agent, controller))?;
        }
        // A run that was ended while agents were awaited has a tick that was not made, and one that was given up has none.
        let ending = self.playback.as_ref().and_then(Playback::ending);
        match ending {
            _ if is_complete => Ok(ControlFlow::Continue(())),
            Some(Ending { reason, .. }) if [INTERRUPTED, QUIT].contains(&reason.as_str()) => {
                Ok(ControlFlow::Continue(()))
            }
            Some(Ending { reason, .. }) => Ok(ControlFlow::Break(reason.clone())),
            None => Ok(ControlFlow::Break(self.leave_off())),
        }
    }

    /// Looks up what was said in the present tick. From the first tick of which that is not known, the agents take part, once they
    /// have been told their past; breaks if the run is stopped meanwhile, or is checked, with the reason of its end.
    pub(super) fn replay(&mut self) -> Result<ControlFlow<String>, RunError> {
        let Some(playback) = &mut self.playback else {
            return Ok(ControlFlow::Continue(()));
        };
        let tick = self.world.tick();
        let is_known = playback.covers(tick);
        let said = playback.read_tick(tick)?;
        let is_checked = self.log.checker().is_some();
        if self.log.checker().is_some_and(|checker| checker.is_done()) {
            return Ok(ControlFlow::Break(String::new()));
        }
        if let Some(before) = said.digest
            && !is_checked
            && before != self.chain.digest()
        {
            let now = self.chain.digest();
            let reason = format!("the digest was {before} and is {now}: the recording is of another build or scenario");
            return Err(RunError::OtherRun { tick, reason });
        }
        for intervention in &said.interventions {
            self.intervene_again(intervention)?;
        }
        if is_known {
            self.said = Some(said);
            return Ok(ControlFlow::Continue(()));
        }
        if is_checked {
            return self.end_again().map(ControlFlow::Break);
        }
        self.playback = None;
        // It may take the place of the one that was read, now that it holds as much.
        self.log.save_provisionally()?;
        self.log.publish()?;
        self.note(Level::Info, &format!("carried out again up to tick {tick}; the run goes on from there"));
        let told = self.tell_past()?;
        self.desk.restart_pacing(tick, self.wall_ns());
        Ok(told.map_break(|()| INTERRUPTED.to_owned()))
    }

    /// Ends a run that is checked as it has ended; says why it has.
    fn end_again(&mut self) -> Result<String, RunError> {
        let tick = self.world.tick();
        let Some(Ending { reason, is_mid_tick }) = self.playback.as_ref().and_then(Playback::ending).cloned() else {
            return Ok(self.leave_off());
        };
        if [EXPLORED, COVERED, DURATION].contains(&reason.as_str()) {
            let reason = format!("the run has ended there, for the reason `{reason}`, and goes on here");
            return Err(RunError::OtherRun { tick, reason });
        }
        if is_mid_tick {
            self.world.look(&self.pool);
            // Nobody has answered, so that those only are asked who are due.
            self.said = Some(RecordedTick::default());
            let asked = self.ask();
            self.said = None;
            self.record_unanswered(&asked)?;
        }
        Ok(reason)
    }

    /// Ends the check of a recording without a result: what an end would add is not in it.
    fn leave_off(&mut self) -> String {
        if let Some(checker) = self.log.checker() {
            checker.close();
        }
        String::new()
    }

    /// Does to the run what was done to it then.
    fn intervene_again(&mut self, intervention: &Intervention) -> Result<(), RunError> {
        let tick = self.world.tick();
        let agent = AgentId(intervention.agent);
        let misfit = |reason: String| RunError::OtherRun { tick, reason };
        if agent.index() >= self.wakes.len() {
            return Err(misfit(format!("an intervention names agent {agent}, who does not take part")));
        }
        match wire::placement(intervention) {
            Some(pose) => self.place(agent, pose)?.map_err(|reason| misfit(format!("agent {agent}: {reason}"))),
            None => {
                self.world.observe(agent, Since::LastAsked);
                self.remove(agent)
            }
        }
    }

    /// What was answered, if it fits to who is asked. Who was lost then is lost.
    pub(super) fn answers_again(
        &mut self,
        asked: &[Asked],
        mut said: RecordedTick,
    ) -> Result<BTreeMap<AgentId, Answer>, RunError> {
        let tick = self.world.tick();
        let misfit = |reason: String| RunError::OtherRun { tick, reason };
        let mut answers = BTreeMap::new();
        for agent in asked.iter().map(|asked| asked.agent) {
            match said.commands.remove(&agent) {
                Some(message) => {
                    let (action, wake) = wire::command(&message, self.scenario.agents.count)
                        .map_err(|reason| misfit(format!("the command of agent {agent}: {reason}")))?;
                    answers.insert(agent, Answer { message, action, wake });
                }
                None if self.scenario.faults.on_agent_loss == OnAgentLoss::Drop => {
                    self.lost.insert(agent);
                }
                None => return Err(misfit(format!("agent {agent} is asked here, and has answered nothing there"))),
            }
        }
        match said.commands.keys().next() {
            None => Ok(answers),
            Some(agent) => Err(misfit(format!("agent {agent} has answered there, and is not asked here"))),
        }
    }

    /// Tells the agents what they have observed so far.
    fn tell_past(&mut self) -> Result<ControlFlow<()>, RunError> {
        // Who is driven by standard messages has no protocol by which it could be told.
        for &agent in self.lost.iter().chain(&self.driven) {
            self.exchange.excuse(agent);
        }
        let limit = Duration::from_secs_f64(self.answer_timeout_s());
        let tick = self.world.tick();
        let patience = Patience::of(self.scenario.faults.on_agent_loss);
        let mut meanwhile = Meanwhile { watcher: self.watcher, log: &mut self.log, stop: self.stop };
        match self.exchange.ask(tick, &[], limit, patience, &mut meanwhile)? {
            Ok(_) => Ok(ControlFlow::Continue(())),
            Err(_) if self.is_stopped() => Ok(ControlFlow::Break(())),
            Err(silence) => Err(RunError::AgentsLost { lost: silence.silent, tick, seconds: limit.as_secs_f64() }),
        }
    }
}
