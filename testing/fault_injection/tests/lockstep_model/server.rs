//! The server of the model: the sessions of the real one, driven by a loop that does what the
//! session loop does, and checks what it commits.

use std::collections::BTreeMap;
use std::hash::Hash;
use std::sync::Arc;
use std::time::Duration;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, Observation, Scenario, WakeCondition as WireWakeCondition};
use protocol::event_mask::EventMask;
use protocol::limits::PROTOCOL;
use protocol::lockstep::{
    AgentSessions, Event, Inbound, Incoming, JoinPolicy, Notice, ObservationRequest, ReplayPolicy, Replies,
    RunIdentity, SourceId, TimeoutPolicy, Transmit,
};
use protocol::observation::RequestKind;
use protocol::signed::Signed;
use protocol::wake_condition::WakeCondition;

use crate::Mutant;
use crate::process::{Decisions, Message, Network};

/// How long the server waits for replies.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Timeouts {
    /// In tick 0.
    pub(crate) first: Duration,
    pub(crate) later: Duration,
    pub(crate) shutdown: Duration,
}

impl Timeouts {
    pub(crate) fn all(timeout: Duration) -> Self {
        Self { first: timeout, later: timeout, shutdown: timeout }
    }
}

/// The ticks in which every agent is polled that is not due, without look-ahead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Polls {
    Never,
    In(u64),
    Always,
}

/// What is run.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) agents: u32,
    /// The last tick.
    pub(crate) last: u64,
    pub(crate) polls: Polls,
    pub(crate) decisions: Decisions,
    pub(crate) timeouts: Timeouts,
    /// An agent that leaves, and the tick.
    pub(crate) leaves: Option<(u32, u64)>,
    /// Whether messages come between two ticks, as in a run with a real-time factor.
    pub(crate) is_paced: bool,
    /// Whether the run ends with the acknowledgements of the shutdown message, and not with its
    /// last tick.
    pub(crate) has_shutdown: bool,
    pub(crate) mutant: Option<Mutant>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Phase {
    Admission,
    /// The log of a resumed run is replayed.
    Replay,
    /// Between two ticks.
    Paced,
    /// The commands of the present tick are awaited.
    Tick,
    /// An agent leaves before the present tick.
    Dismissal,
    Shutdown,
    Over,
}

/// A committed exchange, as the recording holds it.
#[derive(Debug, Clone)]
struct Exchange {
    agent: u32,
    fragments: Arc<Vec<Observation>>,
    command: Command,
    wake: WakeCondition,
}

#[derive(Debug, Clone)]
pub(crate) struct Server {
    sessions: AgentSessions,
    pub(crate) phase: Phase,
    tick: u64,
    requests: Vec<ObservationRequest>,
    wake_conditions: Vec<WakeCondition>,
    recording: Vec<Exchange>,
    has_left: bool,
    run: u64,
    /// Waits for replies that have ended.
    waits: u64,
    time: Duration,
    /// The process to which each id was given last.
    owners: BTreeMap<u32, u8>,
    /// What must not be, and is.
    pub(crate) violation: Option<String>,
    pub(crate) fingerprint: Vec<u8>,
}

impl Server {
    /// A server that starts a run, or resumes the one of a server that was killed.
    pub(crate) fn start(plan: &Plan, before: Option<&Self>) -> Self {
        let number = before.map_or(1, |before| before.run / 2 + 1);
        let replays = ReplayPolicy { keeps_log: true, allows_replacement: true };
        // Messages of before its reset are ignored.
        let identity = RunIdentity::new(4 * number, [0; 32]).after_reset();
        let mut sessions = AgentSessions::new(identity, JoinPolicy::default(), plan.agents, replays);
        sessions.announce(&Scenario::default(), false);
        let mut server = Self {
            sessions,
            phase: Phase::Admission,
            tick: before.map_or(0, |before| before.tick),
            requests: Vec::new(),
            wake_conditions: before
                .map_or_else(|| vec![WakeCondition::NEXT_TICK; plan.agents as usize], |it| it.wake_conditions.clone()),
            recording: before.map(|before| before.recording.clone()).unwrap_or_default(),
            has_left: before.is_some_and(|before| before.has_left),
            run: identity.run(),
            waits: 0,
            time: Duration::ZERO,
            owners: BTreeMap::new(),
            violation: None,
            fingerprint: Vec::new(),
        };
        server.fingerprint = server.sessions.fingerprint();
        server
    }

