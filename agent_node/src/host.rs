//! The agents of one process over a link: join, answer until the run is over.
//!
//! The loop is the same over every [`Link`]. Wall time decides nothing but when to ask again to take part, and when a process
//! whose server is gone ends.
//!
//! **Whether the server is there.** A server answers a join of an agent that it has accepted once more, so a process that has heard
//! nothing for a while asks in this way. Silence that lasts ends the process. So a server that is busy, or held back to a slow
//! pace, is waited for, and one that was killed is not waited for until somebody looks after its agents. Messages of another run
//! than the one that was joined have no effect, except that of its own server which says that it begins again: then the agents
//! begin again, too, and know nothing.

mod map_publisher;

use std::collections::BTreeMap;
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

/// Wall time of silence after which the server is asked for a sign of life, and between two such questions.
const PROBE_PERIOD: Duration = Duration::from_secs(1);

/// Wall time of silence, once a server has announced another run, after which the one that was joined is taken to be over; what
/// servers allow for a decision by default.
const SUPERSEDED_TIMEOUT: Duration = Duration::from_secs(10);

/// Wall time between two looks at the link that counts as silence, at the most: more means that this process was busy or stopped.
const POLL_GAP_MAX: Duration = Duration::from_millis(200);

/// Wall time for which the loop waits for a message before it looks at its other duties.
const RECEIVE_TIMEOUT: Duration = Duration::from_millis(50);

/// What a process is to run.
#[derive(Debug, Clone)]
pub struct Options {
    /// Its agents.
    pub agents: Vec<AgentId>,
    /// What they run, if not what the scenario says.
    pub controller: Option<String>,
    /// Settings `KEY=VALUE`; they come after those of the scenario, which hold for the scenario's controller only.
    pub settings: Vec<String>,
    /// A number that no other process has.
    pub instance: u64,
    /// Wall time of silence after which the server is taken to be gone.
    pub server_timeout: Duration,
    /// Waits up to so long, at random, before each answer: a test of the lock-step.
    pub chaos_delay: Duration,
    /// Looks at what has changed of a map in a second of wall time at the most, while somebody wants to see it.
    pub map_hz: f64,
    /// Where to note how long decisions take.
    pub decision_times: Option<DecisionTimes>,
}

/// Why agents cannot go on.
#[derive(Debug, Error)]
pub enum RunError {
    /// The run does not want them.
    #[error("agent {agent} was refused by the server: {reason}")]
    Refused {
        /// Who.
        agent: AgentId,
        /// Why.
        reason: String,
    },
    /// The server does not even say that it is there.
    #[error("the server of run {run:016x} has said nothing for {seconds} s; it seems to be gone")]
    ServerSilent {
        /// Number of the run.
        run: u64,
        /// How long, wall time.
        seconds: f64,
    },
    /// The server does not even say that it is there, and there is another one.
    #[error(
        "a server has announced run {other:016x}, and that of run {run:016x}, which was joined, has not ended it and is silent"
    )]
    Superseded {
        /// Number of the run that was joined.
        run: u64,
        /// Number of the other one.
        other: u64,
    },
    /// There is no such controller.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The server does not keep to the protocol.
    #[error("agent {agent}: {source}")]
    Wire {
        /// Who.
        agent: AgentId,
        /// What is wrong.
        source: WireError,
    },
}

/// Runs agents until the run is over or `stop` is set.
///
/// # Errors
/// If the server refuses an agent, breaks the protocol or is gone, or there is no such controller.
pub fn run(transport: &mut dyn ServerTransport, options: &Options, stop: &AtomicBool) -> Result<(), RunError> {
    let mut next = scenario(transport, stop);
    let mut published = BTreeMap::new();
    while let Some(scenario) = next {
        let mut host = Host::new(transport, options, &scenario, published)?;
        let served = host.serve(stop);
        if let Err(error) = &served {
            host.log_for_all(Level::Error, &error.to_string());
        }
        next = served?;
        published = host.published();
    }
    Ok(())
}

/// Waits for the scenario of a run; that of a recording which is played is none.
fn scenario(transport: &mut dyn ServerTransport, stop: &AtomicBool) -> Option<Scenario> {
    while !stop.load(Ordering::Relaxed) {
        if let Some(Inbound::Scenario(scenario)) = transport.receive(RECEIVE_TIMEOUT)
            && scenario.run != Scenario::NO_RUN
        {
            return Some(scenario);
        }
    }
    None
}

