//! The server's sessions with the agents: observation requests go out, are resent while unanswered,
//! and legal replies come in.
//!
//! Invariants: a refused message changes nothing but its counter; a resent observation changes
//! nothing, because a tick has one reply; every wait is bounded by a timeout or ends with the stop
//! flag; recorded messages carry no run number: it is added when a message is sent and removed when
//! one is received.

mod authentication;
mod inbound;
mod observation_log;
mod resend_timer;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use msgs::limits::{PROTOCOL, RECORDED_PROTOCOL};
use msgs::maes_msgs::{Command, Join, Observation as Fragment, Scenario, SignedJoin};
use msgs::scan_request::ScanRequest;
use msgs::trigger::Trigger;

use super::log::SessionLog;
use super::{JoinPolicy, Phase, PhaseTimes, RunError, RunObserver, RunStart};
use crate::recorder::RecordError;
use crate::transport::{AgentTransport, Level, Transport};
use authentication::Authentication;
pub(super) use authentication::with_external;
use observation_log::ObservationLog;
use resend_timer::ResendTimer;
use simulation::lockstep::{Barrier, Membership, Refusal, SourceId, listed};
use simulation::scenario::OnAgentLoss;
use simulation::world::body::Motion;
use simulation::world::{Action, Commit};

/// Wall time for which the session waits for a message before it attends to its other duties.
pub(super) const POLL_PERIOD: Duration = Duration::from_millis(50);

/// The same at least, when a resend is due before that.
const POLL_PERIOD_MIN: Duration = Duration::from_millis(1);

/// Longest wall time between two polls that counts towards a timeout. A longer gap means that this
/// process was stopped, for which no agent is to blame.
const POLL_GAP_MAX: Duration = Duration::from_millis(200);

/// Wall time in which a process that repeats its join is not answered again: the reply is on its
/// way, to all processes. A large team that is answered more often than they can receive never
/// starts.
const REPLY_PERIOD: Duration = Duration::from_millis(900);

/// Refusals of one kind that are reported; further ones are only counted, because an agent may
/// flood.
const REFUSAL_REPORTS_MAX: u64 = 5;

/// An observation that awaits a command.
#[derive(Debug, Clone)]
pub(super) struct ObservationRequest {
    pub(super) agent: AgentId,
    /// Whether the agent is due, or is asked out of turn.
    pub(super) since: Commit,
    pub(super) fragments: Vec<Fragment>,
}

/// A legal command.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CommandReply {
    /// As received.
    pub(super) message: Command,
    pub(super) action: Action,
    /// When the agent is due next.
    pub(super) trigger: Trigger,
}

impl CommandReply {
    /// Whether the run would be the same without it.
    pub(super) fn is_no_op(&self) -> bool {
        let Action { motion, lidar, want_view, messages } = &self.action;
        *motion == Motion::Keep
            && *lidar == ScanRequest::Keep
            && !want_view
            && messages.is_empty()
            && self.message.stage == Command::SAME
            && self.message.info.is_empty()
    }
}

/// The replies of a tick, by agent.
pub(super) type Replies = BTreeMap<AgentId, CommandReply>;

/// What follows when a reply is overdue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TimeoutPolicy {
    /// The request returns without the missing replies; the scenario decides between abort and
    /// drop.
    ReturnIncomplete,
    /// The clock is held until another process replaces the one that does not reply.
    Hold,
}

impl TimeoutPolicy {
    pub(super) fn of(on_agent_loss: OnAgentLoss) -> Self {
        match on_agent_loss {
            OnAgentLoss::Wait => Self::Hold,
            OnAgentLoss::Abort | OnAgentLoss::Drop => Self::ReturnIncomplete,
        }
    }
}

/// The outcome of a request that timed out or was stopped.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MissingReplies {
    pub(super) received: Replies,
    /// Agents without a reply, ascending.
    pub(super) missing: Vec<AgentId>,
}

/// What the session attends to while it waits for messages.
pub(super) struct WaitContext<'a, 's> {
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
        self.observer.note(text);
        self.transport.log(Level::Warn, text);
    }
}

