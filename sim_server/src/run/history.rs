//! What each agent was told and has answered so far, and how much of it the process knows that runs it now.
//!
//! A process that takes the place of another one is told everything again from the start, one observation at a time, and has to
//! give the same answers: controllers are deterministic, so it then is where its predecessor was.
//!
//! Invariants: what is told again is what counted, in the order in which it counted; an answer that is not the same as before is
//! never taken in.
//!
//! This module knows no link and no wall time.

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Observation as Part};

use crate::difference;

/// A question that counted, and its answer.
#[derive(Debug, Clone, PartialEq)]
struct Entry {
    parts: Vec<Part>,
    answer: Command,
}

/// The past of one agent.
#[derive(Debug, Clone, Default)]
struct Past {
    entries: Vec<Entry>,
    /// How many of them the present process knows.
    known: usize,
}

/// The pasts of all agents.
#[derive(Debug, Clone)]
pub(super) struct History {
    pasts: Vec<Past>,
    is_kept: bool,
}

/// What to make of a command while its agent is told its past.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Recall {
    /// The process knows its past: the command is none of it.
    Present,
    /// The answer that was expected: there may be more to tell.
    Same,
    /// An answer that was given already, because it was asked for again.
    Again,
    /// An answer to something that it was not told yet.
    OutOfOrder {
        /// The tick that it was told last.
        expected: Tick,
    },
    /// Another answer than before.
    Different {
        /// Which field, and both values.
        what: String,
    },
}

impl History {
    /// Nothing has happened yet; what will is kept if somebody may have to be told.
    pub(super) fn new(agents: u32, is_kept: bool) -> Self {
        Self { pasts: vec![Past::default(); agents as usize], is_kept }
    }

    /// Keeps an exchange that counted. The process that has answered, if there was one, knows it.
    pub(super) fn keep(&mut self, agent: AgentId, parts: Vec<Part>, answer: &Command, is_known: bool) {
        if self.is_kept {
            let past = &mut self.pasts[agent.index()];
            past.entries.push(Entry { parts, answer: answer.clone() });
            if is_known {
                past.known = past.entries.len();
            }
        }
    }

    /// A process that knows nothing runs the agent now.
    pub(super) fn start_again(&mut self, agent: AgentId) {
        self.pasts[agent.index()].known = 0;
    }

    /// This agent need not be told anything again.
    pub(super) fn excuse(&mut self, agent: AgentId) {
        let past = &mut self.pasts[agent.index()];
        past.known = past.entries.len();
    }

    /// What the process has to be told next, if it does not know its past.
    pub(super) fn next(&self, agent: AgentId) -> Option<&[Part]> {
        let past = &self.pasts[agent.index()];
        past.entries.get(past.known).map(|entry| entry.parts.as_slice())
    }

    /// Who does not know its past, ascending.
    pub(super) fn behind(&self) -> impl Iterator<Item = AgentId> + '_ {
        let is_behind = |past: &Past| past.known < past.entries.len();
        (0..).map(AgentId).zip(&self.pasts).filter(move |(_, past)| is_behind(past)).map(|(agent, _)| agent)
    }

    /// Takes in a command of an agent that may be told its past.
    pub(super) fn recall(&mut self, agent: AgentId, command: &Command) -> Recall {
        let past = &mut self.pasts[agent.index()];
        let Some(entry) = past.entries.get(past.known) else {
            return Recall::Present;
        };
        let expected = Tick(entry.answer.tick);
        match Tick(command.tick).cmp(&expected) {
            std::cmp::Ordering::Less => Recall::Again,
            std::cmp::Ordering::Greater => Recall::OutOfOrder { expected },
            std::cmp::Ordering::Equal => match difference::between(&entry.answer, command) {
                None => {
                    past.known += 1;
                    Recall::Same
                }
                Some(field) => Recall::Different { what: field.to_string() },
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AGENT: AgentId = AgentId(1);

    fn command(tick: u64, info: &str) -> Command {
        Command { tick, agent: 1, info: info.to_owned(), ..Command::default() }
    }

    fn of_two_ticks(is_kept: bool) -> History {
        let mut history = History::new(2, is_kept);
        for tick in [0, 7] {
            history.keep(AGENT, vec![Part { tick, ..Part::default() }], &command(tick, "on my way"), true);
        }
        history
    }

    fn told(history: &History) -> Option<u64> {
        history.next(AGENT).map(|parts| parts[0].tick)
    }

    #[test]
    fn who_has_answered_knows_it() {
        let mut history = of_two_ticks(true);
        assert_eq!((told(&history), history.behind().next()), (None, None));
        assert_eq!(history.recall(AGENT, &command(9, "")), Recall::Present);
    }

    #[test]
    fn who_comes_anew_is_told_one_thing_after_the_other() {
        let mut history = of_two_ticks(true);
        history.start_again(AGENT);
        assert_eq!((told(&history), history.behind().collect::<Vec<_>>()), (Some(0), vec![AGENT]));
        assert_eq!(history.recall(AGENT, &command(7, "on my way")), Recall::OutOfOrder { expected: Tick(0) });
        assert_eq!(history.recall(AGENT, &command(0, "on my way")), Recall::Same);
        assert_eq!(told(&history), Some(7));
        assert_eq!(history.recall(AGENT, &command(0, "on my way")), Recall::Again, "it was asked twice");
        assert_eq!(told(&history), Some(7));
        assert_eq!(history.recall(AGENT, &command(7, "on my way")), Recall::Same);
        assert_eq!((told(&history), history.behind().next()), (None, None));
    }

    #[test]
    fn another_answer_than_before_is_named() {
        let mut history = of_two_ticks(true);
        history.start_again(AGENT);
        let Recall::Different { what } = history.recall(AGENT, &command(0, "lost")) else { panic!() };
        assert_eq!(what, "info was \"on my way\" and is \"lost\"");
        assert_eq!(told(&history), Some(0), "it is not taken in");
        history.excuse(AGENT);
        assert_eq!(told(&history), None);
    }

    #[test]
    fn nothing_is_kept_for_nobody() {
        let mut history = of_two_ticks(false);
        history.start_again(AGENT);
        assert_eq!(told(&history), None);
    }
}
