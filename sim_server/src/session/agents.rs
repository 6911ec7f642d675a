//! The agents over a transport: drives the [protocol](AgentSessions) with the messages and the time
//! of the transport, sends what it wants to send, and attends to the other duties of the session
//! while it waits.
//!
//! Invariant: every wait ends with the protocol or with the stop flag.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Join, Scenario};
use protocol::limits::RECORDED_PROTOCOL;

use super::log::SessionLog;
use super::{Phase, PhaseTimes, RunError, RunObserver};
use protocol::lockstep::{
    AgentSessions, Event, MissingReplies, ObservationRequest, Replies, TimeoutPolicy, Transmit, listed,
};
use recording::difference;
use recording::recorder::RecordError;
use transport::{Level, Transport};

/// Wall time for which the session waits for a message before it attends to its other duties.
pub(super) const POLL_PERIOD: Duration = Duration::from_millis(50);

/// The same at least, when a timer expires before that.
const POLL_PERIOD_MIN: Duration = Duration::from_millis(1);

/// What the session attends to while it waits for messages.
pub(super) struct WaitContext<'a, 's> {
    /// The start of the session, from which the protocol counts its time.
    pub(super) begun: Instant,
    pub(super) transport: &'a mut dyn Transport,
    pub(super) observer: &'a mut dyn RunObserver,
    /// Runs while `/sim/info` has subscribers.
    pub(super) phase_times: &'a mut PhaseTimes,
    pub(super) log: &'a mut SessionLog<'s>,
    pub(super) stop: &'a AtomicBool,
}

impl WaitContext<'_, '_> {
    /// Reports the end of a phase of the loop.
    pub(super) fn end_phase(&mut self, phase: Phase, tick: Tick) {
        self.observer.phase_ended(phase, tick);
        if self.phase_times.is_running() {
            self.phase_times.end(phase, self.transport.now());
        }
    }

    /// Called between two messages: whether to wait further.
    fn poll(&mut self) -> Result<bool, RecordError> {
        self.log.save_if_due(self.transport.now())?;
        Ok(!self.stop.load(Ordering::Relaxed))
    }

    fn warn(&mut self, text: &str) {
        self.observer.note(Level::Warn, text);
        self.transport.log(Level::Warn, text);
    }

    /// The time of the protocol.
    fn now(&self) -> Duration {
        self.transport.now().duration_since(self.begun)
    }
}

/// What came of a wait for replies.
#[derive(Debug)]
pub(super) enum Awaited {
    /// Every reply is in.
    Answered(Replies),
    /// The timeout has passed.
    Incomplete(MissingReplies),
    /// The stop flag was set before.
    Stopped(MissingReplies),
}

/// The agents of a run.
pub(super) struct Agents {
    sessions: AgentSessions,
}

impl Agents {
    pub(super) fn new(sessions: AgentSessions) -> Self {
        Self { sessions }
    }

    /// The protocol, to be read.
    pub(super) fn sessions(&self) -> &AgentSessions {
        &self.sessions
    }

    /// The protocol, for what needs no transport.
    pub(super) fn sessions_mut(&mut self) -> &mut AgentSessions {
        &mut self.sessions
    }

    /// Announces this run.
    pub(super) fn announce(&mut self, scenario: &Scenario, transport: &mut dyn Transport) {
        let announced = self.sessions.announce(scenario, transport.is_open());
        transport.announce(&announced);
    }