/// The sessions of all agents of a run.
pub(super) struct AgentSessions {
    /// Distinguishes messages of this run from those of others. Neither the recording nor the
    /// digest holds it.
    start: RunStart,
    agents: u32,
    membership: Membership,
    authentication: Authentication,
    last_commands: Vec<Option<Command>>,
    /// By agent: how many retransmits of its last command are accepted, because its observation was
    /// resent so often.
    retransmits_due: Vec<u32>,
    /// Agents of which a reply to the last observation may still arrive: it is no longer awaited,
    /// or the observation was resent. It may cross the shutdown message and be taken for its
    /// acknowledgement, which then is a second answer.
    abandoned: BTreeSet<AgentId>,
    refusals: BTreeMap<&'static str, u64>,
    observation_log: ObservationLog,
    /// Whether another process may replace one that does not reply.
    allows_replacement: bool,
    /// Agents whose process is given up.
    unresponsive: BTreeSet<AgentId>,
    /// Joins for ids that another process holds, and the tick in which they arrived.
    contenders: BTreeMap<AgentId, (Tick, SourceId, SignedJoin)>,
    /// Agents whose process was replaced after it had answered the present tick: the new process
    /// does not know that reply.
    answered_by_predecessor: BTreeSet<AgentId>,
    /// Agents to which an observation may have to be sent.
    to_prompt: BTreeSet<AgentId>,
    /// Agents that have got the request of the present tick already.
    sent_ahead: BTreeSet<AgentId>,
    /// By agent: the instance that was accepted last, and when the reply was sent.
    replied: BTreeMap<AgentId, (u64, Instant)>,
    /// The instances of processes that have started themselves again: they stalled.
    restarted: BTreeSet<u64>,
    /// An agent that answered a replayed observation differently: agent, tick, and the difference.
    divergence: Option<(AgentId, Tick, String)>,
    resend_timer: ResendTimer,
}

impl AgentSessions {
    pub(super) fn new(
        start: RunStart,
        policy: JoinPolicy,
        agents: u32,
        keeps_log: bool,
        allows_replacement: bool,
    ) -> Self {
        Self {
            start,
            agents,
            membership: Membership::new(agents),
            authentication: Authentication::new(policy, &start, agents),
            last_commands: vec![None; agents as usize],
            retransmits_due: vec![0; agents as usize],
            abandoned: BTreeSet::new(),
            refusals: Refusal::COUNTERS.into_iter().map(|name| (name, 0)).collect(),
            observation_log: ObservationLog::new(agents, keeps_log),
            allows_replacement,
            unresponsive: BTreeSet::new(),
            contenders: BTreeMap::new(),
            answered_by_predecessor: BTreeSet::new(),
            to_prompt: BTreeSet::new(),
            sent_ahead: BTreeSet::new(),
            replied: BTreeMap::new(),
            restarted: BTreeSet::new(),
            divergence: None,
            resend_timer: ResendTimer::default(),
        }
    }

    /// Announces this run.
    pub(super) fn announce(&mut self, scenario: &Scenario, transport: &mut (impl AgentTransport + ?Sized)) {
        let (run, origin) = (self.start.run(), self.start.origin);
        let announced = Scenario { protocol: PROTOCOL, run, origin, ..scenario.clone() };
        self.authentication.announce(&announced, transport.is_open());
        transport.announce(&announced);
    }

    /// The controller of each agent, by agent; empty where none has joined.
    pub(super) fn controllers(&self) -> Vec<String> {
        let label =
            |agent| self.membership.lease(AgentId(agent)).map(|lease| lease.controller.clone()).unwrap_or_default();
        (0..self.agents).map(label).collect()
    }

    /// Ids without a process, ascending.
    pub(super) fn missing(&self) -> Vec<AgentId> {
        self.membership.missing()
    }

