//! Traces of simulated faulty runs, replayed in the model: each message that the real server and
//! the real agent processes receive must be on its way in the model, and each that they send must
//! be one that the model sends in the same step.
//!
//! In place of what its agents decide, the model has the undisturbed run: when each agent is due,
//! and whether a command is the undisturbed one, byte for byte. Its server has the times of the real
//! one. Observations of several fragments are one message, which comes with its last missing
//! fragment; messages of other runs must have no effect.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use agent_node::transport::Inbound as ToAgents;
use fault_injection::simulated::trace::{self, Trace, TraceEvent};
use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, Join, JoinReply, Observation};
use protocol::command;
use protocol::lockstep::{Incoming, Transmit};
use protocol::signed::Signed;
use sim_server::session::SHUTDOWN_TIMEOUT;
use transport::Inbound as ToServer;

use crate::process::{Decisions, Message, Network, Process};
use crate::server::{Phase, Plan, Polls, Server, Timeouts};

/// Seeds of the traces.
const SEEDS: u64 = 60;

/// What an agent tells in a command that is not the undisturbed one.
const OTHER_COMMAND: &str = "another command";

/// An agent process of the trace, and its counterpart in the model.
struct Counterpart {
    process: Process,
    /// The run that it has heard of first.
    run: Option<u64>,
    /// What it may send now, besides joins.
    sends: Network,
    /// The fragments that have come, by agent, tick and whether they are of the shutdown message.
    fragments: BTreeMap<(u32, u64, bool), BTreeSet<u16>>,
    has_ended: bool,
}

/// The model along a trace.
struct Replay {
    plan: Plan,
    /// The commands of the undisturbed run.
    commands: BTreeMap<(u32, u64), Vec<u8>>,
    server: Option<Server>,
    /// The server before that.
    before: Option<Server>,
    /// The run of the present server.
    run: u64,
    processes: BTreeMap<u32, Counterpart>,
    /// Messages that were sent, with the number of their run.
    network: BTreeSet<(u64, Message)>,
    /// What the server has to send before it waits again.
    unsent: Network,
}

impl Replay {
    fn new(trace: &Trace) -> Self {
        let mut due: BTreeMap<u32, BTreeSet<u64>> = BTreeMap::new();
        let mut commands = BTreeMap::new();
        let mut last = 0;
        for message in trace.undisturbed.messages() {
            match message.of_agent() {
                Some((AgentId(agent), "command")) => {
                    let Tick(tick) = message.tick();
                    due.entry(agent).or_default().insert(tick);
                    commands.insert((agent, tick), message.data.clone());
                }
                _ => last = last.max(message.tick().0),
            }
        }
        let execution = &trace.scenario.execution;
        let later = Duration::from_secs_f64(execution.decision_timeout_s);
        let plan = Plan {
            agents: trace.scenario.agents.count,
            // The result has the tick in which the agents are shut down.
            last: last - 1,
            polls: if execution.look_ahead { Polls::Never } else { Polls::Always },
            decisions: Decisions::Recorded(Arc::new(due)),
            timeouts: Timeouts {
                first: later.max(Duration::from_secs_f64(execution.join_timeout_s)),
                later,
                shutdown: SHUTDOWN_TIMEOUT,
            },
            leaves: None,
            is_paced: false,
            has_shutdown: true,
            mutant: None,
        };
        Self {
            plan,
            commands,
            server: None,
            before: None,
            run: 0,
            processes: BTreeMap::new(),
            network: BTreeSet::new(),
            unsent: Network::new(),
        }
    }

    /// Takes the step of an event.
    ///
    /// # Errors
    /// If the model does not allow it.
    fn step(&mut self, event: &TraceEvent) -> Result<(), String> {
        match event {
            TraceEvent::ServerStarted { run, resumes_at } => self.start_server(*run, *resumes_at),
            TraceEvent::ServerReceived { at, incoming } => self.server_receives(*at, incoming.as_ref()),
            TraceEvent::ServerSent(transmit) => self.server_sends(transmit),
            TraceEvent::ServerEnded => {
                // A server may be killed before it has announced its run.
                self.before = self.server.take().or(self.before.take());
                Ok(())
            }
            TraceEvent::ProcessStarted { process, agents } => {
                let agents: Vec<u32> = agents.iter().map(|agent| agent.0).collect();
                let counterpart = Counterpart {
                    process: Process::new(instance(*process), 0, &agents),
                    run: None,
                    sends: Network::new(),
                    fragments: BTreeMap::new(),
                    has_ended: false,
                };
                self.processes.insert(*process, counterpart);
                Ok(())
            }
            TraceEvent::ProcessReceived { process, message } => self.process_receives(*process, message),
            TraceEvent::ProcessSent { process, message } => self.process_sends(*process, message),
            TraceEvent::ProcessEnded { process } => {
                self.processes.remove(process);
                Ok(())
            }
        }
    }