    /// The granted joins, as they are recorded.
    pub(super) fn joins(&self) -> impl Iterator<Item = (AgentId, Join)> + '_ {
        self.sessions.controllers().map(|(agent, controller)| (agent, recorded_join(agent, controller.to_owned())))
    }

    /// Handles one message while no reply is awaited, or waits for one up to `wait`; `tick` is the
    /// next tick.
    ///
    /// # Errors
    /// If the recording cannot be saved meanwhile, or a replayed agent diverges.
    pub(super) fn listen(
        &mut self,
        tick: Tick,
        wait: Duration,
        context: &mut WaitContext<'_, '_>,
    ) -> Result<(), RunError> {
        self.sessions.enter(tick);
        if context.poll()?
            && let Some(incoming) = context.transport.receive(wait.min(POLL_PERIOD))
        {
            self.sessions.handle(incoming, context.now());
            self.attend(context)?;
        }
        Ok(())
    }

    /// Asks an agent for its command of the present tick, so that it works on that while the
    /// session prepares other requests.
    pub(super) fn request(&mut self, request: &ObservationRequest, transport: &mut dyn Transport) {
        self.sessions.request(request);
        self.transmit(transport);
    }

    /// Waits until all requests of the tick have a reply and every replaced process has replayed
    /// its observation log.
    ///
    /// # Errors
    /// If the recording cannot be saved meanwhile, or a replayed agent diverges.
    pub(super) fn await_replies(
        &mut self,
        timeout: Duration,
        policy: TimeoutPolicy,
        context: &mut WaitContext<'_, '_>,
    ) -> Result<Awaited, RunError> {
        self.sessions.await_replies(context.now(), timeout, policy);
        self.transmit(context.transport);
        let tick = self.sessions.tick();
        context.end_phase(Phase::Send, tick);
        self.wait(context)
    }

    /// Sends the shutdown message to agents, and waits up to `timeout` for their acknowledgements.
    ///
    /// # Errors
    /// If the recording cannot be saved meanwhile.
    pub(super) fn shut_down(
        &mut self,
        tick: Tick,
        last: &[ObservationRequest],
        timeout: Duration,
        context: &mut WaitContext<'_, '_>,
    ) -> Result<(), RunError> {
        let can_answer = |request: &&ObservationRequest| !context.transport.is_gone(request.agent);
        let last: Vec<ObservationRequest> = last.iter().filter(can_answer).cloned().collect();
        self.sessions.shut_down(tick, &last, context.now(), timeout);
        self.transmit(context.transport);
        context.end_phase(Phase::Send, tick);
        if let Awaited::Incomplete(MissingReplies { missing, .. }) | Awaited::Stopped(MissingReplies { missing, .. }) =
            self.wait(context)?
        {
            let missing = listed(missing);
            context.warn(&format!("no acknowledgement of the shutdown message from: {missing}"));
        }
        Ok(())
    }

    /// Receives until the protocol awaits nothing more. The timers are looked after between any two
    /// messages, so that a flood postpones neither the timeout nor the other agents.
    fn wait(&mut self, context: &mut WaitContext<'_, '_>) -> Result<Awaited, RunError> {
        loop {
            if let Some(awaited) = self.attend(context)? {
                return Ok(awaited);
            }
            let until = self.sessions.poll_timeout().unwrap_or_default();
            let patience = until.saturating_sub(context.now()).clamp(POLL_PERIOD_MIN, POLL_PERIOD);
            if let Some(incoming) = context.transport.receive(patience) {
                self.sessions.handle(incoming, context.now());
                if let Some(awaited) = self.attend(context)? {
                    return Ok(awaited);
                }
            }
            if !context.poll()? {
                return Ok(Awaited::Stopped(self.sessions.abandon()));
            }
            self.sessions.handle_timeout(context.now());
        }
    }

    /// Sends what is to be sent, and passes on what has happened.
    fn attend(&mut self, context: &mut WaitContext<'_, '_>) -> Result<Option<Awaited>, RunError> {
        self.transmit(context.transport);
        while let Some(event) = self.sessions.poll_event() {
            match event {
                Event::Answered(replies) => return Ok(Some(Awaited::Answered(replies))),
                Event::TimedOut(missing) => return Ok(Some(Awaited::Incomplete(missing))),
                Event::Diverged { agent, tick, recorded, given } => {
                    let what = difference::between(&*recorded, &*given);
                    let what = what.map_or_else(String::new, |field| field.to_string());
                    return Err(RunError::Diverged { agent, tick, what });
                }
                Event::Notice(notice) => context.warn(&notice.to_string()),
            }
        }
        Ok(None)
    }

    fn transmit(&mut self, transport: &mut dyn Transport) {
        while let Some(message) = self.sessions.poll_transmit() {
            match message {
                Transmit::JoinReply(reply) => transport.reply_join(&reply),
                Transmit::Observation(agent, fragment) => transport.send(agent, fragment),
            }
        }
    }
}

/// The join of an agent as it is recorded: without what identifies its process.
pub(super) fn recorded_join(agent: AgentId, controller: String) -> Join {
    Join { run: 0, agent: agent.0, instance: 0, protocol: RECORDED_PROTOCOL, controller, last_tick: Join::NONE }
}
