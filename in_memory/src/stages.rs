//! Stages: what the agents of a run were busy with, by their status texts.
//!
//! A status text for people begins with words that name the stage of a controller; an agent is in
//! the stage of its last text that names one. Texts that name none change nothing, so a controller
//! that says nothing of stages has no times. The texts are recorded, and so these times are the
//! same with every transport.

use std::collections::BTreeMap;

use msgs::ids::Tick;
use msgs::maes_msgs::Command;

/// A stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// On the way to a viewpoint nearby.
    Exploring,
    /// On the way to a frontier that is not nearby.
    Relocating,
    /// On the way to another agent, with news for it.
    Carrying,
    /// Without a goal, or out of the way of others.
    Waiting,
}

/// The first words of a text, by stage.
const WORDS: [(&str, Stage); 12] = [
    ("exploration", Stage::Exploring),
    ("relocation", Stage::Relocating),
    ("goes to the frontier", Stage::Relocating),
    ("with news", Stage::Carrying),
    ("meets", Stage::Carrying),
    ("waiting", Stage::Waiting),
    ("gives way", Stage::Waiting),
    ("makes way", Stage::Waiting),
    ("out of the way", Stage::Waiting),
    ("nothing left to do", Stage::Waiting),
    ("knows no", Stage::Waiting),
    ("no frontiers left", Stage::Waiting),
];

impl Stage {
    /// The stage that a status text names.
    #[must_use]
    pub fn of(text: &str) -> Option<Self> {
        WORDS.iter().find(|(words, _)| text.starts_with(words)).map(|&(_, stage)| stage)
    }
}

/// Seconds of sim time in each stage, summed over the agents.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageSeconds {
    pub exploring_s: f64,
    pub relocating_s: f64,
    pub carrying_s: f64,
    pub waiting_s: f64,
}

/// The stages of the agents of a run so far.
#[derive(Debug, Clone, Default)]
pub struct StageTimes {
    /// By agent, its stage and since when.
    present: BTreeMap<u32, (Stage, u64)>,
    /// Completed ticks.
    ticks: BTreeMap<Stage, u64>,
}

impl StageTimes {
    /// Takes the status text of a command. A command that is repeated changes nothing.
    pub fn note(&mut self, command: &Command) {
        let Some(stage) = Stage::of(&command.info) else { return };
        let last = self.present.insert(command.agent, (stage, command.tick));
        if let Some((stage, since)) = last {
            *self.ticks.entry(stage).or_default() += command.tick.saturating_sub(since);
        }
    }

    /// The times of a run that ended at a tick.
    #[must_use]
    pub fn until(&self, end: Tick) -> StageSeconds {
        let of = |stage: Stage| {
            let present = self.present.values().filter(|&&(present, _)| present == stage);
            let open: u64 = present.map(|&(_, since)| end.0.saturating_sub(since)).sum();
            Tick(self.ticks.get(&stage).copied().unwrap_or(0) + open).time_s()
        };
        StageSeconds {
            exploring_s: of(Stage::Exploring),
            relocating_s: of(Stage::Relocating),
            carrying_s: of(Stage::Carrying),
            waiting_s: of(Stage::Waiting),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(agent: u32, tick: u64, info: &str) -> Command {
        Command { agent, tick, info: info.to_owned(), ..Command::default() }
    }

    #[test]
    fn agents_are_in_the_stage_that_they_named_last() {
        let mut times = StageTimes::default();
        for command in [
            said(0, 0, "exploration to (1, 2, 3), 40 unexplored cells"),
            said(1, 50, "relocation to (1, 2, 3)"),
            said(0, 100, ""),
            said(0, 150, "turns"),
            said(1, 150, "with news to agent 0, last at (1, 2, 3)"),
            said(1, 150, "with news to agent 0, last at (1, 2, 3)"),
            said(0, 200, "gives way"),
            said(2, 250, "turns"),
        ] {
            times.note(&command);
        }
        let seconds = times.until(Tick(300));
        let expected = StageSeconds { exploring_s: 4.0, relocating_s: 2.0, carrying_s: 3.0, waiting_s: 2.0 };
        assert_eq!(seconds, expected);
    }

    #[test]
    fn texts_of_the_controllers_name_their_stages() {
        assert_eq!(Stage::of("exploration: no destination"), Some(Stage::Exploring));
        assert_eq!(Stage::of("nothing left to do, waiting for news"), Some(Stage::Waiting));
        assert_eq!(Stage::of("knows no frontier"), Some(Stage::Waiting));
        assert_eq!(Stage::of("straight on"), None);
    }
}
