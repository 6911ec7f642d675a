//! The host of the agents of one process: joins them to a run, and serves them until it is over.
//!
//! The loop is the same over every [`ServerTransport`]; [`AgentProcess`] executes it step by step.
//! Wall time, which the transport provides, decides nothing but when to repeat a join, and when a
//! process without a server ends.
//!
//! **Liveness of the server.** The server answers a repeated join of an agent that it has accepted,
//! so the host uses joins as probes when it has received nothing for a while; if the silence lasts,
//! the process ends. So a busy or slow server is waited for, and a killed one is not waited for
//! indefinitely. Messages of other runs are ignored, except that the server of this run announces a
//! reset: then the agents are reset, too, with unexplored maps.
//!
//! **Joining as one.** A process joins as its lowest agent first, and as the others once that one
//! is accepted, or held by a process that may have to be replaced. So of two processes with the
//! same agents one gets all of them: if each got some, each would be refused for the rest and end,
//! and the ids would have no process.

mod authentication;
mod map_publisher;
mod message_pool;
mod options;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation as Part, Scenario};
use protocol::limits::PROTOCOL;
use protocol::signed::Signed;
use protocol::signing::SessionKey;

use crate::control_loop::{Agent, Reaction};
use crate::parameters;
use crate::transport::{Inbound, Level, ServerTransport};
use protocol::run_info::RunInfo;
use protocol::wire_error::WireError;

use authentication::Authentication;
pub use authentication::Credentials;
use map_publisher::PublishedMap;
use message_pool::MessagePool;
pub use options::{Options, RunError};

/// Wall time between two of the first attempts to join.
const JOIN_PERIOD: Duration = Duration::from_millis(200);

/// How many attempts those are; more follow each [`PROBE_PERIOD`], so that a team that is too large
/// for them to be answered in time does not make it worse.
const QUICK_JOINS: u32 = 5;

/// Wall time without messages after which the server is probed, and between two probes.
const PROBE_PERIOD: Duration = Duration::from_secs(1);

/// Wall time without messages, once another run has been announced, after which the joined run is
/// taken to be over; the default time limit of servers for a decision.
const SUPERSEDED_TIMEOUT: Duration = Duration::from_secs(10);

/// Longest wall time between two polls that counts as silence: more means that this process was
/// busy or suspended.
const POLL_GAP_MAX: Duration = Duration::from_millis(200);

/// Wall time to wait for a message before other duties.
const RECEIVE_TIMEOUT: Duration = Duration::from_millis(50);

/// Messages that are not authentic and are reported; further ones are only counted.
const IGNORED_REPORTS_MAX: u64 = 5;

/// Hosts agents until the run is over or `stop` is set.
///
/// # Errors
/// If the server refuses an agent, violates the protocol or is gone, or the controller cannot be
/// built.
pub fn run(transport: &mut dyn ServerTransport, options: &Options, stop: &AtomicBool) -> Result<(), RunError> {
    let mut process = AgentProcess::new(transport, options.clone());
    while !stop.load(Ordering::Relaxed) && process.step()?.is_continue() {}
    Ok(())
}

/// The process of some agents, executed step by step; [`run`] repeats the steps.
pub struct AgentProcess<T> {
    options: Options,
    stage: Stage<T>,
}

/// What a process does at present.
enum Stage<T> {
    /// It waits for the scenario of a run.
    Waiting(T),
    Serving(Box<Host<T>>),
    /// The run is over, or the process has failed.
    Over,
}

impl<T: ServerTransport> AgentProcess<T> {
    /// A process that has not heard of a run yet.
    #[must_use]
    pub fn new(transport: T, options: Options) -> Self {
        Self { options, stage: Stage::Waiting(transport) }
    }

    /// Its transport, until the run is over.
    pub fn transport(&self) -> Option<&T> {
        match &self.stage {
            Stage::Waiting(transport) => Some(transport),
            Stage::Serving(host) => Some(&host.transport),
            Stage::Over => None,
        }
    }

