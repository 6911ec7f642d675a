//! The server's sessions with the agents, as a state machine without input and output: observation
//! requests go out, are resent while unanswered, and legal replies come in.
//!
//! The caller owns the transport and the clock. It hands in what has arrived
//! ([`handle`](AgentSessions::handle)) and the time
//! ([`handle_timeout`](AgentSessions::handle_timeout)), and takes what is to be sent
//! ([`poll_transmit`](AgentSessions::poll_transmit)), what has happened
//! ([`poll_event`](AgentSessions::poll_event)) and when to call again
//! ([`poll_timeout`](AgentSessions::poll_timeout)). Times are wall times since the start of the
//! session and decide only when to resend and when to give up.
//!
//! A tick: [`enter`](AgentSessions::enter) it, [`request`](AgentSessions::request) the commands of
//! the agents that are due, [`await_replies`](AgentSessions::await_replies) until
//! [`Event::Answered`], and [`append`](AgentSessions::append) what was committed.
//!
//! Invariants: a refused message changes nothing but its counter; a resent observation changes
//! nothing, because a tick has one reply; every wait is bounded by a timeout, unless the clock is
//! held for a lost agent; recorded messages carry no run number: it is added when a message is sent
//! and removed when one is received.

use core::time::Duration;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use crate::limits::PROTOCOL;
use crate::signed::Signed;
use msgs::counters::CounterName;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, JoinReply, Observation as Fragment, Scenario};

use super::agent_session::State;
use super::authentication::Authentication;
use super::membership::Membership;
use super::resend_estimator::ResendEstimator;
use super::timers::{AwakeClock, Timer, TimerTable};
use super::{
    Barrier, CommandReply, Event, JoinPolicy, MissingReplies, Notice, ObservationRequest, Refusal, Replies,
    RunIdentity, SourceId, Transmit,
};

/// What follows when a reply is overdue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeoutPolicy {
    /// The tick is given up without the missing replies; the scenario decides between abort and
    /// drop.
    ReturnIncomplete,
    /// The clock is held until another process replaces the one that does not reply.
    Hold,
}

/// What the sessions keep for processes that take over an agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReplayPolicy {
    /// Whether the observation log is kept.
    pub keeps_log: bool,
    /// Whether another process may replace one that does not reply.
    pub allows_replacement: bool,
}

/// What the replies of a wait say about the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sample {
    /// How long replies take, if all come.
    Clean,
    /// Nothing: a replay was under way, or no reply was awaited.
    None,
    /// That replies take longer than was expected: an observation was resent.
    Resent,
}

/// What is awaited.
#[derive(Debug, Clone, Copy)]
enum Stage {
    /// Nothing.
    Idle,
    /// The commands of a tick, and the end of all replays.
    Commands { policy: TimeoutPolicy, wait: Wait },
    /// Acknowledgements of the shutdown message.
    Shutdown { wait: Wait },
}

/// A wait for replies; times are those of the [`AwakeClock`].
#[derive(Debug, Clone, Copy)]
struct Wait {
    timeout: Duration,
    began: Duration,
    /// The interval before the next resend.
    interval: Duration,
    sample: Sample,
}

/// The exchange of a tick.
#[derive(Debug, Clone)]
struct Round {
    stage: Stage,
    requests: BTreeMap<AgentId, Arc<Vec<Fragment>>>,
    barrier: Barrier<CommandReply>,
    /// The process that has given the reply of an agent.
    answered_by: BTreeMap<AgentId, (SourceId, u64)>,
}

impl Round {
    fn new(tick: Tick) -> Self {
        Self {
            stage: Stage::Idle,
            requests: BTreeMap::new(),
            barrier: Barrier::new(tick, BTreeSet::new()),
            answered_by: BTreeMap::new(),
        }
    }

    fn wait_mut(&mut self) -> Option<&mut Wait> {
        match &mut self.stage {
            Stage::Idle => None,
            Stage::Commands { wait, .. } | Stage::Shutdown { wait } => Some(wait),
        }
    }
}