    fn start_server(&mut self, run: u64, resumes_at: Option<Tick>) -> Result<(), String> {
        self.unsent.clear();
        self.run = run;
        let before = match resumes_at {
            Some(Tick(tick)) if tick > 0 || self.before.is_some() => {
                let before = self.before.as_mut().ok_or("a run is resumed that has not begun")?;
                if tick > before.tick() {
                    return Err(format!("tick {tick} is resumed, and tick {} was not committed", before.tick()));
                }
                before.forget_from(tick);
                self.before.as_ref()
            }
            _ => None,
        };
        self.server = Some(Server::start(&self.plan, before));
        Ok(())
    }

    fn server_receives(&mut self, at: Duration, incoming: Option<&Incoming>) -> Result<(), String> {
        if let Some(unsent) = self.unsent.first() {
            return Err(format!("the server has not sent {unsent:?}"));
        }
        let received = incoming.map(|incoming| self.of_server_inbox(incoming)).transpose()?;
        let server = self.server.as_mut().ok_or("there is no server")?;
        server.wait_until(at);
        let waits = server.waits();
        if let Some((run, message)) = received
            && run == self.run
        {
            server.handle(&self.plan, &message, &mut self.unsent);
        }
        if server.waits() == waits && !matches!(server.phase, Phase::Admission | Phase::Over) {
            server.expire(&self.plan, &mut self.unsent);
        }
        match &server.violation {
            Some(violation) => Err(violation.clone()),
            None => Ok(()),
        }
    }

    /// A message that the server receives, with its run: a process must have sent it.
    fn of_server_inbox(&self, incoming: &Incoming) -> Result<(u64, Message), String> {
        let process = u128::from_le_bytes(incoming.source.0) as u32;
        let received = self.of_process(process, &incoming.message)?;
        match self.network.contains(&received) {
            true => Ok(received),
            false => Err(format!("the server receives what process {process} has not sent: {:?}", received.1)),
        }
    }

    fn server_sends(&mut self, transmit: &Transmit) -> Result<(), String> {
        let (run, message) = match transmit {
            Transmit::JoinReply(reply) => (reply.run, of_reply(reply)),
            Transmit::Observation(_, fragment) if !fragment.claimed().is_last() => return Ok(()),
            Transmit::Observation(_, fragment) => (fragment.claimed().run, of_fragment(fragment.claimed())),
        };
        if run != self.run || !self.unsent.remove(&message) {
            return Err(format!("the server sends {message:?} and the model {:?}", self.unsent));
        }
        self.network.insert((run, message));
        Ok(())
    }

    fn process_receives(&mut self, number: u32, message: &ToAgents) -> Result<(), String> {
        let counterpart = self.processes.get_mut(&number).ok_or("there is no such process")?;
        let (run, message) = match message {
            ToAgents::Scenario(scenario) => {
                counterpart.run.get_or_insert(scenario.run);
                return Ok(());
            }
            ToAgents::JoinReply(reply) if reply.instance != u64::from(number) => return Ok(()),
            ToAgents::JoinReply(reply) => (reply.run, of_reply(reply)),
            ToAgents::Observation(fragment) => {
                let &Observation { run, agent, tick, part, parts, .. } = fragment.claimed();
                let message = of_fragment(fragment.claimed());
                let has_ended = matches!(message, Message::Observation { has_ended: true, .. });
                let received = counterpart.fragments.entry((agent, tick, has_ended)).or_default();
                received.insert(part);
                if received.len() < usize::from(parts) || counterpart.run != Some(run) {
                    return Ok(());
                }
                (run, message)
            }
        };
        if counterpart.run != Some(run) {
            return Ok(());
        }
        if !self.network.contains(&(run, message.clone())) {
            return Err(format!("process {number} receives what the server has not sent: {message:?}"));
        }
        let Counterpart { process, sends, .. } = counterpart;
        let ends = process.handle(&message, &self.plan.decisions, sends);
        // It acknowledges the shutdown message before it ends.
        counterpart.has_ended |= ends && matches!(message, Message::Reply { .. });
        Ok(())
    }