/// The agents of this process that are not done.
struct Host<'a> {
    transport: &'a mut dyn ServerTransport,
    run: u64,
    origin: u64,
    /// The same run, begun again.
    next: Option<Scenario>,
    /// Another run that a server has announced.
    other_run: Option<u64>,
    instance: u64,
    chaos_delay: Duration,
    server_timeout: Duration,
    label: String,
    agents: BTreeMap<AgentId, HostedAgent>,
    joined_last: Option<Instant>,
    /// For how long nothing has been heard of the server.
    silence: Duration,
    polled_at: Instant,
    map_hz: f64,
}

struct HostedAgent {
    agent: Agent,
    is_accepted: bool,
    published: PublishedMap,
}

impl<'a> Host<'a> {
    /// `shown` is what was shown of the agents in a run that has begun again.
    fn new(
        transport: &'a mut dyn ServerTransport,
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
            polled_at: now(),
            map_hz: options.map_hz,
        })
    }

    /// Takes part until the run is over or `stop` is set; or until it begins again, as what it gives out.
    fn serve(&mut self, stop: &AtomicBool) -> Result<Option<Scenario>, RunError> {
        let mut timeout = RECEIVE_TIMEOUT;
        while !self.agents.is_empty() && self.next.is_none() && !stop.load(Ordering::Relaxed) {
            self.join();
            if let Some(message) = self.transport.receive(timeout) {
                self.handle(message)?;
            }
            timeout = self.publish_maps();
            self.check_server_silence()?;
        }
        Ok(self.next.take())
    }

    /// Asks to take part, now and then, until all agents are accepted; after that, asks a silent server for a sign of life.
    fn join(&mut self) {
        let is_joining = self.agents.values().any(|hosted| !hosted.is_accepted);
        let is_server_silent = self.silence >= PROBE_PERIOD || self.other_run.is_some();
        let period = if is_joining { JOIN_PERIOD } else { PROBE_PERIOD };
        if !(is_joining || is_server_silent) || self.joined_last.is_some_and(|last| last.elapsed() < period) {
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
        self.joined_last = Some(now());
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

    /// Counts the silence, and gives up if it has lasted too long.
    fn check_server_silence(&mut self) -> Result<(), RunError> {
        let polled_at = now();
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
    // A delay of zero is as good as any other if the system has no random numbers to give.
    let share = f64::from(getrandom::u32().unwrap_or(0)) / f64::from(u32::MAX);
    std::thread::sleep(longest.mul_f64(share));
}

#[expect(clippy::disallowed_methods, reason = "joining again is a matter of wall time; no result hangs on it")]
fn now() -> Instant {
    Instant::now()
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

    /// The first run of a server, begun again.
    fn begun_again(origin: u64, run: u64) -> Inbound {
        let Inbound::Scenario(scenario) = scenario(run) else { unreachable!("it is one") };
        Inbound::Scenario(Scenario { origin, ..scenario })
    }

    fn observation(run: u64, phase: u8) -> Inbound {
        Inbound::Observation(Part { run, phase, parts: 1, ..Part::default() })
    }

    /// A server that says these things, and answers so many joins.
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
    fn what_another_run_says_has_no_effect() {
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
        // Whatever the other run says is heard in no time.
        server.runs().unwrap_or_else(|error| panic!("{error}"));
        assert!(server.joins.iter().all(|join| join.run == OURS));
        assert_eq!(server.answers.iter().map(|command| command.run).collect::<Vec<_>>(), [OURS; 2]);
    }

    #[test]
    fn a_run_that_begins_again_is_joined_again() {
        let mut server = Server::saying(
            vec![
                scenario(OURS),
                observation(OURS, Part::RUNNING),
                begun_again(OURS, OURS + 5),
                observation(OURS, Part::RUNNING),
                // What was said before it, late.
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
    fn a_server_that_is_gone_is_not_waited_for() {
        let mut server = Server::saying(vec![scenario(OURS), observation(OURS, Part::RUNNING)], 1);
        let error = server.runs().unwrap_err();
        assert!(matches!(error, RunError::ServerSilent { run: OURS, .. }), "{error}");
        let mut server = Server::saying(vec![scenario(OURS), scenario(OTHER)], 1);
        let error = server.runs().unwrap_err();
        assert!(matches!(error, RunError::Superseded { run: OURS, other: OTHER }), "{error}");
    }
}
