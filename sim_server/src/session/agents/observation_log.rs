//! The observation log: what each agent has observed and answered so far, to be replayed to a
//! process that replaces another.
//!
//! A replacement gets all committed observations from the start, one at a time, and must give the
//! same commands: controllers are deterministic, so that afterwards it has the state of its
//! predecessor.
//!
//! Invariants: replayed is what was committed, in the order of commitment; a command that differs
//! from the logged one is never accepted.
//!
//! This module knows no transport and no wall time.

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Observation as Fragment};

use crate::difference;

/// A committed observation and its command.
#[derive(Debug, Clone, PartialEq)]
struct Entry {
    fragments: Vec<Fragment>,
    command: Command,
}

#[derive(Debug, Clone, Default)]
struct AgentLog {
    entries: Vec<Entry>,
    /// How many of them the present process has answered.
    known: usize,
}

/// The observation logs of all agents.
#[derive(Debug, Clone)]
pub(super) struct ObservationLog {
    logs: Vec<AgentLog>,
    is_kept: bool,
}

/// How a command relates to a replay.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Recall {
    /// No replay is under way: the command belongs to the present tick.
    Complete,
    /// The logged command; the replay advances.
    Same,
    /// A repeated command of an entry that was replayed before.
    Retransmit,
    /// A command for an entry that was not sent yet.
    OutOfOrder {
        /// The tick of the last entry that was sent.
        expected: Tick,
    },
    /// Not the logged command.
    Different {
        /// The field, and both values.
        what: String,
    },
}

impl ObservationLog {
    /// An empty log, which stays empty unless `is_kept`.
    pub(super) fn new(agents: u32, is_kept: bool) -> Self {
        Self { logs: vec![AgentLog::default(); agents as usize], is_kept }
    }

    /// Appends a committed exchange; `is_known` says that the present process gave the command.
    pub(super) fn append(&mut self, agent: AgentId, fragments: Vec<Fragment>, command: &Command, is_known: bool) {
        if self.is_kept {
            let log = &mut self.logs[agent.index()];
            log.entries.push(Entry { fragments, command: command.clone() });
            if is_known {
                log.known = log.entries.len();
            }
        }
    }

    /// Starts a replay to a new process of the agent.
    pub(super) fn rewind(&mut self, agent: AgentId) {
        self.logs[agent.index()].known = 0;
    }

    /// Ends a replay to the agent, complete or not.
    pub(super) fn skip(&mut self, agent: AgentId) {
        let log = &mut self.logs[agent.index()];
        log.known = log.entries.len();
    }

    /// The observation to send next, if a replay to the agent is under way.
    pub(super) fn next(&self, agent: AgentId) -> Option<&[Fragment]> {
        let log = &self.logs[agent.index()];
        log.entries.get(log.known).map(|entry| entry.fragments.as_slice())
    }

    /// The tick of that observation.
    pub(super) fn expected(&self, agent: AgentId) -> Option<Tick> {
        let log = &self.logs[agent.index()];
        log.entries.get(log.known).map(|entry| Tick(entry.command.tick))
    }

    /// Agents to which a replay is under way, ascending.
    pub(super) fn replaying(&self) -> impl Iterator<Item = AgentId> + '_ {
        let is_behind = |log: &AgentLog| log.known < log.entries.len();
        (0..).map(AgentId).zip(&self.logs).filter(move |(_, log)| is_behind(log)).map(|(agent, _)| agent)
    }

    /// Compares a command with the entry that was sent last.
    pub(super) fn recall(&mut self, agent: AgentId, command: &Command) -> Recall {
        let log = &mut self.logs[agent.index()];
        let Some(entry) = log.entries.get(log.known) else {
            return Recall::Complete;
        };
        let expected = Tick(entry.command.tick);
        match Tick(command.tick).cmp(&expected) {
            std::cmp::Ordering::Less => Recall::Retransmit,
            std::cmp::Ordering::Greater => Recall::OutOfOrder { expected },
            std::cmp::Ordering::Equal => match difference::between(&digested(&entry.command), &digested(command)) {
                None => {
                    log.known += 1;
                    Recall::Same
                }
                Some(field) => Recall::Different { what: field.to_string() },
            },
        }
    }
}

/// What the run depends on: recordings of earlier builds have no stages.
fn digested(command: &Command) -> Command {
    Command { stage: Command::SAME, ..command.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AGENT: AgentId = AgentId(1);

    fn command(tick: u64, info: &str) -> Command {
        Command { tick, agent: 1, info: info.to_owned(), ..Command::default() }
    }

    fn of_two_ticks(is_kept: bool) -> ObservationLog {
        let mut log = ObservationLog::new(2, is_kept);
        for tick in [0, 7] {
            log.append(AGENT, vec![Fragment { tick, ..Fragment::default() }], &command(tick, "on my way"), true);
        }
        log
    }

    fn next_tick(log: &ObservationLog) -> Option<u64> {
        log.next(AGENT).map(|fragments| fragments[0].tick)
    }

    #[test]
    fn answered_observations_are_not_replayed() {
        let mut log = of_two_ticks(true);
        assert_eq!((next_tick(&log), log.replaying().next()), (None, None));
        assert_eq!(log.recall(AGENT, &command(9, "")), Recall::Complete);
    }

    #[test]
    fn a_replay_sends_one_entry_at_a_time() {
        let mut log = of_two_ticks(true);
        log.rewind(AGENT);
        assert_eq!((next_tick(&log), log.replaying().collect::<Vec<_>>()), (Some(0), vec![AGENT]));
        assert_eq!(log.recall(AGENT, &command(7, "on my way")), Recall::OutOfOrder { expected: Tick(0) });
        assert_eq!(log.recall(AGENT, &command(0, "on my way")), Recall::Same);
        assert_eq!(next_tick(&log), Some(7));
        assert_eq!(log.recall(AGENT, &command(0, "on my way")), Recall::Retransmit, "it was resent");
        assert_eq!(next_tick(&log), Some(7));
        assert_eq!(log.recall(AGENT, &command(7, "on my way")), Recall::Same);
        assert_eq!((next_tick(&log), log.replaying().next()), (None, None));
    }

    #[test]
    fn a_divergent_command_is_named() {
        let mut log = of_two_ticks(true);
        log.rewind(AGENT);
        let Recall::Different { what } = log.recall(AGENT, &command(0, "lost")) else { panic!() };
        assert_eq!(what, "info was \"on my way\" and is \"lost\"");
        assert_eq!(next_tick(&log), Some(0), "it is not accepted");
        log.skip(AGENT);
        assert_eq!(next_tick(&log), None);
    }

    #[test]
    fn a_stage_that_is_not_recorded_is_no_divergence() {
        let mut log = of_two_ticks(true);
        log.rewind(AGENT);
        let now = Command { stage: Command::EXPLORING, ..command(0, "on my way") };
        assert_eq!(log.recall(AGENT, &now), Recall::Same);
    }

    #[test]
    fn nothing_is_kept_unless_asked() {
        let mut log = of_two_ticks(false);
        log.rewind(AGENT);
        assert_eq!(next_tick(&log), None);
    }
}
