//! Verification of recorded commands: each agent is re-executed on its recorded observations, and
//! its commands are compared.
//!
//! Agents are re-executed independently and in parallel, because their observations are known. The
//! caller provides the agents, which this crate does not know.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, Observation, Scenario};
use msgs::{printable, topics};
use rayon::prelude::*;
use thiserror::Error;

use crate::comparison::{self, Difference};
use crate::recording::{Message, Recording};

/// Creates agents.
pub trait ControllerFactory: Sync {
    /// Creates an agent from the announced scenario and the controller of its join message: a name,
    /// followed by settings `KEY=VALUE`.
    ///
    /// # Errors
    /// The reason why there is no such agent here.
    fn agent(&self, announced: &Scenario, agent: AgentId, runs: &str) -> Result<Box<dyn AgentReplica>, String>;
}

/// A re-executed agent.
pub trait AgentReplica {
    /// Passes a fragment of an observation, and returns the command once there is one.
    ///
    /// # Errors
    /// The reason why it cannot continue.
    fn take(&mut self, part: Observation) -> Result<Option<Command>, String>;
}

/// The verified commands of a recording.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Checked {
    /// Number of equal commands.
    pub commands: u64,
    /// The agents checked.
    pub agents: Vec<AgentId>,
    /// The agents not checked, and why.
    pub unchecked: BTreeMap<AgentId, String>,
}

/// Why the commands of a recording do not verify.
#[derive(Debug, Error)]
pub enum ControllersError {
    /// A command differs.
    #[error("{file}: {difference}")]
    Different {
        file: String,
        /// The first difference.
        difference: Box<Difference>,
    },
    /// An agent does not accept its observations.
    #[error("{file}: tick {tick}, agent {agent}: {reason}")]
    Agent { file: String, tick: Tick, agent: AgentId, reason: String },
}

/// Observations and commands of one agent, in order.
#[derive(Debug, Default)]
struct AgentHistory {
    runs: String,
    messages: Vec<Message>,
}

/// Re-executes the agents of a recording, in all ticks before one.
///
/// # Errors
/// If a command differs; the first one by tick and agent is reported.
pub fn check(
    recording: &Recording,
    before: Tick,
    controllers: &dyn ControllerFactory,
) -> Result<Checked, ControllersError> {
    let (announced, histories) = histories(recording, before);
    let verdicts: Vec<(AgentId, Verdict)> = histories
        .into_par_iter()
        .map(|(agent, history)| (agent, check_agent(&announced, agent, &history, controllers)))
        .collect();
    let mut checked = Checked::default();
    let mut first: Option<(Tick, AgentId, Mismatch)> = None;
    for (agent, verdict) in verdicts {
        match verdict {
            Verdict::Same { commands } => {
                checked.commands += commands;
                checked.agents.push(agent);
            }
            Verdict::Unchecked { reason } => {
                checked.unchecked.insert(agent, reason);
            }
            // Agents come in order, so the first of two in one tick stays.
            Verdict::Mismatch { tick, mismatch } if first.as_ref().is_none_or(|(first, ..)| tick < *first) => {
                first = Some((tick, agent, mismatch));
            }
            Verdict::Mismatch { .. } => {}
        }
    }
    let file = recording.file().to_owned();
    match first {
        None => Ok(checked),
        Some((_, _, Mismatch::Command(difference))) => Err(ControllersError::Different { file, difference }),
        Some((tick, agent, Mismatch::Agent(reason))) => Err(ControllersError::Agent { file, tick, agent, reason }),
    }
}

/// The announced scenario, and the history of each agent in all ticks before one.
fn histories(recording: &Recording, before: Tick) -> (Scenario, BTreeMap<AgentId, AgentHistory>) {
    let mut announced = Scenario::default();
    let mut histories: BTreeMap<AgentId, AgentHistory> = BTreeMap::new();
    for message in recording.messages().take_while(|message| message.tick() < before) {
        if message.channel.topic == topics::scenario().name {
            announced = message.decode().unwrap_or_default();
        }
        match message.of_agent() {
            Some((agent, "join")) => {
                histories.entry(agent).or_default().runs = message.decode().map_or_else(|_| String::new(), runs);
            }
            Some((agent, "observation" | "command")) => histories.entry(agent).or_default().messages.push(message),
            _ => {}
        }
    }
    (announced, histories)
}

fn runs(join: Join) -> String {
    join.controller
}

/// The outcome for one agent.
enum Verdict {
    Same { commands: u64 },
    Unchecked { reason: String },
    Mismatch { tick: Tick, mismatch: Mismatch },
}

/// Why an agent does not verify.
enum Mismatch {
    Command(Box<Difference>),
    Agent(String),
}