    /// Handles the next message, or what is due after a wait without one: receives once from the
    /// transport. Breaks when the run is over.
    ///
    /// # Errors
    /// See [`run`].
    pub fn step(&mut self) -> Result<ControlFlow<()>, RunError> {
        self.stage = match std::mem::replace(&mut self.stage, Stage::Over) {
            Stage::Waiting(mut transport) => match transport.receive(RECEIVE_TIMEOUT) {
                // The scenario of a replayed recording is ignored.
                Some(Inbound::Scenario(scenario)) if scenario.run != Scenario::NO_RUN => {
                    Stage::Serving(Box::new(Host::new(transport, &self.options, &scenario, BTreeMap::new())?))
                }
                _ => Stage::Waiting(transport),
            },
            Stage::Serving(mut host) => {
                let served = host.step();
                if let Err(error) = &served {
                    host.log_for_all(Level::Error, &error.to_string());
                }
                served?;
                match host.next.take() {
                    Some(scenario) => {
                        let published = host.published();
                        Stage::Serving(Box::new(Host::new(host.transport, &self.options, &scenario, published)?))
                    }
                    None if host.agents.is_empty() => Stage::Over,
                    None => Stage::Serving(host),
                }
            }
            Stage::Over => Stage::Over,
        };
        Ok(match self.stage {
            Stage::Over => ControlFlow::Break(()),
            Stage::Waiting(_) | Stage::Serving(_) => ControlFlow::Continue(()),
        })
    }
}

/// The agents of this process that are still running.
struct Host<T> {
    transport: T,
    run: u64,
    origin: u64,
    /// The scenario after a reset.
    next: Option<Scenario>,
    /// Another run that has been announced.
    other_run: Option<u64>,
    instance: u64,
    authentication: Authentication,
    chaos_delay: Duration,
    server_timeout: Duration,
    agents: BTreeMap<AgentId, HostedAgent>,
    messages: MessagePool,
    joined_last: Option<Instant>,
    /// Attempts to join since the first one, or since the lowest agent is decided.
    attempts: u32,
    /// Duration without messages from the server.
    silence: Duration,
    polled_at: Instant,
    /// How long to wait for the next message.
    timeout: Duration,
    map_hz: f64,
    /// Messages that were not authentic.
    ignored: u64,
    /// The first reply without the proof of the server, while no other was received.
    unproven: Option<RunError>,
}

struct HostedAgent {
    agent: Agent,
    /// Its controller with the settings.
    label: String,
    is_accepted: bool,
    /// Whether another process holds its id, and may be replaced by this one.
    is_held: bool,
    /// `None`: messages are not signed.
    key: Option<SessionKey>,
    published: PublishedMap,
}

impl<T: ServerTransport> Host<T> {
    /// `published` is the state of the published maps, kept over a reset.
    fn new(
        mut transport: T,
        options: &Options,
        scenario: &Scenario,
        mut published: BTreeMap<AgentId, PublishedMap>,
    ) -> Result<Self, RunError> {
        if scenario.protocol != PROTOCOL {
            return Err(RunError::WrongProtocol { got: scenario.protocol });
        }
        let mut agents = BTreeMap::new();
        for &id in &options.agents {
            let wrong = |source: WireError| RunError::Agent { agent: id, source: source.into() };
            let run_info = RunInfo::from_message(scenario, id).map_err(wrong)?;
            let (name, settings) = options.decides(&run_info.controller, &run_info.settings);
            let resolved = options.registry.resolve_settings(name, &settings)?;
            let label = if settings.is_empty() { name.to_owned() } else { format!("{name} {}", settings.join(" ")) };
            if id.0 >= run_info.agents {
                let reason = format!("this run has agents 0 to {}", run_info.agents.saturating_sub(1));
                return Err(RunError::Refused { agent: id, reason });
            }
            let mut controller = options.registry.build(name, &settings, id, &run_info)?;
            if let Some(times) = &options.decision_times {
                controller = times.of(controller);
            }
            let published = published.remove(&id).unwrap_or_else(|| PublishedMap::new(run_info.extent));
            let follows_scenario = label == run_info.controller_label();
            let times = options.decision_times.clone();
            let successors = options.registry.successors(id, follows_scenario, times);
            transport.declare_parameters(id, parameters::of_controller(name, &resolved));
            let agent = Agent::new(id, run_info, controller).with_successors(successors);
            agents.insert(id, HostedAgent { agent, label, is_accepted: false, is_held: false, key: None, published });
        }
        let Options { instance, chaos_delay, server_timeout, .. } = *options;
        let polled_at = transport.now();
        Ok(Self {
            transport,
            run: scenario.run,
            origin: scenario.origin,
            next: None,
            other_run: None,
            instance,
            authentication: Authentication::new(options.credentials.clone(), scenario),
            chaos_delay,
            server_timeout,
            agents,
            messages: MessagePool::default(),
            joined_last: None,
            attempts: 0,
            silence: Duration::ZERO,
            polled_at,
            timeout: RECEIVE_TIMEOUT,
            map_hz: options.map_hz,
            ignored: 0,
            unproven: None,
        })
    }

