//! Re-execution: the part of a run that is known from its recording. The recorded replies take the
//! place of the agents.
//!
//! Invariants: what is written is what was written then; a recording that does not fit what comes
//! of the scenario here is not continued.

use std::ops::ControlFlow;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Intervention, MapChange, Observation as Fragment};

use super::agents::{Awaited, recorded_join};
use super::log::EntryKind;
use super::{EndReason, RunError, Session, timeout_policy};
use protocol::lockstep::{CommandReply, MissingReplies, ObservationRequest, Replies};
use protocol::observation::RequestKind;
use protocol::signed::Signed;
use recording::playback::{Ending, Playback, RecordedIntervention, RecordedTick};
use simulation::digest::Digest;
use simulation::scenario::OnAgentLoss;
use simulation::wire::{self, Change};
use transport::Level;
use world::Presence;

/// What a recording says of the present tick.
enum NextTick {
    /// These replies.
    Recorded(RecordedTick),
    /// Nothing more: the tick is the first that is executed live.
    Live,
    /// The run that is verified ends here, for this reason.
    End(EndReason),
}

impl Session<'_, '_> {
    /// Admits the recorded agents of a run that is verified. Breaks with the reason if it had no
    /// tick.
    pub(super) fn admit_recorded(&mut self) -> Result<ControlFlow<EndReason>, RunError> {
        let agents = self.engine.agents();
        let joins = self.playback.as_ref().map(Playback::joins).into_iter().flatten();
        let joins: Vec<(AgentId, String)> = joins.map(|(&agent, join)| (agent, join.controller.clone())).collect();
        let is_complete = joins.len() == agents;
        for (agent, controller) in joins.into_iter().filter(|(agent, _)| agent.index() < agents) {
            self.log.write(EntryKind::Join(agent), Tick::ZERO, &recorded_join(agent, controller))?;
        }
        // A run that was interrupted during admission has a tick without replies; one that failed
        // then has none.
        let ending = self.playback.as_ref().and_then(Playback::ending);
        match ending {
            _ if is_complete => Ok(ControlFlow::Continue(())),
            Some(Ending { reason, .. }) if reason.is_early() => Ok(ControlFlow::Continue(())),
            Some(Ending { reason, .. }) => Ok(ControlFlow::Break(reason.clone())),
            None => Ok(ControlFlow::Break(self.end_check())),
        }
    }

    /// Executes the recorded ticks. Continues with the first live tick executed, or breaks with the
    /// reason of the end.
    pub(super) fn re_execute(&mut self) -> Result<ControlFlow<EndReason>, RunError> {
        loop {
            self.record_state()?;
            let digest = self.engine.digest();
            self.apply_events()?;
            if let Some(reason) = self.end_of_run()? {
                return Ok(ControlFlow::Break(reason));
            }
            match self.recorded_tick(digest)? {
                NextTick::Recorded(recorded) => {
                    if self.tick(Some(recorded))?.is_break() {
                        return Ok(ControlFlow::Break(EndReason::Interrupted));
                    }
                    self.control.ticked();
                }
                NextTick::Live => {
                    if self.go_live()?.is_break() {
                        return Ok(ControlFlow::Break(EndReason::Interrupted));
                    }
                    // The state of this tick is recorded already.
                    self.transport.clock(self.engine.tick());
                    return self.advance();
                }
                NextTick::End(reason) => return Ok(ControlFlow::Break(reason)),
            }
        }
    }

    /// Looks up the present tick, before whose events the digest was `digest`, and repeats its
    /// interventions.
    fn recorded_tick(&mut self, digest: Digest) -> Result<NextTick, RunError> {
        let tick = self.engine.tick();
        let playback = self.playback.as_mut().expect("a recording is re-executed");
        let is_known = playback.covers(tick);
        let recorded = playback.read_tick(tick)?;
        if self.log.checker().is_some_and(|checker| checker.is_done()) {
            return Ok(NextTick::End(EndReason::Unknown));
        }
        let is_verified = self.log.checker().is_some();
        if let Some(before) = recorded.digest.filter(|before| !is_verified && *before != digest) {
            let reason =
                format!("the digest was {before} and is {digest}: the recording is of another build or scenario");
            return Err(RunError::OtherRun { tick, reason });
        }
        for intervention in &recorded.interventions {
            match intervention {
                RecordedIntervention::OfAgent(intervention) => self.repeat_intervention(intervention)?,
                RecordedIntervention::OfMap(change) => self.repeat_map_change(change)?,
            }
        }
        Ok(match (is_known, is_verified) {
            (true, _) => NextTick::Recorded(recorded),
            (false, true) => NextTick::End(self.end_recorded()?),
            (false, false) => NextTick::Live,
        })
    }

    /// Turns a resumed run live: the recording so far replaces the one that was read, and the
    /// agents replay their observation logs. Breaks if that is stopped.
    fn go_live(&mut self) -> Result<ControlFlow<()>, RunError> {
        let tick = self.engine.tick();
        self.playback = None;
        self.log.save_provisionally(self.transport.now())?;
        self.log.publish()?;
        self.note(Level::Info, &format!("re-executed up to tick {tick}; the run continues from there"));
        let mut replayed = self.replay_observation_logs()?;
        if replayed.is_continue() {
            // The processes of agents that have left before have nothing more to wait for.
            for agent in self.engine.retired().collect::<Vec<_>>() {
                self.dismiss(agent)?;
            }
        }
        if self.is_stopped() {
            replayed = ControlFlow::Break(());
        }
        let wall_ns = self.wall_ns();
        self.control.restart_pacing(tick, wall_ns);
        Ok(replayed)
    }