    /// What the future of the server depends on, besides its sessions.
    pub(crate) fn rest(&self) -> impl Hash + PartialEq + '_ {
        let Self { phase, tick, has_left, run, owners, violation, .. } = self;
        let requests: Vec<_> = self.requests.iter().map(|request| (request.agent.0, request.kind)).collect();
        let requests: Vec<_> =
            requests.into_iter().map(|(agent, kind)| (agent, kind == RequestKind::Scheduled)).collect();
        let wake_conditions: Vec<u64> = self.wake_conditions.iter().map(|wake| wake.at.0).collect();
        let recorded: Vec<_> = self.recording.iter().map(|it| (it.agent, it.command.tick, &it.command.info)).collect();
        (phase, tick, has_left, run, owners, violation, requests, wake_conditions, recorded)
    }

    /// Whether its sessions wait for a timer.
    pub(crate) fn has_timer(&self) -> bool {
        self.sessions.poll_timeout().is_some()
    }

    fn violate(&mut self, what: impl Into<String>) {
        self.violation.get_or_insert(what.into());
    }

    fn refusals(&self) -> u64 {
        self.sessions.refusals().map(|(_, count)| count).sum()
    }

    /// Handles a message from an agent process. Returns whether the sessions have changed.
    pub(crate) fn handle(&mut self, plan: &Plan, message: &Message, network: &mut Network) -> bool {
        let run = self.run;
        let (agent, mut instance, inbound) = match message.clone() {
            Message::Join { agent, instance, last_tick } => {
                let last_tick = last_tick.unwrap_or(Join::NONE);
                let controller = "rbw".to_owned();
                let join = Join { run, agent, instance: instance.into(), protocol: PROTOCOL, controller, last_tick };
                (agent, instance, Inbound::Join(Signed::unsigned(join)))
            }
            Message::Command { agent, instance, tick, info, wake } => {
                let wake = WireWakeCondition { at_tick: wake, ..WireWakeCondition::default() };
                let command = Command { tick, run, agent, wake, info, ..Command::default() };
                (agent, instance, Inbound::Command(Signed::unsigned(command)))
            }
            Message::Reply { .. } | Message::Observation { .. } => return false,
        };
        let sender = instance;
        let is_command = matches!(inbound, Inbound::Command(_));
        if plan.mutant == Some(Mutant::AnyProcess) && is_command {
            instance = self.owners.get(&agent).copied().unwrap_or(instance);
        }
        let refused = self.refusals();
        let incoming = Incoming { topic_agent: AgentId(agent), source: SourceId([instance; 16]), message: inbound };
        self.sessions.handle(incoming, self.time);
        let now = self.sessions.fingerprint();
        let has_changed = now != self.fingerprint;
        // A command that is accepted may refuse another process, which has asked for the id.
        if has_changed && self.refusals() > refused && !is_command {
            self.violate("a refused message has changed the sessions");
        }
        if has_changed && is_command && self.owners.get(&agent) != Some(&sender) {
            self.violate("a command of a process that does not hold the id was accepted");
        }
        self.attend(plan, network);
        if self.phase == Phase::Admission && self.sessions.missing().is_empty() {
            self.begin(plan, network);
        }
        if has_changed {
            self.fingerprint = self.sessions.fingerprint();
        }
        has_changed
    }

    /// Lets time pass until a message comes.
    pub(crate) fn wait_until(&mut self, time: Duration) {
        self.time = time;
        let message = Inbound::Join(Signed::unsigned(Join { run: self.run - 1, ..Join::default() }));
        self.sessions.handle(Incoming { topic_agent: AgentId(0), source: SourceId([0; 16]), message }, time);
        self.fingerprint = self.sessions.fingerprint();
    }

    /// What has to change before the timers of the present wait are of no interest.
    pub(crate) fn waits(&self) -> u64 {
        self.waits
    }

    /// Does what is due now.
    pub(crate) fn expire(&mut self, plan: &Plan, network: &mut Network) {
        self.sessions.handle_timeout(self.time);
        self.attend(plan, network);
        self.fingerprint = self.sessions.fingerprint();
    }

    /// Forgets what was committed from a tick on, as a recording that was cut.
    pub(crate) fn forget_from(&mut self, tick: u64) {
        self.recording.retain(|exchange| exchange.command.tick < tick);
        self.tick = tick;
        self.wake_conditions.fill(WakeCondition::NEXT_TICK);
        for Exchange { agent, wake, .. } in &self.recording {
            self.wake_conditions[*agent as usize] = *wake;
        }
    }

    /// The first tick that is not committed.
    pub(crate) fn tick(&self) -> u64 {
        self.tick
    }

    /// Waits until the next timer expires. Returns whether that has changed anything.
    pub(crate) fn elapse(&mut self, plan: &Plan, network: &mut Network) -> bool {
        // A second is enough for any timer.
        for _ in 0..100 {
            let Some(at) = self.sessions.poll_timeout() else { return false };
            self.time = at;
            if plan.mutant == Some(Mutant::NoResends) && self.phase != Phase::Shutdown {
                return false;
            }
            self.sessions.handle_timeout(at);
            if plan.mutant == Some(Mutant::EarlyCommit) && self.phase == Phase::Tick {
                let received = self.sessions.abandon().received;
                self.commit(plan, received, network);
            }
            let has_sent = self.attend(plan, network);
            let now = self.sessions.fingerprint();
            if std::mem::replace(&mut self.fingerprint, now) != self.fingerprint || has_sent {
                return true;
            }
        }
        false
    }

    /// Lets a second pass in which nothing arrives.
    pub(crate) fn pass_time(&mut self) {
        self.time += Duration::from_secs(1);
    }

    /// Ends a pause between two ticks.
    pub(crate) fn proceed(&mut self, plan: &Plan, network: &mut Network) {
        self.start_tick(plan, network);
        self.fingerprint = self.sessions.fingerprint();
    }

    /// Sends what is to be sent, and handles events. Returns whether it has sent anything.
    fn attend(&mut self, plan: &Plan, network: &mut Network) -> bool {
        let mut has_sent = false;
        loop {
            while let Some(transmit) = self.sessions.poll_transmit() {
                has_sent = true;
                self.send(transmit, network);
            }
            match self.sessions.poll_event() {
                Some(Event::Answered(replies)) => self.answered(plan, replies, network),
                Some(Event::TimedOut(missing)) => match self.phase {
                    Phase::Dismissal | Phase::Shutdown => self.answered(plan, missing.received, network),
                    _ => self.violate("a tick was given up"),
                },
                Some(Event::Diverged { agent, tick, .. }) => {
                    self.violate(format!("agent {agent} diverges in tick {tick}"));
                }
                Some(Event::Notice(Notice::Replaced { agent })) if plan.mutant == Some(Mutant::NoReplay) => {
                    self.sessions.skip_replay(agent);
                }
                Some(Event::Notice(_)) => {}
                None => return has_sent,
            }
        }
    }

    fn send(&mut self, transmit: Transmit, network: &mut Network) {
        network.insert(match transmit {
            Transmit::JoinReply(reply) => {
                let (agent, code, accepted) = (reply.agent, reply.code, reply.accepted);
                let instance = reply.instance as u8;
                if accepted {
                    self.owners.insert(agent, instance);
                }
                Message::Reply { agent, instance, code, accepted }
            }
            Transmit::Observation(agent, signed) => {
                let &Observation { tick, phase, .. } = signed.claimed();
                Message::Observation { agent: agent.0, tick, has_ended: phase == Observation::ENDED }
            }
        });
    }

    fn answered(&mut self, plan: &Plan, replies: Replies, network: &mut Network) {
        self.waits += 1;
        match self.phase {
            Phase::Replay => self.start_tick(plan, network),
            Phase::Tick => self.commit(plan, replies, network),
            Phase::Dismissal => {
                if let Some((agent, _)) = plan.leaves {
                    self.sessions.leave(AgentId(agent));
                }
                self.start_tick(plan, network);
            }
            Phase::Shutdown => self.phase = Phase::Over,
            Phase::Admission | Phase::Paced | Phase::Over => self.violate("replies came that were not awaited"),
        }
    }

    /// All ids have a process.
    fn begin(&mut self, plan: &Plan, network: &mut Network) {
        if self.recording.is_empty() || self.tick > plan.last {
            self.start_tick(plan, network);
            return;
        }
        for Exchange { agent, fragments, command, .. } in &self.recording {
            self.sessions.append(AgentId(*agent), Arc::clone(fragments), command, false);
        }
        if let Some((agent, _)) = plan.leaves.filter(|_| self.has_left) {
            self.sessions.leave(AgentId(agent));
        }
        self.phase = Phase::Replay;
        self.sessions.enter(Tick(self.tick));
        self.await_replies(plan, network);
    }

    fn await_replies(&mut self, plan: &Plan, network: &mut Network) {
        let timeout = if self.tick == 0 { plan.timeouts.first } else { plan.timeouts.later };
        self.sessions.await_replies(self.time, timeout, TimeoutPolicy::Hold);
        self.attend(plan, network);
    }

    fn shut_down(&mut self, plan: &Plan, last: &[ObservationRequest], network: &mut Network) {
        self.sessions.shut_down(Tick(self.tick), last, self.time, plan.timeouts.shutdown);
        self.attend(plan, network);
    }

    fn is_out(&self, plan: &Plan, agent: u32) -> bool {
        self.has_left && plan.leaves.is_some_and(|(left, _)| left == agent)
    }

    fn request(&self, agent: u32, kind: RequestKind, phase: u8) -> ObservationRequest {
        let fragment = Observation { tick: self.tick, agent, parts: 1, phase, ..Observation::default() };
        ObservationRequest { agent: AgentId(agent), kind, fragments: Arc::new(vec![fragment]) }
    }

    /// Starts the present tick, or the next one in which an agent is asked, or ends the run.
    fn start_tick(&mut self, plan: &Plan, network: &mut Network) {
        while self.tick <= plan.last {
            if let Some((agent, _)) = plan.leaves.filter(|(_, tick)| self.tick == *tick && !self.has_left) {
                self.phase = Phase::Dismissal;
                self.has_left = true;
                let last = [self.request(agent, RequestKind::Polled, Observation::ENDED)];
                return self.shut_down(plan, &last, network);
            }
            self.requests = self.due(plan);
            self.sessions.enter(Tick(self.tick));
            self.phase = Phase::Tick;
            if !self.requests.is_empty() {
                for request in &self.requests {
                    self.sessions.request(request);
                }
                return self.await_replies(plan, network);
            }
            self.tick += 1;
            if self.holds_pace(plan) {
                return;
            }
        }
        self.end(plan, network);
    }

    /// Whether a pause follows before the present tick.
    fn holds_pace(&mut self, plan: &Plan) -> bool {
        let is_held = plan.is_paced && self.tick <= plan.last;
        if is_held {
            self.phase = Phase::Paced;
            self.sessions.enter(Tick(self.tick));
        }
        is_held
    }

    fn end(&mut self, plan: &Plan, network: &mut Network) {
        if !plan.has_shutdown {
            self.phase = Phase::Over;
            return;
        }
        self.phase = Phase::Shutdown;
        let agents = (0..plan.agents).filter(|agent| !self.is_out(plan, *agent));
        let last: Vec<_> =
            agents.map(|agent| self.request(agent, RequestKind::Scheduled, Observation::ENDED)).collect();
        self.shut_down(plan, &last, network);
    }

    /// The requests of the present tick.
    fn due(&self, plan: &Plan) -> Vec<ObservationRequest> {
        let is_polled = match plan.polls {
            Polls::Never => false,
            Polls::In(tick) => tick == self.tick,
            Polls::Always => true,
        };
        let agents = (0..plan.agents).filter(|agent| !self.is_out(plan, *agent));
        let requests = agents.filter_map(|agent| {
            let is_scheduled = self.wake_conditions[agent as usize].is_met(Tick(self.tick), EventMask::empty());
            let kind = if is_scheduled { RequestKind::Scheduled } else { RequestKind::Polled };
            (is_scheduled || is_polled).then(|| self.request(agent, kind, Observation::RUNNING))
        });
        requests.collect()
    }

    fn commit(&mut self, plan: &Plan, mut replies: Replies, network: &mut Network) {
        for ObservationRequest { agent, kind, fragments } in std::mem::take(&mut self.requests) {
            let Some(reply) = replies.remove(&agent) else {
                self.violate("a tick was committed with a command missing");
                continue;
            };
            if kind == RequestKind::Polled {
                if !reply.is_no_op() {
                    self.violate("an agent acts that is not due");
                }
                continue;
            }
            if reply.message.info != plan.decisions.undisturbed(agent.0, self.tick) {
                self.violate(format!("agent {agent} has told {:?} in tick {}", reply.message.info, self.tick));
            }
            let wake = reply.command.wake;
            self.wake_conditions[agent.index()] = wake;
            self.sessions.append(agent, Arc::clone(&fragments), &reply.message, true);
            self.recording.push(Exchange { agent: agent.0, fragments, command: reply.message, wake });
        }
        self.tick += 1;
        if !self.holds_pace(plan) {
            self.start_tick(plan, network);
        }
    }
}