    fn process_sends(&mut self, number: u32, message: &ToServer) -> Result<(), String> {
        let (run, message) = self.of_process(number, message)?;
        let counterpart = self.processes.get(&number).ok_or("there is no such process")?;
        let mut allowed = counterpart.sends.clone();
        counterpart.process.join(&mut allowed);
        if counterpart.run != Some(run) || counterpart.has_ended || !allowed.contains(&message) {
            let same = |other: &&Message| matches!((*other, &message), (Message::Command { agent, .. }, Message::Command { agent: of, .. }) if agent == of);
            let last = allowed.iter().rev().find(same);
            return Err(format!(
                "process {number} sends {message:?}, which it does not in the model; its last: {last:?}"
            ));
        }
        self.network.insert((run, message));
        Ok(())
    }

    /// A message of a process, with its run.
    fn of_process(&self, number: u32, message: &ToServer) -> Result<(u64, Message), String> {
        let instance = instance(number);
        match message {
            ToServer::Join(request) => {
                let Join { run, agent, last_tick, .. } = request.claimed().join;
                let last_tick = (last_tick != Join::NONE).then_some(last_tick);
                Ok((run, Message::Join { agent, instance, last_tick }))
            }
            ToServer::Command(signed) => {
                let command = maes_msgs::Command { run: 0, ..signed.claimed().clone() };
                let (agent, tick) = (command.agent, command.tick);
                let legal = command::Command::from_message(&command, self.plan.agents)?;
                let recorded = self.commands.get(&(agent, tick));
                let (info, wake) = match recorded {
                    Some(recorded) if *recorded == cdr::encode(&command) => {
                        let decisions = &self.plan.decisions;
                        (decisions.undisturbed(agent, tick), decisions.next_due(agent, tick))
                    }
                    None if legal.is_noop() => (String::new(), self.wake_between(agent, tick)),
                    _ => (OTHER_COMMAND.to_owned(), 0),
                };
                Ok((signed.claimed().run, Message::Command { agent, instance, tick, info, wake }))
            }
            ToServer::Undecodable { reason } => Err(reason.clone()),
        }
    }

    /// The wake-up condition of an agent that is asked in a tick in which it is not due.
    fn wake_between(&self, agent: u32, tick: u64) -> u64 {
        if tick > self.plan.last { 0 } else { self.plan.decisions.next_due(agent, tick) }
    }

    /// Whether the run is complete.
    fn finish(&self) -> Result<(), String> {
        match &self.before {
            Some(server) if server.phase == Phase::Over && self.unsent.is_empty() => Ok(()),
            Some(server) => Err(format!("the run ends in {:?}, without {:?}", server.phase, self.unsent)),
            None => Err("no server has ended".to_owned()),
        }
    }
}

/// The number of a process in the model.
fn instance(process: u32) -> u8 {
    u8::try_from(process).expect("fewer than 256 processes")
}

fn of_reply(reply: &JoinReply) -> Message {
    let JoinReply { agent, code, accepted, .. } = *reply;
    Message::Reply { agent, instance: reply.instance as u8, code, accepted }
}

fn of_fragment(fragment: &Observation) -> Message {
    let &Observation { agent, tick, phase, .. } = fragment;
    Message::Observation { agent, tick, has_ended: phase == Observation::ENDED }
}

/// Replays the events of a trace.
///
/// # Errors
/// The first event that the model does not allow, with its number.
fn replay<'e>(trace: &Trace, events: impl IntoIterator<Item = &'e TraceEvent>) -> Result<(), String> {
    let mut replay = Replay::new(trace);
    for (number, event) in events.into_iter().enumerate() {
        replay.step(event).map_err(|reason| format!("event {number}: {reason}"))?;
    }
    replay.finish()
}

/// The traces of the seeds whose scenarios wait for lost agents.
fn traces() -> impl Iterator<Item = (u64, Trace)> {
    let trace = |seed| trace::of_seed(seed).unwrap_or_else(|reason| panic!("seed {seed}: {reason}"));
    (0..SEEDS).filter_map(move |seed| Some((seed, trace(seed)?)))
}

