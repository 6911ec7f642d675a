//! The host of the agents of one process: joins them to a run, and serves them until it is over.
//!
//! The loop is the same over every [`ServerTransport`]; [`AgentProcess`] executes it step by step.
//! Wall time, which the transport tells, decides nothing but when to repeat a join, and when a
//! process without a server ends.
//!
//! **Liveness of the server.** The server answers a repeated join of an agent that it has accepted,
//! so the host uses joins as probes when it has received nothing for a while; if the silence lasts,
//! the process ends. So a busy or slow server is waited for, and a killed one is not waited for
//! indefinitely. Messages of other runs are ignored, except that the server of this run announces a
//! reset: then the agents are reset, too, with unexplored maps.

mod map_publisher;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::ids::AgentId;
use msgs::limits::PROTOCOL;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation as Part, Scenario};
use thiserror::Error;

use crate::agent::{Agent, Reaction};
use crate::controllers::{self, ControllerError};
use crate::parameters;
use crate::stopwatch::DecisionTimes;
use crate::transport::{Inbound, Level, ServerTransport};
use crate::wire::{self, WireError};

use map_publisher::PublishedMap;

/// Wall time between two attempts to join.
const JOIN_PERIOD: Duration = Duration::from_millis(200);

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

/// The options of a process.
#[derive(Debug, Clone)]
pub struct Options {
    /// The agents of this process.
    pub agents: Vec<AgentId>,
    /// The controller, instead of the one of the scenario.
    pub controller: Option<String>,
    /// Settings `KEY=VALUE`, after those of the scenario, which apply to the scenario's controller
    /// only.
    pub settings: Vec<String>,
    /// A number unique to this process.
    pub instance: u64,
    /// Wall time without messages after which the server is taken to be gone.
    pub server_timeout: Duration,
    /// Longest random delay before each reply: a test of the lock-step.
    pub chaos_delay: Duration,
    /// Greatest rate of map updates while a map has subscribers, Hz of wall time.
    pub map_hz: f64,
    /// Where to log the wall time of decisions.
    pub decision_times: Option<DecisionTimes>,
}

/// Why a host ends with an error.
#[derive(Debug, Error)]
pub enum RunError {
    /// The server refuses an agent.
    #[error("agent {agent} was refused by the server: {reason}")]
    Refused {
        /// The agent.
        agent: AgentId,
        /// The reason that the server gives.
        reason: String,
    },
    /// The server is silent.
    #[error("the server of run {run:016x} has been silent for {seconds} s; it seems to be gone")]
    ServerSilent {
        /// Id of the run.
        run: u64,
        /// Duration of the silence, seconds of wall time.
        seconds: f64,
    },
    /// The server is silent, and another run has been announced.
    #[error("the server of run {run:016x} is silent and has not ended it, and run {other:016x} has been announced")]
    Superseded {
        /// Id of the joined run.
        run: u64,
        /// Id of the other run.
        other: u64,
    },
    /// The controller or a setting is unknown or illegal.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The server violates the protocol.
    #[error("agent {agent}: {source}")]
    Wire {
        /// The agent.
        agent: AgentId,
        /// The violation.
        source: WireError,
    },
}

/// Hosts agents until the run is over or `stop` is set.
///
/// # Errors
/// If the server refuses an agent, violates the protocol or is gone, or the controller cannot be
/// built.
pub fn run(transport: &mut dyn ServerTransport, options: &Options, stop: &AtomicBool) -> Result<(), RunError> {
    let mut process = AgentProcess::new(Box::new(transport), options.clone());
    while !stop.load(Ordering::Relaxed) && process.step()?.is_continue() {}
    Ok(())
}

/// The process of some agents, executed step by step; [`run`] repeats the steps.
pub struct AgentProcess<'a> {
    options: Options,
    stage: Stage<'a>,
}