/// A message that waits to be sent.
#[derive(Debug, Clone)]
enum Outgoing {
    JoinReply(JoinReply),
    /// The fragments from `next` on. They are signed one by one, when they are sent.
    Observation {
        agent: AgentId,
        fragments: Arc<Vec<Fragment>>,
        next: usize,
    },
}

/// The sessions of all agents of a run.
#[derive(Debug, Clone)]
pub struct AgentSessions {
    /// Distinguishes messages of this run from those of others. Neither the recording nor the
    /// digest holds it.
    pub(super) identity: RunIdentity,
    pub(super) replays: ReplayPolicy,
    pub(super) membership: Membership,
    pub(super) authentication: Authentication,
    round: Round,
    timers: TimerTable,
    clock: AwakeClock,
    resends: ResendEstimator,
    outgoing: VecDeque<Outgoing>,
    pub(super) events: VecDeque<Event>,
    pub(super) refusals: BTreeMap<CounterName, u64>,
    /// The last illegal command of each agent that has sent one: its tick, and what was wrong.
    pub(super) illegal_commands: BTreeMap<AgentId, (Tick, String)>,
    /// The instances of processes that have started themselves again: they stalled.
    pub(super) restarted: BTreeSet<u64>,
}

impl AgentSessions {
    /// The sessions of a run of `agents` agents, of which none has joined.
    #[must_use]
    pub fn new(identity: RunIdentity, policy: JoinPolicy, agents: u32, replays: ReplayPolicy) -> Self {
        Self {
            identity,
            replays,
            membership: Membership::new(agents),
            authentication: Authentication::new(policy, identity),
            round: Round::new(Tick::ZERO),
            timers: TimerTable::default(),
            clock: AwakeClock::default(),
            resends: ResendEstimator::default(),
            outgoing: VecDeque::new(),
            events: VecDeque::new(),
            refusals: BTreeMap::new(),
            illegal_commands: BTreeMap::new(),
            restarted: BTreeSet::new(),
        }
    }

    /// The announcement of this run, for a transport on which others than the agents can send if it
    /// `is_open`, so that joins and commands must be authenticated.
    pub fn announce(&mut self, scenario: &Scenario, is_open: bool) -> Scenario {
        let (run, origin) = (self.identity.run(), self.identity.origin());
        let announced = Scenario { protocol: PROTOCOL, run, origin, ..scenario.clone() };
        self.authentication.announce(&announced, is_open);
        announced
    }

    /// Enters a tick, in which no agent has been asked. What was not answered before is given up.
    pub fn enter(&mut self, tick: Tick) {
        self.round = Round::new(tick);
        self.timers.stop();
    }

    /// Asks an agent for the command of the present tick. A replay comes first.
    pub fn request(&mut self, request: &ObservationRequest) {
        let &ObservationRequest { agent, ref fragments, .. } = request;
        self.round.barrier.request(agent);
        self.round.requests.insert(agent, Arc::clone(fragments));
        if !self.membership.session(agent).is_replaying() {
            self.prompt(agent);
        }
    }

    /// Waits for the replies of the present tick and for the end of all replays. The end is
    /// [`Event::Answered`], or [`Event::TimedOut`] if `timeout` has passed and the policy says so.
    pub fn await_replies(&mut self, now: Duration, timeout: Duration, policy: TimeoutPolicy) {
        let sample = if self.round.requests.is_empty() { Sample::None } else { Sample::Clean };
        let wait = self.start_wait(now, timeout, sample);
        self.round.stage = Stage::Commands { policy, wait };
        let replaying: Vec<AgentId> = self.replaying().collect();
        for agent in replaying {
            self.prompt(agent);
        }
        self.complete();
    }

    /// Sends agents the shutdown message in a tick of its own, and waits for their
    /// acknowledgements. Those without a process are left out. The end is as with
    /// [`AgentSessions::await_replies`].
    pub fn shut_down(&mut self, tick: Tick, last: &[ObservationRequest], now: Duration, timeout: Duration) {
        self.enter(tick);
        for (_, session) in self.membership.sessions_mut() {
            session.expected.note_shutdown();
        }
        for request in last {
            let session = self.membership.session_mut(request.agent);
            // A replay that is under way ends here.
            session.skip_replay();
            if session.has_process() {
                self.request(request);
            }
        }
        let wait = self.start_wait(now, timeout, Sample::Clean);
        self.round.stage = Stage::Shutdown { wait };
        self.complete();
    }