    /// The granted joins, as they are recorded.
    pub(super) fn joins(&self) -> impl Iterator<Item = (AgentId, Join)> + '_ {
        (0..self.agents)
            .map(AgentId)
            .filter_map(|agent| Some((agent, recorded_join(agent, self.membership.lease(agent)?.controller.clone()))))
    }

    /// Processes that have joined after they had started themselves again.
    pub(super) fn restarted(&self) -> usize {
        self.restarted.len()
    }

    /// Counters of refusals by name.
    pub(super) fn refusals(&self) -> impl Iterator<Item = (&'static str, u64)> + '_ {
        let count = |name| (name, self.refusals.get(name).copied().unwrap_or_default());
        let always = Refusal::COUNTERS.into_iter().map(count);
        always.chain(Refusal::COUNTERS_IF_ANY.into_iter().map(count).filter(|(_, count)| *count > 0))
    }

    /// Handles one message while no reply is awaited, or waits for one up to `wait`; `tick` is the
    /// next tick.
    pub(super) fn listen(
        &mut self,
        tick: Tick,
        wait: Duration,
        context: &mut WaitContext<'_, '_>,
    ) -> Result<(), RecordError> {
        if context.poll()?
            && let Some(incoming) = context.transport.receive(wait.min(POLL_PERIOD))
        {
            self.handle(incoming, &mut Barrier::new(tick, BTreeSet::new()), context);
        }
        Ok(())
    }

    /// See [`ObservationLog::append`]; a process that has replaced the one that answered does not
    /// know the reply.
    pub(super) fn append(&mut self, agent: AgentId, fragments: Vec<Fragment>, reply: &Command, is_known: bool) {
        let is_known = is_known && !self.answered_by_predecessor.contains(&agent);
        self.observation_log.append(agent, fragments, reply, is_known);
    }

    /// See [`ObservationLog::skip`].
    pub(super) fn skip_log(&mut self, agent: AgentId) {
        self.observation_log.skip(agent);
    }

    /// Sends a request while others of the tick are still prepared, so that the agent decides
    /// meanwhile. [`AgentSessions::request_commands`] for all of them follows.
    pub(super) fn send_ahead(&mut self, request: &ObservationRequest, transport: &mut (impl AgentTransport + ?Sized)) {
        let ObservationRequest { agent, fragments, .. } = request;
        // A replay comes first.
        if self.observation_log.next(*agent).is_none() {
            self.send(*agent, fragments, transport);
            self.sent_ahead.insert(*agent);
        }
    }

    fn send(&self, agent: AgentId, fragments: &[Fragment], transport: &mut (impl AgentTransport + ?Sized)) {
        let run = self.start.run();
        for fragment in fragments {
            transport.send_signed(agent, self.authentication.sign(agent, Fragment { run, ..fragment.clone() }));
        }
    }

    /// Sends the requests, and waits until all have a reply and every replaced process has replayed
    /// its observation log; resends what stays unanswered. Replies are missing if `timeout` of wall
    /// time has passed and the policy is to fail, or if the wait was stopped.
    ///
    /// # Errors
    /// If the recording cannot be saved meanwhile, or a replayed agent diverges.
    pub(super) fn request_commands(
        &mut self,
        tick: Tick,
        requests: &[ObservationRequest],
        timeout: Duration,
        policy: TimeoutPolicy,
        context: &mut WaitContext<'_, '_>,
    ) -> Result<Result<Replies, MissingReplies>, RunError> {
        let mut barrier = Barrier::new(tick, requests.iter().map(|request| request.agent).collect());
        self.answered_by_predecessor.clear();
        self.to_prompt = &self.awaited(&barrier) - &std::mem::take(&mut self.sent_ahead);
        self.prompt(requests, &barrier, context.transport);
        context.end_phase(Phase::Send, tick);
        let mut last_poll = context.transport.now();
        let mut waited = Duration::ZERO;
        let first_interval = self.resend_timer.first();
        let (mut interval, mut resend_at) = (first_interval, first_interval);
        let (mut is_first_wait, mut is_resent) = (!requests.is_empty(), false);
        while self.is_waiting(&barrier) {
            let patience = resend_at.saturating_sub(waited).clamp(POLL_PERIOD_MIN, POLL_PERIOD);
            if let Some(incoming) = context.transport.receive(patience) {
                self.handle(incoming, &mut barrier, context);
            }
            if let Some((agent, tick, what)) = self.divergence.take() {
                return Err(RunError::Diverged { agent, tick, what });
            }
            if !self.to_prompt.is_empty() {
                // A replayed agent has made progress: the others have been waiting for it, so the
                // timeout starts anew.
                (waited, interval, resend_at) = (Duration::ZERO, first_interval, first_interval);
                is_first_wait = false;
                self.prompt(requests, &barrier, context.transport);
            }
            if !self.is_waiting(&barrier) {
                break;
            }
            // Checked after every message, so that a flood postpones neither the timeout nor the
            // other agents.
            let polled = context.transport.now();
            waited += polled.duration_since(last_poll).min(POLL_GAP_MAX);
            last_poll = polled;
            let has_failed = waited >= timeout && policy == TimeoutPolicy::ReturnIncomplete;
            if has_failed || !context.poll()? {
                self.abandoned = self.awaited(&barrier);
                let missing = self.abandoned.iter().copied().collect();
                return Ok(Err(MissingReplies { received: barrier.into_answers_so_far(), missing }));
            }
            if waited >= timeout {
                self.mark_replaceable(&self.awaited(&barrier), timeout, context);
            }
            if waited >= resend_at {
                interval = ResendTimer::next(interval);
                resend_at = waited + interval;
                (is_first_wait, is_resent) = (false, true);
                self.to_prompt = self.awaited(&barrier);
                for agent in &self.to_prompt {
                    self.retransmits_due[agent.index()] += 1;
                }
                self.prompt(requests, &barrier, context.transport);
            }
        }
        if is_first_wait {
            let since_poll = context.transport.now().duration_since(last_poll).min(POLL_GAP_MAX);
            self.resend_timer.note(waited + since_poll);
        } else if is_resent {
            self.resend_timer.note_resent();
        }
        Ok(Ok(barrier.into_answers()))
    }

    fn is_waiting(&self, barrier: &Barrier<CommandReply>) -> bool {
        !barrier.is_complete() || self.observation_log.replaying().next().is_some()
    }

    fn awaited(&self, barrier: &Barrier<CommandReply>) -> BTreeSet<AgentId> {
        barrier.missing().chain(self.observation_log.replaying()).collect()
    }

    /// Sends to each agent of `to_prompt` its next replayed observation, or else the present one;
    /// `requests` ascend by agent.
    fn prompt(
        &mut self,
        requests: &[ObservationRequest],
        barrier: &Barrier<CommandReply>,
        transport: &mut (impl AgentTransport + ?Sized),
    ) {
        for agent in std::mem::take(&mut self.to_prompt) {
            let present = || {
                let place = requests.binary_search_by_key(&agent, |request| request.agent).ok()?;
                barrier.awaits(agent).then(|| &requests[place])
            };
            if let Some(fragments) = self.observation_log.next(agent) {
                self.send(agent, fragments, transport);
            } else if let Some(request) = present() {
                self.send(agent, &request.fragments, transport);
            }
        }
    }

    /// Lets other processes replace those that do not reply, each with all its agents. Called only
    /// under [`TimeoutPolicy::Hold`].
    fn mark_replaceable(&mut self, missing: &BTreeSet<AgentId>, timeout: Duration, context: &mut WaitContext<'_, '_>) {
        let new: Vec<AgentId> = missing.difference(&self.unresponsive).copied().collect();
        if new.is_empty() {
            return;
        }
        for &agent in &new {
            let source = self.membership.lease(agent).map(|lease| lease.source);
            self.unresponsive.insert(agent);
            self.unresponsive.extend(source.into_iter().flat_map(|source| self.membership.agents_of(source)));
        }
        let seconds = timeout.as_secs_f64();
        let names = listed(new);
        context.warn(&format!(
            "no answer within {seconds} s from: {names}; the clock is held until they are started again"
        ));
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
        // A replay that is under way ends here.
        (0..self.agents).map(AgentId).for_each(|agent| self.observation_log.skip(agent));
        let can_answer = |request: &&ObservationRequest| {
            self.membership.lease(request.agent).is_some() && !context.transport.is_gone(request.agent)
        };
        let last: Vec<ObservationRequest> = last.iter().filter(can_answer).cloned().collect();
        let is_resent = |agent: &AgentId| self.retransmits_due[agent.index()] > 0;
        self.abandoned.extend((0..self.agents).map(AgentId).filter(is_resent));
        let replies = self.request_commands(tick, &last, timeout, TimeoutPolicy::ReturnIncomplete, context)?;
        if let Err(MissingReplies { missing, .. }) = replies {
            let missing = listed(missing);
            context.warn(&format!("no acknowledgement of the shutdown message from: {missing}"));
        }
        Ok(())
    }
}

/// The join of an agent as it is recorded: without what identifies its process.
pub(super) fn recorded_join(agent: AgentId, controller: String) -> Join {
    Join { run: 0, agent: agent.0, instance: 0, protocol: RECORDED_PROTOCOL, controller, last_tick: Join::NONE }
}
