//! The agents of one process over a link: join, answer until the run is over.
//!
//! The loop is the same over every [`Link`]. Wall time decides nothing but when to ask again to take part.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::ids::AgentId;
use msgs::limits::PROTOCOL;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation as Part, Scenario};
use thiserror::Error;

use crate::agent::{Agent, Reaction};
use crate::controllers::{self, ControllerError};
use crate::link::{Inbound, Link};
use crate::wire::{self, WireError};

/// Wall time between two attempts to join.
const JOIN_PERIOD: Duration = Duration::from_millis(200);

/// Wall time for which the loop waits for a message before it looks at its other duties.
const PATIENCE: Duration = Duration::from_millis(50);

/// What a process is to run.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Its agents.
    pub agents: Vec<AgentId>,
    /// What they run, if not what the scenario says.
    pub controller: Option<String>,
    /// Settings `KEY=VALUE`; they come after those of the scenario, which hold for the scenario's controller only.
    pub settings: Vec<String>,
    /// A number that no other process has.
    pub instance: u64,
    /// Waits up to so long, at random, before each answer: a test of the lock-step.
    pub chaos_delay: Duration,
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
/// If the server refuses an agent or breaks the protocol, or there is no such controller.
pub fn run(link: &mut dyn Link, options: &Options, stop: &AtomicBool) -> Result<(), RunError> {
    let Some(scenario) = scenario(link, stop) else {
        return Ok(());
    };
    let mut process = Process::new(link, options, &scenario)?;
    while !process.seats.is_empty() && !stop.load(Ordering::Relaxed) {
        process.join();
        if let Some(message) = process.link.receive(PATIENCE) {
            process.handle(message)?;
        }
    }
    Ok(())
}

/// Waits for the scenario.
fn scenario(link: &mut dyn Link, stop: &AtomicBool) -> Option<Scenario> {
    while !stop.load(Ordering::Relaxed) {
        if let Some(Inbound::Scenario(scenario)) = link.receive(PATIENCE) {
            return Some(scenario);
        }
    }
    None
}

/// The agents of this process that are not done.
struct Process<'a> {
    link: &'a mut dyn Link,
    instance: u64,
    chaos_delay: Duration,
    label: String,
    seats: BTreeMap<AgentId, Seat>,
    joined_last: Option<Instant>,
}

struct Seat {
    agent: Agent,
    is_accepted: bool,
}

impl<'a> Process<'a> {
    fn new(link: &'a mut dyn Link, options: &Options, scenario: &Scenario) -> Result<Self, RunError> {
        let wrong = |source| RunError::Wire { agent: options.agents.first().copied().unwrap_or_default(), source };
        let briefing = wire::briefing(scenario).map_err(wrong)?;
        let name = options.controller.as_ref().unwrap_or(&briefing.controller);
        let mut settings = if *name == briefing.controller { briefing.settings.clone() } else { Vec::new() };
        settings.extend(options.settings.iter().cloned());
        let mut seats = BTreeMap::new();
        for &id in &options.agents {
            if id.0 >= briefing.agents {
                let reason = format!("this run has agents 0 to {}", briefing.agents.saturating_sub(1));
                return Err(RunError::Refused { agent: id, reason });
            }
            let controller = controllers::build(name, &settings, id, briefing.agents_seed)?;
            let agent = Agent::new(id, briefing.clone(), controller);
            seats.insert(id, Seat { agent, is_accepted: false });
        }
        let label = if settings.is_empty() { name.clone() } else { format!("{name} {}", settings.join(" ")) };
        let Options { instance, chaos_delay, .. } = *options;
        Ok(Self { link, instance, chaos_delay, label, seats, joined_last: None })
    }

    /// Asks to take part, now and then, until all agents are accepted.
    fn join(&mut self) {
        if self.joined_last.is_some_and(|last| last.elapsed() < JOIN_PERIOD) {
            return;
        }
        for (id, seat) in self.seats.iter().filter(|(_, seat)| !seat.is_accepted) {
            self.link.join(&Join {
                agent: id.0,
                instance: self.instance,
                protocol: PROTOCOL,
                controller: self.label.clone(),
                last_tick: seat.agent.last_tick().map_or(Join::NONE, |tick| tick.0),
            });
        }
        self.joined_last = Some(now());
    }

    fn handle(&mut self, message: Inbound) -> Result<(), RunError> {
        match message {
            Inbound::Scenario(_) => Ok(()),
            Inbound::JoinReply(reply) => self.handle_reply(reply),
            Inbound::Observation(part) => self.handle_observation(part),
        }
    }

    fn handle_reply(&mut self, reply: JoinReply) -> Result<(), RunError> {
        let JoinReply { agent, instance, accepted, reason } = reply;
        let agent = AgentId(agent);
        if instance == self.instance
            && let Some(seat) = self.seats.get_mut(&agent)
        {
            if !accepted {
                return Err(RunError::Refused { agent, reason });
            }
            seat.is_accepted = true;
        }
        Ok(())
    }

    fn handle_observation(&mut self, part: Part) -> Result<(), RunError> {
        let id = AgentId(part.agent);
        let Some(seat) = self.seats.get_mut(&id).filter(|seat| seat.is_accepted) else {
            return Ok(());
        };
        match seat.agent.take(part).map_err(|source| RunError::Wire { agent: id, source })? {
            Reaction::None => {}
            Reaction::Answer(command) => self.answer(&command),
            Reaction::Farewell(receipt) => {
                self.answer(&receipt);
                self.seats.remove(&id);
            }
        }
        Ok(())
    }

    fn answer(&mut self, command: &Command) {
        if !self.chaos_delay.is_zero() {
            wait_up_to(self.chaos_delay);
        }
        self.link.answer(command);
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