    /// Gives up the present tick, and returns what it lacks.
    pub fn abandon(&mut self) -> MissingReplies {
        let missing: BTreeSet<AgentId> = self.awaited().collect();
        for (agent, session) in self.membership.sessions_mut() {
            session.expected.set_abandoned(missing.contains(&agent));
        }
        let next = Round::new(self.tick());
        let round = std::mem::replace(&mut self.round, next);
        self.timers.stop();
        MissingReplies { received: round.barrier.into_answers_so_far(), missing: missing.into_iter().collect() }
    }

    /// Appends a committed exchange to the log of the agent. `is_live` says that a process of the
    /// agent has given the command in the present tick; one that has replaced it does not know it.
    pub fn append(&mut self, agent: AgentId, fragments: Arc<Vec<Fragment>>, command: &Command, is_live: bool) {
        if self.replays.keeps_log {
            let session = self.membership.session_mut(agent);
            let answered_by = self.round.answered_by.get(&agent);
            let is_of_holder = session.holder().map(|holder| holder.process()).as_ref() == answered_by;
            session.append(fragments, command, is_live && is_of_holder);
        }
    }

    /// Ends the replay to an agent whose interface has no observations to replay.
    pub fn skip_replay(&mut self, agent: AgentId) {
        self.membership.session_mut(agent).skip_replay();
    }

    /// Notes that an agent has left the run: it is never asked again.
    pub fn leave(&mut self, agent: AgentId) {
        self.membership.session_mut(agent).leave();
    }

    /// The next message to send, if there is one.
    pub fn poll_transmit(&mut self) -> Option<Transmit> {
        let (agent, fragments, next) = match self.outgoing.pop_front()? {
            Outgoing::JoinReply(reply) => return Some(Transmit::JoinReply(reply)),
            Outgoing::Observation { agent, fragments, next } => (agent, fragments, next),
        };
        let fragment = Fragment { run: self.identity.run(), ..fragments[next].clone() };
        if next + 1 < fragments.len() {
            self.outgoing.push_front(Outgoing::Observation { agent, fragments, next: next + 1 });
        }
        let signed = match self.membership.holder(agent) {
            Some(holder) => holder.grant.sign(fragment),
            None => Signed::unsigned(fragment),
        };
        Some(Transmit::Observation(agent, signed))
    }

