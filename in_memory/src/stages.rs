//! Times in stages: what the agents of a run were busy with, as their commands name it.
//!
//! An agent is in the stage that its last command with one has named, so a controller that names
//! none has no times. Commands are recorded, and so these times are the same with every transport.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::Command;
use protocol::stage::Stage;

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
    present: BTreeMap<AgentId, (Stage, Tick)>,
    /// Completed ticks.
    ticks: BTreeMap<Stage, u64>,
}

impl StageTimes {
    /// Takes the stage of a command. A command that is repeated changes nothing.
    pub fn note(&mut self, command: &Command) {
        // The server refuses commands with another number.
        if let Ok(Some(stage)) = Stage::from_wire(command.stage) {
            self.enter(AgentId(command.agent), Tick(command.tick), stage);
        }
    }

    /// An agent is in a stage from a tick on.
    pub fn enter(&mut self, agent: AgentId, tick: Tick, stage: Stage) {
        if let Some((before, since)) = self.present.insert(agent, (stage, tick)) {
            *self.ticks.entry(before).or_default() += tick.0.saturating_sub(since.0);
        }
    }

    /// The times of a run that ended at a tick.
    #[must_use]
    pub fn until(&self, end: Tick) -> StageSeconds {
        let of = |stage: Stage| {
            let present = self.present.values().filter(|&&(present, _)| present == stage);
            let open: u64 = present.map(|&(_, since)| end.0.saturating_sub(since.0)).sum();
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

    fn named(agent: u32, tick: u64, stage: u8) -> Command {
        Command { agent, tick, stage, info: "gives way".to_owned(), ..Command::default() }
    }

    #[test]
    fn agents_are_in_the_stage_that_they_named_last() {
        let mut times = StageTimes::default();
        for command in [
            named(0, 0, Command::EXPLORING),
            named(1, 50, Command::RELOCATING),
            named(0, 100, Command::SAME),
            named(1, 150, Command::CARRYING),
            named(1, 150, Command::CARRYING),
            named(0, 200, Command::WAITING),
            named(2, 250, Command::SAME),
            named(2, 250, 9),
        ] {
            times.note(&command);
        }
        let seconds = times.until(Tick(300));
        let expected = StageSeconds { exploring_s: 4.0, relocating_s: 2.0, carrying_s: 3.0, waiting_s: 2.0 };
        assert_eq!(seconds, expected);
    }
}