/// Whether the server sends a reply to a join with a code.
fn replies(event: &TraceEvent, code: u8) -> bool {
    matches!(event, TraceEvent::ServerSent(Transmit::JoinReply(reply)) if reply.code == code)
}

#[test]
fn real_runs_are_runs_of_the_model() {
    let (mut runs, mut steps, mut resumed, mut held, mut refused) = (0, 0, 0, 0, 0);
    for (seed, trace) in traces() {
        replay(&trace, &trace.events).unwrap_or_else(|reason| panic!("seed {seed}: {reason}"));
        let count = |is: fn(&TraceEvent) -> bool| trace.events.iter().filter(|event| is(event)).count();
        runs += 1;
        steps += trace.events.len();
        resumed += count(|event| matches!(event, TraceEvent::ServerStarted { resumes_at: Some(_), .. }));
        held += count(|event| replies(event, JoinReply::HELD));
        refused += count(|event| replies(event, JoinReply::ID_TAKEN));
    }
    eprintln!("{runs} runs, {steps} steps, {resumed} resumed, {held} joins held, {refused} refused");
    assert!(steps > 10_000, "{steps} steps");
    assert!(
        [resumed, held, refused].iter().all(|&count| count > 5),
        "{resumed} resumed, {held} held, {refused} refused"
    );
}

/// The first of the traces in which an alteration is possible, altered.
fn altered(alter: impl Fn(&mut Vec<TraceEvent>) -> Option<()>) -> String {
    for (_, trace) in traces() {
        let mut events = trace.events.clone();
        if alter(&mut events).is_some() {
            return replay(&trace, &events).expect_err("the model refuses it");
        }
    }
    panic!("no trace can be altered so")
}

#[test]
fn altered_traces_are_refused() {
    let without = |is: fn(&TraceEvent) -> bool| {
        altered(|events| {
            let before = events.len();
            events.retain(|event| !is(event));
            (events.len() < before).then_some(())
        })
    };
    let early = without(|event| match event {
        TraceEvent::ServerReceived { incoming: Some(Incoming { message: ToServer::Command(command), .. }), .. } => {
            command.claimed().agent == 0
        }
        _ => false,
    });
    assert!(early.contains("the server "), "a tick is committed without a command: {early}");
    let silent = without(|event| matches!(event, TraceEvent::ServerSent(Transmit::Observation(AgentId(0), _))));
    assert!(silent.contains("the server has not sent"), "an agent that is due is not asked: {silent}");
    let forged = without(|event| matches!(event, TraceEvent::ProcessSent { message: ToServer::Join(_), .. }));
    assert!(forged.contains("the server receives what"), "a join comes that no process has sent: {forged}");
    let unasked =
        without(|event| matches!(event, TraceEvent::ProcessReceived { message: ToAgents::Observation(_), .. }));
    assert!(unasked.contains("it does not in the model"), "a process answers what it was not asked: {unasked}");

    let changed = altered(|events| {
        let command = events.iter_mut().find_map(|event| match event {
            TraceEvent::ProcessSent { message: ToServer::Command(command), .. } => Some(command),
            _ => None,
        });
        command.map(|signed| {
            let command =
                maes_msgs::Command { want_view: true, info: "changed".to_owned(), ..signed.claimed().clone() };
            *signed = Signed::unsigned(command);
        })
    });
    assert!(changed.contains(OTHER_COMMAND), "a process decides otherwise: {changed}");
    let ahead = altered(|events| {
        let resumed = events.iter_mut().find_map(|event| match event {
            TraceEvent::ServerStarted { resumes_at: Some(tick), .. } => Some(tick),
            _ => None,
        });
        resumed.map(|tick| *tick = Tick(tick.0 + 10_000))
    });
    assert!(ahead.contains("was not committed"), "a run is resumed from more than there was: {ahead}");
    let cut = altered(|events| {
        let is = |event: &TraceEvent| matches!(event, TraceEvent::ServerSent(Transmit::Observation(_, part)) if part.claimed().tick > 0);
        let first = events.iter().position(is)?;
        events.truncate(first + 1);
        events.push(TraceEvent::ServerEnded);
        Some(())
    });
    assert!(cut.contains("the run ends in"), "a run has no end: {cut}");
}
