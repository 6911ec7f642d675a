//! Verification of recorded commands: each agent is re-executed on its recorded observations, and
//! its commands are compared.
//!
//! Agents are re-executed independently and in parallel, because their observations are known, a
//! part of the recording at a time, which bounds the memory. The caller provides the agents, which
//! this crate does not know.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, Observation, Scenario};
use msgs::{printable, topics};
use rayon::prelude::*;
use thiserror::Error;

use recording::comparison::{self, Difference};
use recording::{Message, Recording};

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
pub trait AgentReplica: Send {
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

/// Bytes of messages that are re-executed at once.
const PART_BYTES: usize = 32 << 20;

/// Re-executes the agents of a recording, in all ticks before one.
///
/// # Errors
/// If a command differs; the first one by tick and agent is reported.
pub fn check(
    recording: &Recording,
    before: Tick,
    controllers: &dyn ControllerFactory,
) -> Result<Checked, ControllersError> {
    check_in_parts(recording, before, controllers, PART_BYTES)
}

fn check_in_parts(
    recording: &Recording,
    before: Tick,
    controllers: &dyn ControllerFactory,
    part_bytes: usize,
) -> Result<Checked, ControllersError> {
    let mut announced = Scenario::default();
    let mut agents: BTreeMap<AgentId, ReplayedAgent> = BTreeMap::new();
    let (mut bytes, mut last) = (0, Tick::ZERO);
    let of_run = recording.messages_on(comparison::is_of_run);
    for message in of_run.take_while(|message| message.tick() < before) {
        // A part ends with a tick, so that a difference of an earlier part is an earlier one.
        if bytes >= part_bytes && message.tick() != last {
            re_execute(recording, &mut agents, &announced, controllers)?;
            bytes = 0;
        }
        last = message.tick();
        if message.channel.topic == topics::scenario().name {
            announced = message.decode().unwrap_or_default();
        }
        match message.of_agent() {
            Some((agent, "join")) => {
                agents.entry(agent).or_default().runs =
                    message.decode().map_or_else(|_| String::new(), |join: Join| join.controller);
            }
            Some((agent, "observation" | "command")) => {
                bytes += message.data.len();
                agents.entry(agent).or_default().messages.push(message);
            }
            _ => {}
        }
    }
    re_execute(recording, &mut agents, &announced, controllers)?;
    let mut checked = Checked::default();
    for (agent, replayed) in agents {
        match replayed.replica {
            Some(Err(reason)) => {
                checked.unchecked.insert(agent, reason);
            }
            _ => {
                checked.commands += replayed.commands;
                checked.agents.push(agent);
            }
        }
    }
    Ok(checked)
}

/// Re-executes the agents on the messages that have been read.
fn re_execute(
    recording: &Recording,
    agents: &mut BTreeMap<AgentId, ReplayedAgent>,
    announced: &Scenario,
    controllers: &dyn ControllerFactory,
) -> Result<(), ControllersError> {
    let found = agents.par_iter_mut().filter_map(|(&agent, replayed)| {
        let (tick, mismatch) = replayed.re_execute(announced, agent, controllers).err()?;
        Some((tick, agent, mismatch))
    });
    let file = recording.file().to_owned();
    match found.min_by_key(|&(tick, agent, _)| (tick, agent)) {
        None => Ok(()),
        Some((_, _, Mismatch::Command(difference))) => Err(ControllersError::Different { file, difference }),
        Some((tick, agent, Mismatch::Agent(reason))) => Err(ControllersError::Agent { file, tick, agent, reason }),
    }
}

/// Why an agent does not verify.
enum Mismatch {
    Command(Box<Difference>),
    Agent(String),
}

/// An agent that is re-executed on its recorded observations.
#[derive(Default)]
struct ReplayedAgent {
    /// The controller of its join message, with settings.
    runs: String,
    /// Made of the first messages; otherwise the reason why there is none.
    replica: Option<Result<Box<dyn AgentReplica>, String>>,
    /// Observations and commands that are still to be re-executed.
    messages: Vec<Message>,
    /// What it has decided on its last observation.
    answer: Option<Command>,
    /// Number of equal commands.
    commands: u64,
}

impl ReplayedAgent {
    fn re_execute(
        &mut self,
        announced: &Scenario,
        agent: AgentId,
        controllers: &dyn ControllerFactory,
    ) -> Result<(), (Tick, Mismatch)> {
        let mut messages = std::mem::take(&mut self.messages);
        let replica = self.replica.get_or_insert_with(|| controllers.agent(announced, agent, &self.runs));
        let Ok(replica) = replica else { return Ok(()) };
        let is_command = |message: &Message| message.of_agent().is_some_and(|(_, topic)| topic == "command");
        // A tool may have changed the order of topics in a tick.
        messages.sort_by_key(|message| (message.tick(), is_command(message)));
        for message in messages {
            let tick = message.tick();
            if is_command(&message) {
                if let Some(difference) = comparison::compare_command(&message, self.answer.take().as_ref()) {
                    return Err((tick, Mismatch::Command(Box::new(difference))));
                }
                self.commands += 1;
                continue;
            }
            let part = message.decode().map_err(|error| error.to_string());
            let decided = part.and_then(|part| replica.take(part));
            self.answer = decided.map_err(|reason| (tick, Mismatch::Agent(reason)))?.or(self.answer.take());
        }
        Ok(())
    }
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
    use msgs::cdr;
    use recording::SCENARIO_ATTACHMENT;
    use recording::recorder::{Document, Recorder};

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
        let in_parts = check_in_parts(&changed, Tick(3), &CountingFactory, 1).unwrap_err().to_string();
        assert_eq!(in_parts, refused);
        let same = recording(|_| {});
        assert_eq!(
            check_in_parts(&same, Tick(3), &CountingFactory, 1).unwrap(),
            check(&same, Tick(3), &CountingFactory).unwrap()
        );
    }

    #[test]
    fn a_stage_may_be_missing_and_not_another_one() {
        let checked = |stage| check(&recording(|command| command.stage = stage), Tick(3), &CountingFactory);
        assert_eq!(checked(Command::SAME).unwrap().commands, 6);
        let refused = checked(Command::WAITING).unwrap_err().to_string();
        assert!(refused.ends_with(": tick 0, agent 0, /agent_0/command: stage was 4 and is 1"), "{refused}");
    }
}