    /// Joins if that is due, handles one message, and does what else is due.
    fn step(&mut self) -> Result<(), RunError> {
        self.join();
        if let Some(message) = self.transport.receive(self.timeout) {
            self.handle(message)?;
        }
        self.timeout = self.publish_maps();
        self.check_server_silence()
    }

    /// Repeats joins until all agents are accepted, the lowest one first; after that, probes a
    /// silent server.
    fn join(&mut self) {
        let is_first_decided = self.agents.values().next().is_some_and(|hosted| hosted.is_accepted || hosted.is_held);
        let is_joining = self.agents.values().any(|hosted| !hosted.is_accepted);
        let is_server_silent = self.silence >= PROBE_PERIOD || self.other_run.is_some();
        let now = self.transport.now();
        let period = if is_joining && self.attempts < QUICK_JOINS { JOIN_PERIOD } else { PROBE_PERIOD };
        if !(is_joining || is_server_silent) || self.joined_last.is_some_and(|last| now.duration_since(last) < period) {
            return;
        }
        let addressed = if is_first_decided { self.agents.len() } else { 1 };
        for (id, hosted) in self.agents.iter().take(addressed).filter(|(_, hosted)| !(is_joining && hosted.is_accepted))
        {
            let last_tick = hosted.agent.last_tick().map_or(Join::NONE, |tick| tick.0);
            let join = join(self.run, *id, self.instance, &hosted.label, last_tick);
            self.transport.send_join(&self.authentication.join(join, self.transport.source()));
        }
        self.joined_last = Some(now);
        self.attempts += 1;
    }

    fn handle(&mut self, message: Inbound) -> Result<(), RunError> {
        let run = match &message {
            Inbound::Scenario(scenario) => scenario.run,
            Inbound::JoinReply(reply) => reply.run,
            Inbound::Observation(part) => part.claimed().run,
        };
        if run != self.run {
            match message {
                Inbound::Scenario(scenario) if scenario.origin == self.origin && run > self.run => {
                    self.next = Some(scenario);
                }
                Inbound::Scenario(_) if run != Scenario::NO_RUN => self.other_run = Some(run),
                _ => {}
            }
            return Ok(());
        }
        self.silence = Duration::ZERO;
        match message {
            Inbound::Scenario(_) => Ok(()),
            Inbound::JoinReply(reply) => self.handle_reply(reply),
            Inbound::Observation(part) => self.handle_observation(part),
        }
    }

    /// Adds to the silence, and gives up if it has lasted too long.
    fn check_server_silence(&mut self) -> Result<(), RunError> {
        let polled_at = self.transport.now();
        self.silence += polled_at.duration_since(self.polled_at).min(POLL_GAP_MAX);
        self.polled_at = polled_at;
        match self.other_run {
            Some(other) if self.silence >= self.server_timeout.min(SUPERSEDED_TIMEOUT) => {
                Err(RunError::Superseded { run: self.run, other })
            }
            _ if self.silence >= self.server_timeout && self.unproven.is_some() => {
                self.unproven.take().map_or(Ok(()), Err)
            }
            _ if self.silence >= self.server_timeout => {
                Err(RunError::ServerSilent { run: self.run, seconds: self.server_timeout.as_secs_f64() })
            }
            _ => Ok(()),
        }
    }