fn check_agent(
    announced: &Scenario,
    agent: AgentId,
    history: &AgentHistory,
    controllers: &dyn ControllerFactory,
) -> Verdict {
    let mut replica = match controllers.agent(announced, agent, &history.runs) {
        Ok(replica) => replica,
        Err(reason) => return Verdict::Unchecked { reason },
    };
    let mut commands = 0;
    let mut answer = None;
    for message in &history.messages {
        let tick = message.tick();
        if message.of_agent().is_some_and(|(_, topic)| topic == "command") {
            if let Some(difference) = comparison::compare_command(message, answer.take().as_ref()) {
                return Verdict::Mismatch { tick, mismatch: Mismatch::Command(Box::new(difference)) };
            }
            commands += 1;
            continue;
        }
        let part = message.decode().map_err(|error| error.to_string());
        match part.and_then(|part| replica.take(part)) {
            Ok(None) => {}
            Ok(Some(command)) => answer = Some(command),
            Err(reason) => return Verdict::Mismatch { tick, mismatch: Mismatch::Agent(reason) },
        }
    }
    Verdict::Same { commands }
}

/// The report for the user.
#[must_use]
pub fn text(checked: &Checked) -> String {
    let Checked { commands, agents, unchecked } = checked;
    let agents = if agents.len() == 1 { "1 agent".to_owned() } else { format!("{} agents", agents.len()) };
    let mut text = format!("{commands} commands of {agents} are those that the controllers decide");
    for (agent, reason) in unchecked {
        text += &format!("\nnot checked: agent {agent}: {}", printable::line(reason));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recorder::{Document, Recorder};
    use crate::recording::SCENARIO_ATTACHMENT;
    use msgs::cdr;

    /// Counts the fragments it receives.
    struct Counting(u32);

    impl AgentReplica for Counting {
        fn take(&mut self, part: Observation) -> Result<Option<Command>, String> {
            self.0 += 1;
            Ok(Some(command(part.agent, part.tick, self.0)))
        }
    }

    struct CountingFactory;

    impl ControllerFactory for CountingFactory {
        fn agent(&self, _announced: &Scenario, _agent: AgentId, runs: &str) -> Result<Box<dyn AgentReplica>, String> {
            if runs == "counting" { Ok(Box::new(Counting(0))) } else { Err(format!("{runs}: unknown")) }
        }
    }

    fn command(agent: u32, tick: u64, known_free: u32) -> Command {
        Command { agent, tick, known_free, stage: Command::EXPLORING, ..Command::default() }
    }

    /// Three agents and three ticks, with modified commands.
    fn recording(change: impl Fn(&mut Command)) -> Recording {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("run.mcap");
        let documents = [Document { name: SCENARIO_ATTACHMENT, media_type: "", data: b"" }];
        let mut recorder = Recorder::create(&file, &documents).unwrap();
        for (agent, controller) in [(0, "counting"), (1, "of a user"), (2, "counting")] {
            let join = Join { agent, controller: controller.to_owned(), ..Join::default() };
            recorder.write(&topics::join(AgentId(agent)), Tick::ZERO, &cdr::encode(&join)).unwrap();
        }
        for (tick, agent) in (0..3).flat_map(|tick| (0..3).map(move |agent| (tick, agent))) {
            let part = Observation { agent, tick, ..Observation::default() };
            let mut command = command(agent, tick, u32::try_from(tick).unwrap() + 1);
            change(&mut command);
            recorder.write(&topics::observation(AgentId(agent)), Tick(tick), &cdr::encode(&part)).unwrap();
            recorder.write(&topics::command(AgentId(agent)), Tick(tick), &cdr::encode(&command)).unwrap();
        }
        recorder.finish().unwrap();
        Recording::open(&file).unwrap()
    }

    #[test]
    fn known_controllers_are_re_executed() {
        let checked = check(&recording(|_| {}), Tick(3), &CountingFactory).unwrap();
        assert_eq!((checked.commands, checked.agents), (6, vec![AgentId(0), AgentId(2)]));
        assert_eq!(checked.unchecked[&AgentId(1)], "of a user: unknown");
    }

    #[test]
    fn first_different_command_is_named() {
        let changed = recording(|command| {
            if (command.tick, command.agent) >= (1, 2) {
                command.want_view = true;
            }
        });
        let refused = check(&changed, Tick(3), &CountingFactory).unwrap_err().to_string();
        assert!(refused.ends_with(": tick 1, agent 2, /agent_2/command: want_view was true and is false"), "{refused}");
        assert!(check(&changed, Tick(1), &CountingFactory).is_ok(), "later ticks are not checked");
    }

    #[test]
    fn a_stage_may_be_missing_and_not_another_one() {
        let checked = |stage| check(&recording(|command| command.stage = stage), Tick(3), &CountingFactory);
        assert_eq!(checked(Command::SAME).unwrap().commands, 6);
        let refused = checked(Command::WAITING).unwrap_err().to_string();
        assert!(refused.ends_with(": tick 0, agent 0, /agent_0/command: stage was 4 and is 1"), "{refused}");
    }
}