/// What a process does at present.
enum Stage<'a> {
    /// It waits for the scenario of a run.
    Waiting(Box<dyn ServerTransport + 'a>),
    Serving(Host<'a>),
    /// The run is over, or the process has failed.
    Over,
}

impl<'a> AgentProcess<'a> {
    /// A process that has not heard of a run yet.
    #[must_use]
    pub fn new(transport: Box<dyn ServerTransport + 'a>, options: Options) -> Self {
        Self { options, stage: Stage::Waiting(transport) }
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
                    Stage::Serving(Host::new(transport, &self.options, &scenario, BTreeMap::new())?)
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
                        Stage::Serving(Host::new(host.transport, &self.options, &scenario, published)?)
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
struct Host<'a> {
    transport: Box<dyn ServerTransport + 'a>,
    run: u64,
    origin: u64,
    /// The scenario after a reset.
    next: Option<Scenario>,
    /// Another run that has been announced.
    other_run: Option<u64>,
    instance: u64,
    chaos_delay: Duration,
    server_timeout: Duration,
    label: String,
    agents: BTreeMap<AgentId, HostedAgent>,
    joined_last: Option<Instant>,
    /// Duration without messages from the server.
    silence: Duration,
    polled_at: Instant,
    /// How long to wait for the next message.
    timeout: Duration,
    map_hz: f64,
}

struct HostedAgent {
    agent: Agent,
    is_accepted: bool,
    published: PublishedMap,
}

impl<'a> Host<'a> {
    /// `published` is the state of the published maps, kept over a reset.
    fn new(
        mut transport: Box<dyn ServerTransport + 'a>,
        options: &Options,
        scenario: &Scenario,
        mut published: BTreeMap<AgentId, PublishedMap>,
    ) -> Result<Self, RunError> {
        let wrong = |source| RunError::Wire { agent: options.agents.first().copied().unwrap_or_default(), source };
        let run_info = wire::run_info(scenario).map_err(wrong)?;
        let name = options.controller.as_ref().unwrap_or(&run_info.controller);
        let mut settings = if *name == run_info.controller { run_info.settings.clone() } else { Vec::new() };
        settings.extend(options.settings.iter().cloned());
        let resolved = controllers::resolve_settings(name, &settings)?;
        let mut agents = BTreeMap::new();
        for &id in &options.agents {
            if id.0 >= run_info.agents {
                let reason = format!("this run has agents 0 to {}", run_info.agents.saturating_sub(1));
                return Err(RunError::Refused { agent: id, reason });
            }
            let mut controller = controllers::build(name, &settings, id, run_info.agents_seed)?;
            if let Some(times) = &options.decision_times {
                controller = times.of(controller);
            }
            let published = published.remove(&id).unwrap_or_else(|| PublishedMap::new(run_info.extent));
            let agent = Agent::new(id, run_info.clone(), controller);
            agents.insert(id, HostedAgent { agent, is_accepted: false, published });
            transport.declare_parameters(id, parameters::of_controller(name, &resolved));
        }
        let label = if settings.is_empty() { name.clone() } else { format!("{name} {}", settings.join(" ")) };
        let Options { instance, chaos_delay, server_timeout, .. } = *options;
        let polled_at = transport.now();
        Ok(Self {
            transport,
            run: scenario.run,
            origin: scenario.origin,
            next: None,
            other_run: None,
            instance,
            chaos_delay,
            server_timeout,
            label,
            agents,
            joined_last: None,
            silence: Duration::ZERO,
            polled_at,
            timeout: RECEIVE_TIMEOUT,
            map_hz: options.map_hz,
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

    /// Repeats joins until all agents are accepted; after that, probes a silent server.
    fn join(&mut self) {
        let is_joining = self.agents.values().any(|hosted| !hosted.is_accepted);
        let is_server_silent = self.silence >= PROBE_PERIOD || self.other_run.is_some();
        let now = self.transport.now();
        let period = if is_joining { JOIN_PERIOD } else { PROBE_PERIOD };
        if !(is_joining || is_server_silent) || self.joined_last.is_some_and(|last| now.duration_since(last) < period) {
            return;
        }
        for (id, hosted) in self.agents.iter().filter(|(_, hosted)| !(is_joining && hosted.is_accepted)) {
            self.transport.send_join(&Join {
                run: self.run,
                agent: id.0,
                instance: self.instance,
                protocol: PROTOCOL,
                controller: self.label.clone(),
                last_tick: hosted.agent.last_tick().map_or(Join::NONE, |tick| tick.0),
            });
        }
        self.joined_last = Some(now);
    }

    fn handle(&mut self, message: Inbound) -> Result<(), RunError> {
        let run = match &message {
            Inbound::Scenario(scenario) => scenario.run,
            Inbound::JoinReply(reply) => reply.run,
            Inbound::Observation(part) => part.run,
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
            _ if self.silence >= self.server_timeout => {
                Err(RunError::ServerSilent { run: self.run, seconds: self.server_timeout.as_secs_f64() })
            }
            _ => Ok(()),
        }
    }

    fn handle_reply(&mut self, reply: JoinReply) -> Result<(), RunError> {
        let JoinReply { run: _, agent, instance, accepted, reason } = reply;
        let agent = AgentId(agent);
        if instance == self.instance
            && let Some(hosted) = self.agents.get_mut(&agent)
        {
            if !accepted {
                return Err(RunError::Refused { agent, reason });
            }
            if !std::mem::replace(&mut hosted.is_accepted, true) {
                self.transport.log(agent, Level::Info, &format!("takes part with {}", self.label));
            }
        }
        Ok(())
    }

    fn handle_observation(&mut self, part: Part) -> Result<(), RunError> {
        let id = AgentId(part.agent);
        let Some(hosted) = self.agents.get_mut(&id).filter(|hosted| hosted.is_accepted) else {
            return Ok(());
        };
        match hosted.agent.take(part).map_err(|source| RunError::Wire { agent: id, source })? {
            Reaction::None => {}
            Reaction::Reply(command) => self.answer(command),
            Reaction::Acknowledge(acknowledgement) => {
                self.answer(acknowledgement);
                self.publish_rest(id);
                self.transport.log(id, Level::Info, "the run is over");
                self.agents.remove(&id);
            }
        }
        Ok(())
    }

    fn answer(&mut self, command: Command) {
        if !self.chaos_delay.is_zero() {
            wait_up_to(self.chaos_delay);
        }
        self.transport.send_command(&Command { run: self.run, ..command });
    }
}

#[expect(clippy::disallowed_methods, reason = "disturbing the wall time is what this is for")]
fn wait_up_to(longest: Duration) {
    // Without random numbers from the system there is no delay.
    let share = f64::from(getrandom::u32().unwrap_or(0)) / f64::from(u32::MAX);
    std::thread::sleep(longest.mul_f64(share));
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: u64 = 7;
    const OTHER: u64 = 8;

    fn scenario(run: u64) -> Inbound {
        Inbound::Scenario(Scenario {
            run,
            size: [4, 4, 4],
            cell_m: 1.0,
            agents: 1,
            bodies: vec![msgs::maes_msgs::Body::default()],
            body_of: vec![0],
            controller: "rbw".to_owned(),
            origin: run,
            ..Scenario::default()
        })
    }

    /// The first run of a server, after a reset.
    fn begun_again(origin: u64, run: u64) -> Inbound {
        let Inbound::Scenario(scenario) = scenario(run) else { unreachable!("it is one") };
        Inbound::Scenario(Scenario { origin, ..scenario })
    }

    fn observation(run: u64, phase: u8) -> Inbound {
        Inbound::Observation(Part { run, phase, parts: 1, ..Part::default() })
    }

    /// A server that sends these messages, and accepts this many joins.
    struct Server {
        says: Vec<Inbound>,
        replies: usize,
        joins: Vec<Join>,
        answers: Vec<Command>,
    }

    impl Server {
        fn saying(says: Vec<Inbound>, replies: usize) -> Self {
            Self { says: says.into_iter().rev().collect(), replies, joins: Vec::new(), answers: Vec::new() }
        }

        fn runs(&mut self) -> Result<(), RunError> {
            let options = Options {
                agents: vec![AgentId(0)],
                controller: None,
                settings: Vec::new(),
                instance: 3,
                server_timeout: Duration::from_millis(1),
                chaos_delay: Duration::ZERO,
                map_hz: 5.0,
                decision_times: None,
            };
            run(self, &options, &AtomicBool::new(false))
        }
    }

    impl ServerTransport for Server {
        fn send_join(&mut self, join: &Join) {
            self.joins.push(join.clone());
            if self.replies > 0 {
                self.replies -= 1;
                let Join { run, agent, instance, .. } = *join;
                let reply = JoinReply { run, agent, instance, accepted: true, ..JoinReply::default() };
                self.says.push(Inbound::JoinReply(reply));
            }
        }

        fn send_command(&mut self, command: &Command) {
            self.answers.push(command.clone());
        }

        fn receive(&mut self, _timeout: Duration) -> Option<Inbound> {
            self.says.pop()
        }
    }

    #[test]
    fn messages_of_another_run_are_ignored() {
        let refusal = JoinReply { run: OTHER, instance: 3, ..JoinReply::default() };
        let mut server = Server::saying(
            vec![
                scenario(Scenario::NO_RUN),
                observation(Scenario::NO_RUN, Part::RUNNING),
                scenario(OURS),
                scenario(Scenario::NO_RUN),
                observation(Scenario::NO_RUN, Part::ENDED),
                Inbound::JoinReply(refusal),
                observation(OTHER, Part::ENDED),
                scenario(OTHER),
                observation(OTHER, Part::RUNNING),
                observation(OURS, Part::RUNNING),
                observation(OURS, Part::ENDED),
            ],
            1,
        );
        // Messages of the other run are ignored at once.
        server.runs().unwrap_or_else(|error| panic!("{error}"));
        assert!(server.joins.iter().all(|join| join.run == OURS));
        assert_eq!(server.answers.iter().map(|command| command.run).collect::<Vec<_>>(), [OURS; 2]);
    }

    #[test]
    fn reset_run_is_joined_again() {
        let mut server = Server::saying(
            vec![
                scenario(OURS),
                observation(OURS, Part::RUNNING),
                begun_again(OURS, OURS + 5),
                observation(OURS, Part::RUNNING),
                // A message from before the reset, late.
                begun_again(OURS, OURS + 4),
                observation(OURS + 5, Part::RUNNING),
                observation(OURS + 5, Part::ENDED),
            ],
            1,
        );
        server.replies = 2;
        server.runs().unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(
            server.joins.iter().map(|join| (join.run, join.last_tick)).collect::<Vec<_>>(),
            [(OURS, Join::NONE), (OURS + 5, Join::NONE)]
        );
        let answers: Vec<u64> = server.answers.iter().map(|command| command.run).collect();
        assert_eq!(answers, [OURS, OURS + 5, OURS + 5]);
    }

    #[test]
    fn silent_server_ends_the_process() {
        let mut server = Server::saying(vec![scenario(OURS), observation(OURS, Part::RUNNING)], 1);
        let error = server.runs().unwrap_err();
        assert!(matches!(error, RunError::ServerSilent { run: OURS, .. }), "{error}");
        let mut server = Server::saying(vec![scenario(OURS), scenario(OTHER)], 1);
        let error = server.runs().unwrap_err();
        assert!(matches!(error, RunError::Superseded { run: OURS, other: OTHER }), "{error}");
    }
}