    fn handle_reply(&mut self, reply: JoinReply) -> Result<(), RunError> {
        let agent = AgentId(reply.agent);
        // The others need not wait for the next repetition once this one is decided.
        let leads_others = self.agents.len() > 1 && self.agents.keys().next() == Some(&agent);
        let Some(hosted) = self.agents.get_mut(&agent).filter(|_| reply.instance == self.instance) else {
            return Ok(());
        };
        let join = join(self.run, agent, self.instance, &hosted.label, Join::NONE);
        let claimed = if reply.accepted { "accepted".to_owned() } else { reply.reason.clone() };
        let Ok((reply, key)) = self.authentication.verify_reply(reply, join, self.transport.source()) else {
            let unproven = RunError::Unproven { agent, reason: claimed };
            self.ignore(agent, &unproven.to_string());
            self.unproven.get_or_insert(unproven);
            return Ok(());
        };
        if reply.code == JoinReply::HELD {
            let is_new = !std::mem::replace(&mut hosted.is_held, true);
            if leads_others && is_new {
                (self.joined_last, self.attempts) = (None, 0);
            }
            return Ok(());
        }
        if !reply.accepted {
            let JoinReply { code, reason, .. } = reply.into_inner();
            return Err(match code {
                JoinReply::OVERTAKEN => RunError::Overtaken { agent, reason },
                _ => RunError::Refused { agent, reason },
            });
        }
        self.unproven = None;
        if !std::mem::replace(&mut hosted.is_accepted, true) {
            hosted.key = key;
            if leads_others {
                (self.joined_last, self.attempts) = (None, 0);
            }
            self.transport.log(agent, Level::Info, &format!("has joined with {}", hosted.label));
        }
        Ok(())
    }

    fn handle_observation(&mut self, part: Signed<Part>) -> Result<(), RunError> {
        let &Part { agent, tick, .. } = part.claimed();
        let id = AgentId(agent);
        let is_one_of_several = self.agents.len() > 1;
        let Some(hosted) = self.agents.get_mut(&id).filter(|hosted| hosted.is_accepted) else {
            return Ok(());
        };
        let Ok(mut part) = part.verify_with(hosted.key.as_ref()) else {
            self.ignore(id, &format!("an observation of tick {tick} that the server has not signed is ignored"));
            return Ok(());
        };
        if is_one_of_several {
            part = part.map(|mut part| {
                self.messages.share(&mut part);
                part
            });
        }
        let reaction = hosted.agent.take(part).map_err(|source| RunError::Agent { agent: id, source })?;
        if let Some(source) = hosted.agent.failure() {
            return Err(RunError::Failed { agent: id, source });
        }
        match reaction {
            Reaction::None => {}
            Reaction::Reply(command) => self.answer(id, command),
            Reaction::Acknowledge(acknowledgement) => {
                self.answer(id, acknowledgement);
                self.publish_rest(id);
                self.transport.log(id, Level::Info, "the run is over");
                if let Some(hosted) = self.agents.remove(&id) {
                    self.transport.ended(id, hosted.agent.map());
                }
            }
        }
        Ok(())
    }

    /// Counts a message that is not authentic, and reports the first ones.
    fn ignore(&mut self, agent: AgentId, text: &str) {
        self.ignored += 1;
        if self.ignored <= IGNORED_REPORTS_MAX {
            self.transport.log(agent, Level::Warn, text);
        }
    }

    fn answer(&mut self, agent: AgentId, command: Command) {
        if !self.chaos_delay.is_zero() {
            wait_up_to(self.chaos_delay);
        }
        let command = Command { run: self.run, ..command };
        let key = self.agents.get(&agent).and_then(|hosted| hosted.key.as_ref());
        self.transport.send_command(&Signed::sign_with(command, key));
    }
}

fn join(run: u64, agent: AgentId, instance: u64, label: &str, last_tick: u64) -> Join {
    let controller = label.to_owned();
    Join { run, agent: agent.0, instance, protocol: PROTOCOL, controller, last_tick }
}

#[expect(clippy::disallowed_methods, reason = "disturbing the wall time is what this is for")]
fn wait_up_to(longest: Duration) {
    // Without random numbers from the system there is no delay.
    let share = f64::from(getrandom::u32().unwrap_or(0)) / f64::from(u32::MAX);
    std::thread::sleep(longest.mul_f64(share));
}

#[cfg(test)]
mod tests;