    /// The next event, if there is one.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// The time at which to call [`AgentSessions::handle_timeout`] at the latest, if replies are
    /// awaited.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        self.timers.next().map(|at| self.clock.until(at))
    }

    /// Does what is due at a time.
    pub fn handle_timeout(&mut self, now: Duration) {
        self.clock.advance(now);
        let awake = self.clock.awake();
        if self.timers.take(Timer::Reply, awake) {
            match self.round.stage {
                Stage::Idle => {}
                Stage::Commands { policy: TimeoutPolicy::Hold, wait } => self.lose_silent(wait.timeout),
                Stage::Commands { policy: TimeoutPolicy::ReturnIncomplete, .. } | Stage::Shutdown { .. } => {
                    let missing = self.abandon();
                    self.events.push_back(Event::TimedOut(missing));
                }
            }
        }
        if self.timers.take(Timer::Resend, awake)
            && let Some(wait) = self.round.wait_mut()
        {
            wait.interval = ResendEstimator::next(wait.interval);
            wait.sample = Sample::Resent;
            let at = awake + wait.interval;
            self.timers.set(Timer::Resend, at);
            let awaited: Vec<AgentId> = self.awaited().collect();
            for agent in awaited {
                if self.prompt(agent) {
                    self.membership.session_mut(agent).expected.note_resent();
                }
            }
        }
    }

    /// Ids without a process, ascending.
    #[must_use]
    pub fn missing(&self) -> Vec<AgentId> {
        self.membership.missing()
    }

    /// Agents that have left the run, ascending.
    #[must_use]
    pub fn departed(&self) -> Vec<AgentId> {
        self.membership.departed()
    }

    /// The controllers of the agents that have a process, ascending by agent.
    pub fn controllers(&self) -> impl Iterator<Item = (AgentId, &str)> {
        self.membership.sessions().filter_map(|(agent, session)| Some((agent, &*session.holder()?.lease.controller)))
    }

    /// Processes that have joined after they had started themselves again.
    #[must_use]
    pub fn restarted(&self) -> usize {
        self.restarted.len()
    }

    /// Why an agent of these, which have not replied to a tick, has not: its reply was illegal. The
    /// first such agent, and field, value and allowed values.
    #[must_use]
    pub fn illegal_reply(&self, agents: &[AgentId], tick: Tick) -> Option<(AgentId, &str)> {
        agents.iter().find_map(|agent| match self.illegal_commands.get(agent) {
            Some((of, reason)) if *of == tick => Some((*agent, reason.as_str())),
            _ => None,
        })
    }

    /// The counters of refusals that a result names.
    pub fn refusals(&self) -> impl Iterator<Item = (CounterName, u64)> + '_ {
        let refusals = CounterName::PLAIN.iter().copied().filter(|counter| counter.is_refusal());
        let counted = refusals.map(|counter| (counter, self.refusals.get(&counter).copied().unwrap_or_default()));
        counted.filter(|(counter, count)| *count > 0 || !counter.is_left_out_at_zero())
    }

    /// The state as bytes, for a model checker: two sessions with the same bytes and logs behave
    /// alike. Commands are told apart by tick and info; counters and what is known of the network
    /// are left out; times are relative.
    #[must_use]
    pub fn fingerprint(&self) -> Vec<u8> {
        let awake = self.clock.awake();
        let Round { stage, barrier, answered_by, .. } = &self.round;
        let stage = match stage {
            Stage::Idle => (0, 0),
            Stage::Commands { policy, wait } => (1 + *policy as u8, wait.sample as u8),
            Stage::Shutdown { wait } => (3, wait.sample as u8),
        };
        let mut bytes = vec![stage.0, stage.1];
        for timer in Timer::ALL {
            let left = self.timers.get(timer).map(|at| at.saturating_sub(awake).as_millis() as u32);
            bytes.extend(left.unwrap_or(u32::MAX).to_le_bytes());
        }
        bytes.extend(barrier.tick().0.to_le_bytes());
        for (agent, session) in self.membership.sessions() {
            bytes.push(u8::from(barrier.awaits(agent)) + 2 * u8::from(barrier.answer(agent).is_some()));
            if let Some(reply) = barrier.answer(agent) {
                bytes.extend(reply.message.info.as_bytes());
            }
            if let Some((source, instance)) = answered_by.get(&agent) {
                bytes.extend(source.0.iter().chain(&instance.to_le_bytes()));
            }
            session.fingerprint(&mut bytes);
        }
        bytes
    }

    /// Counts the time that has passed until a message came.
    pub(super) fn advance_clock(&mut self, now: Duration) {
        self.clock.advance(now);
    }

    /// The present tick, or the next one while no reply is awaited.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.round.barrier.tick()
    }

    pub(super) fn send_reply(&mut self, reply: JoinReply) {
        self.outgoing.push_back(Outgoing::JoinReply(reply));
    }

    pub(super) fn notice(&mut self, notice: Notice) {
        self.events.push_back(Event::Notice(notice));
    }

    /// Whether the reply of an agent to a tick is awaited.
    pub(super) fn expects(&self, agent: AgentId, tick: Tick) -> Result<(), Refusal> {
        self.round.barrier.expect(agent, tick)
    }

    /// Accepts a reply of the process that holds the id, which is alive.
    pub(super) fn accept(&mut self, agent: AgentId, tick: Tick, reply: CommandReply) -> Result<(), Refusal> {
        self.round.barrier.accept(agent, tick, reply)?;
        if let Some(holder) = self.membership.holder(agent) {
            self.round.answered_by.insert(agent, holder.process());
        }
        self.complete();
        Ok(())
    }

    /// Notes that a process answers. If it was lost, its agents get the whole time once more.
    pub(super) fn note_alive(&mut self, agent: AgentId) {
        if self.membership.revive(agent)
            && let Stage::Commands { wait, .. } = self.round.stage
        {
            self.timers.set(Timer::Reply, self.clock.awake() + wait.timeout);
        }
    }

    /// Continues a replay that has just begun or made progress. The other agents have been waiting
    /// for it, so that their time starts anew.
    pub(super) fn continue_replay(&mut self, agent: AgentId) {
        let Stage::Commands { policy, mut wait } = self.round.stage else { return };
        wait.interval = self.resends.first();
        if wait.sample == Sample::Clean {
            wait.sample = Sample::None;
        }
        self.set_timers(&wait);
        self.round.stage = Stage::Commands { policy, wait };
        self.prompt(agent);
        self.complete();
    }

    fn start_wait(&mut self, now: Duration, timeout: Duration, sample: Sample) -> Wait {
        self.clock.resume(now);
        let wait = Wait { timeout, began: self.clock.awake(), interval: self.resends.first(), sample };
        self.set_timers(&wait);
        wait
    }

    fn set_timers(&mut self, wait: &Wait) {
        let awake = self.clock.awake();
        self.timers.set(Timer::Resend, awake + wait.interval);
        self.timers.set(Timer::Reply, awake + wait.timeout);
    }

    /// Agents to which a replay is under way, ascending.
    fn replaying(&self) -> impl Iterator<Item = AgentId> + '_ {
        self.membership.sessions().filter(|(_, session)| session.is_replaying()).map(|(agent, _)| agent)
    }

    /// Agents for which the present tick waits, ascending.
    fn awaited(&self) -> impl Iterator<Item = AgentId> + '_ {
        let waits_for_replays = matches!(self.round.stage, Stage::Commands { .. });
        let is_awaited = move |session: &super::agent_session::AgentSession, agent| {
            self.round.barrier.awaits(agent) || (waits_for_replays && session.is_replaying())
        };
        self.membership.sessions().filter(move |(agent, session)| is_awaited(session, *agent)).map(|(agent, _)| agent)
    }

    /// Ends the wait once nothing more is awaited.
    fn complete(&mut self) {
        let wait = match self.round.stage {
            Stage::Commands { wait, .. } if self.replaying().next().is_none() => wait,
            Stage::Shutdown { wait } => wait,
            Stage::Idle | Stage::Commands { .. } => return,
        };
        if !self.round.barrier.is_complete() {
            return;
        }
        match wait.sample {
            Sample::Clean => self.resends.note(self.clock.awake() - wait.began),
            Sample::None => {}
            Sample::Resent => self.resends.note_resent(),
        }
        self.timers.stop();
        self.round.stage = Stage::Idle;
        let next = Barrier::new(self.tick(), BTreeSet::new());
        let replies: Replies = std::mem::replace(&mut self.round.barrier, next).into_answers();
        self.events.push_back(Event::Answered(replies));
    }

    /// Sends an agent its next replayed observation, or else the present one if its reply is
    /// awaited. Returns whether there was one.
    fn prompt(&mut self, agent: AgentId) -> bool {
        let session = self.membership.session(agent);
        let present = || {
            let is_asked = self.round.barrier.awaits(agent) && !matches!(session.state, State::GivenUp { .. });
            self.round.requests.get(&agent).filter(|_| is_asked)
        };
        let Some(fragments) = session.to_replay().or_else(present).cloned() else { return false };
        self.outgoing.push_back(Outgoing::Observation { agent, fragments, next: 0 });
        true
    }

    /// Lets other processes replace those that do not reply, each with all its agents.
    fn lose_silent(&mut self, timeout: Duration) {
        let is_new = |agent: &AgentId| {
            let state = &self.membership.session(*agent).state;
            matches!(state, State::Live { .. } | State::Contended { .. } | State::Replaying { .. })
        };
        let agents: Vec<AgentId> = self.awaited().filter(is_new).collect();
        if !agents.is_empty() {
            agents.iter().for_each(|agent| self.membership.lose(*agent));
            self.notice(Notice::Silent { agents, timeout });
        }
    }
}