    /// Ends a verified run as its recording ends; returns the reason.
    fn end_recorded(&mut self) -> Result<EndReason, RunError> {
        let tick = self.engine.tick();
        let Some(Ending { reason, is_mid_tick }) = self.playback.as_ref().and_then(Playback::ending).cloned() else {
            return Ok(self.end_check());
        };
        if reason.is_complete() {
            let reason = format!("the run has ended there, for the reason `{reason}`, and continues here");
            return Err(RunError::OtherRun { tick, reason });
        }
        if is_mid_tick {
            self.engine.sense();
            // Without replies, only the agents that are due count as asked.
            let requests = self.requests(Some(&RecordedTick::default()));
            self.record_unanswered(&requests)?;
        }
        Ok(reason)
    }

    /// Ends the check of a recording without a result: it lacks what the end of a run writes.
    fn end_check(&mut self) -> EndReason {
        if let Some(checker) = self.log.checker() {
            checker.close();
        }
        EndReason::Unknown
    }

    fn repeat_intervention(&mut self, intervention: &Intervention) -> Result<(), RunError> {
        let tick = self.engine.tick();
        let agent = AgentId(intervention.agent);
        let misfit = |reason: String| RunError::OtherRun { tick, reason };
        if agent.index() >= self.engine.agents() {
            return Err(misfit(format!("an intervention names agent {agent}, which is not in the run")));
        }
        let is_absent = self.engine.world().presence(agent) == Presence::Absent;
        let done = match wire::change(intervention).map_err(misfit)? {
            Change::Join(_) if !is_absent => Err("it joins there, and is in the world or has left here"),
            Change::Join(pose) => self.engine.join(agent, pose, &mut self.log)?,
            Change::Place(pose) => self.engine.place(agent, pose, &mut self.log)?,
            Change::Remove => {
                self.engine.request(agent, RequestKind::Polled, Fragment::RUNNING);
                Ok(self.engine.remove(agent, &mut self.log)?)
            }
            Change::Leave => {
                self.engine.request(agent, RequestKind::Polled, Fragment::ENDED);
                Ok(self.engine.leave(agent, &mut self.log)?)
            }
        };
        done.map_err(|reason| misfit(format!("agent {agent}: {reason}")))
    }

    fn repeat_map_change(&mut self, change: &MapChange) -> Result<(), RunError> {
        let tick = self.engine.tick();
        let misfit = |reason: String| RunError::OtherRun { tick, reason };
        let extent = self.engine.world().terrain().extent();
        let (cells, terrain, _) = wire::map_change_of(change, extent).map_err(misfit)?;
        match self.engine.change_cells(cells, terrain, &mut self.log)? {
            Ok(0) => Err(misfit("a request has changed cells there, and none here".to_owned())),
            Ok(_) => Ok(()),
            Err(reason) => Err(misfit(format!("a change of the map: {reason}"))),
        }
    }

    /// The recorded replies of a tick, if they fit its requests. Agents that were lost then are
    /// lost here.
    pub(super) fn recorded_replies(
        &mut self,
        requests: &[ObservationRequest],
        mut recorded: RecordedTick,
    ) -> Result<Replies, RunError> {
        let tick = self.engine.tick();
        let misfit = |reason: String| RunError::OtherRun { tick, reason };
        let mut replies = Replies::new();
        for agent in requests.iter().map(|request| request.agent) {
            match recorded.commands.remove(&agent) {
                Some(message) => {
                    // What is recorded was verified before.
                    let reply = CommandReply::new(Signed::unsigned(message).trusted(), self.scenario.agents.count)
                        .map_err(|reason| misfit(format!("the command of agent {agent}: {reason}")))?;
                    replies.insert(agent, reply);
                }
                None if self.scenario.faults.on_agent_loss == OnAgentLoss::Drop => {
                    self.engine.lose(agent);
                }
                None => {
                    return Err(misfit(format!(
                        "the recording has no command of agent {agent}, which this run asks for"
                    )));
                }
            }
        }
        match recorded.commands.keys().next() {
            None => Ok(replies),
            Some(agent) => {
                Err(misfit(format!("the recording has a command of agent {agent}, which this run does not ask for")))
            }
        }
    }

    /// Replays the observation logs to the agents of a resumed run.
    fn replay_observation_logs(&mut self) -> Result<ControlFlow<()>, RunError> {
        // The interface of third-party agents has no observations to replay.
        let (tick, timeout) = (self.engine.tick(), self.reply_timeout());
        let sessions = self.agents.sessions_mut();
        for agent in self.engine.lost().chain(self.teleoperated.iter().copied()) {
            sessions.skip_replay(agent);
        }
        sessions.enter(tick);
        let policy = timeout_policy(self.scenario.faults.on_agent_loss);
        let (agents, mut context) = self.waiting();
        match agents.await_replies(timeout, policy, &mut context)? {
            Awaited::Answered(_) => Ok(ControlFlow::Continue(())),
            Awaited::Stopped(_) => Ok(ControlFlow::Break(())),
            Awaited::Incomplete(MissingReplies { missing: lost, .. }) => {
                Err(RunError::AgentsLost { lost, refused: None, tick, seconds: timeout.as_secs_f64() })
            }
        }
    }
}
