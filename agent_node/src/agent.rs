//! An agent: takes in what it observes, lets its controller decide, and answers each tick once.
//!
//! Invariants: the map holds everything that was observed before the controller is asked; a tick that was answered is answered
//! in the same words when it is asked again.

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, Observation as Part};

use crate::command::{Command, Wake};
use crate::controllers::{Controller, Ctx};
use crate::exploration_map::ExplorationMap;
use crate::observation::{Briefing, Observation};
use crate::wire::{self, Collected, Collector, WireError};

/// One agent.
pub struct Agent {
    id: AgentId,
    briefing: Briefing,
    map: ExplorationMap,
    controller: Box<dyn Controller>,
    collector: Collector,
    answered: Option<maes_msgs::Command>,
}

/// What an agent does about a part of an observation.
#[derive(Debug, Clone, PartialEq)]
pub enum Reaction {
    /// Nothing: other parts are missing, or it is an old one.
    None,
    /// It answers.
    Answer(maes_msgs::Command),
    /// It gives the receipt for the end of the run.
    Farewell(maes_msgs::Command),
}

impl Agent {
    /// An agent that knows nothing but its briefing.
    #[must_use]
    pub fn new(id: AgentId, briefing: Briefing, controller: Box<dyn Controller>) -> Self {
        Self {
            id,
            map: ExplorationMap::new(briefing.extent),
            briefing,
            controller,
            collector: Collector::default(),
            answered: None,
        }
    }

    /// Its id.
    #[must_use]
    pub fn id(&self) -> AgentId {
        self.id
    }

    /// What it believes.
    #[must_use]
    pub fn map(&self) -> &ExplorationMap {
        &self.map
    }

    /// The last tick it has answered.
    #[must_use]
    pub fn last_tick(&self) -> Option<Tick> {
        self.answered.as_ref().map(|command| Tick(command.tick))
    }

    /// Takes in a part of an observation.
    ///
    /// # Errors
    /// If the server does not keep to the protocol.
    pub fn take(&mut self, part: Part) -> Result<Reaction, WireError> {
        if part.phase != Part::ENDED
            && let Some(answered) = &self.answered
            && part.tick <= answered.tick
        {
            let is_asked_again = part.tick == answered.tick && part.part + 1 == part.parts;
            return Ok(if is_asked_again { Reaction::Answer(answered.clone()) } else { Reaction::None });
        }
        let Some(Collected { has_ended, observation }) = self.collector.take(part, &self.briefing.extent)? else {
            return Ok(Reaction::None);
        };
        let tick = observation.tick;
        self.learn(&observation);
        if has_ended {
            let receipt = wire::command(self.id, tick, Command::keep(Wake::NEXT_TICK));
            return Ok(Reaction::Farewell(receipt));
        }
        let ctx = Ctx { agent: self.id, briefing: &self.briefing, map: &self.map };
        let command = wire::command(self.id, tick, self.controller.decide(&observation, ctx));
        self.answered = Some(command.clone());
        Ok(Reaction::Answer(command))
    }

    fn learn(&mut self, observation: &Observation) {
        self.map.note_free(&observation.seen.free);
        self.map.note_wall(&observation.seen.wall);
        self.map.note_covered(self.briefing.extent.cell_of(&observation.pose.position));
    }
}

#[cfg(test)]
mod tests {
    use msgs::maes_msgs::CellRuns;

    use super::*;
    use crate::command::Motion;
    use voxels::Extent;

    /// Counts how often it is asked.
    struct Counting(u32);

    impl Controller for Counting {
        fn decide(&mut self, _observation: &Observation, ctx: Ctx<'_>) -> Command {
            self.0 += 1;
            assert!(ctx.map.free() > 0, "the observation is in the map");
            let distance_m = f64::from(self.0);
            Command::new(Motion::Move { pitch_rad: 0.0, distance_m }, Wake::NEXT_TICK)
        }
    }

    fn agent() -> Agent {
        let scenario = maes_msgs::Scenario { size: [4, 4, 4], cell_m: 1.0, ..Default::default() };
        let mut briefing = wire::briefing(&scenario).unwrap();
        briefing.extent = Extent::new([4, 4, 4], 1.0).unwrap();
        Agent::new(AgentId(2), briefing, Box::new(Counting(0)))
    }

    fn part(tick: u64, phase: u8) -> Part {
        let seen_free = CellRuns { start: vec![0], length: vec![3] };
        Part { tick, parts: 1, phase, seen_free, ..Part::default() }
    }

    #[test]
    fn a_tick_that_is_asked_again_is_answered_in_the_same_words() {
        let mut agent = agent();
        let first = agent.take(part(3, Part::RUNNING)).unwrap();
        assert_eq!(agent.take(part(3, Part::RUNNING)).unwrap(), first);
        let Reaction::Answer(command) = first else { panic!("{first:?}") };
        assert_eq!((command.agent, command.tick, command.task.distance_m), (2, 3, 1.0));
        let Reaction::Answer(next) = agent.take(part(4, Part::RUNNING)).unwrap() else { panic!() };
        assert_eq!(next.task.distance_m, 2.0);
        assert_eq!(agent.take(part(3, Part::RUNNING)).unwrap(), Reaction::None);
        assert_eq!(agent.last_tick(), Some(Tick(4)));
    }

    #[test]
    fn the_end_is_receipted_even_in_a_tick_that_was_answered() {
        let mut agent = agent();
        agent.take(part(3, Part::RUNNING)).unwrap();
        let Reaction::Farewell(receipt) = agent.take(part(3, Part::ENDED)).unwrap() else { panic!() };
        assert_eq!((receipt.tick, receipt.task.kind), (3, maes_msgs::Task::KEEP));
        assert_eq!((agent.map().free(), agent.map().covered()), (3, 1));
    }
}
