//! An agent: takes in what it observes, shares its map, lets its controller decide, and answers each tick once.
//!
//! Invariants: in a tick that counts, the map holds everything that was observed and told before the controller is asked; a tick
//! that was answered is answered in the same words when it is asked again.
//!
//! **In turn and out of turn.** A server that does not look ahead asks agents in every tick, and takes no notice of an answer
//! before the wake condition of the last answer that counted, unless the answer does something. It tells everything again when
//! the agent is due. So that asking changes nothing, an agent that is asked out of turn learns nothing, shares nothing, and does
//! not ask its controller, unless that wants to be asked in between: then it keeps what it is told aside, for the case that the
//! controller acts all the same, and the answer counts.
//!
//! **Whom a wake is for.** Map sharing has wake conditions of its own. In a tick that is due for sharing alone, the controller is
//! not asked: the news wait for the tick that it has asked for, so that it need not know of sharing. It does not see map parcels.

use msgs::ids::{AgentId, Tick};
use msgs::limits::{LIST_BYTES_MAX, PARCEL_BYTES_BARE, PARCEL_BYTES_MAX, POINT_BYTES};
use msgs::maes_msgs::{self, Observation as Part};

use crate::command::{Command, Motion, Wake};
use crate::controllers::{Controller, Ctx};
use crate::exploration_map::ExplorationMap;
use crate::observation::{Briefing, Observation};
use crate::sharing::{MAP_PARCEL, Sharing};
use crate::travel::Travel;
use crate::wire::{self, Collected, Collector, WireError};

/// One agent.
pub struct Agent {
    id: AgentId,
    briefing: Briefing,
    map: ExplorationMap,
    sharing: Sharing,
    travel: Travel,
    controller: Box<dyn Controller>,
    collector: Collector,
    answered: Option<maes_msgs::Command>,
    /// When the next observation counts: the wake of the last answer that counted.
    due: Wake,
    /// The controller's part of it.
    controller_due: Wake,
    /// Whether the controller wants the view in the next observation it gets.
    controller_wants_view: bool,
    /// What the controller was not asked about in ticks that were due for sharing alone.
    untold: Option<Observation>,
    /// What was told out of turn since the last observation that counted.
    unlearnt: Option<Observation>,
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
    ///
    /// # Panics
    /// If it does not take part in the run.
    #[must_use]
    pub fn new(id: AgentId, briefing: Briefing, controller: Box<dyn Controller>) -> Self {
        Self {
            id,
            map: ExplorationMap::new(briefing.extent),
            sharing: Sharing::new(briefing.share_period_ticks, briefing.agents),
            travel: Travel::new(briefing.bodies.of(id).radius_m, briefing.extent.cell_m()),
            briefing,
            controller,
            collector: Collector::default(),
            answered: None,
            due: Wake::NEXT_TICK,
            controller_due: Wake::NEXT_TICK,
            controller_wants_view: false,
            untold: None,
            unlearnt: None,
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

    /// How it shares its map.
    #[must_use]
    pub fn sharing(&self) -> &Sharing {
        &self.sharing
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
    ///
    /// # Panics
    /// Never: a map has fewer cells than a number of 32 bits can say.
    pub fn take(&mut self, part: Part) -> Result<Reaction, WireError> {
        if part.phase != Part::ENDED
            && let Some(answered) = &self.answered
            && part.tick <= answered.tick
        {
            let is_asked_again = part.tick == answered.tick && part.part + 1 == part.parts;
            return Ok(if is_asked_again { Reaction::Answer(answered.clone()) } else { Reaction::None });
        }
        let Some(Collected { has_ended, mut observation }) = self.collector.take(part, &self.briefing)? else {
            return Ok(Reaction::None);
        };
        let tick = observation.tick;
        if has_ended {
            self.learn(&mut observation);
            let receipt = wire::command(self.id, tick, Command::keep(Wake::NEXT_TICK));
            return Ok(Reaction::Farewell(receipt));
        }
        let command = if self.due.is_due(tick, observation.events) {
            self.answer_in_turn(observation)
        } else if self.controller.is_asked_between() {
            self.answer_out_of_turn(observation)
        } else {
            Command::keep(self.due)
        };
        let command = maes_msgs::Command {
            known_free: u32::try_from(self.map.free()).expect("an extent has at most 2^30 cells"),
            failed_searches: self.travel.failures(),
            ..wire::command(self.id, tick, command)
        };
        self.answered = Some(command.clone());
        Ok(Reaction::Answer(command))
    }

    fn answer_in_turn(&mut self, mut observation: Observation) -> Command {
        // The server tells it once more.
        self.unlearnt = None;
        self.learn(&mut observation);
        if let Some(earlier) = self.untold.take() {
            observation = observation.with_news_of(earlier);
        }
        if self.controller_due.is_due(observation.tick, observation.events) {
            let command = self.decide(&observation);
            self.count(command, &observation)
        } else {
            let command = Command { want_view: self.controller_wants_view, ..Command::keep(self.controller_due) };
            let command = self.count(command, &observation);
            self.untold = Some(observation);
            command
        }
    }

    fn answer_out_of_turn(&mut self, observation: Observation) -> Command {
        let mut shown = observation.clone();
        shown.parcels.retain(|parcel| parcel.kind != MAP_PARCEL);
        let mut whole = match self.unlearnt.take() {
            Some(earlier) => observation.with_news_of(earlier),
            None => observation,
        };
        let command = self.decide(&shown);
        if command.does_nothing() {
            self.unlearnt = Some(whole);
            return Command::keep(self.due);
        }
        self.learn(&mut whole);
        self.count(command, &whole)
    }

    fn decide(&mut self, observation: &Observation) -> Command {
        let mut ctx = Ctx::new(self.id, &self.briefing, observation, &mut self.map, &mut self.travel);
        self.controller.decide(observation, &mut ctx)
    }

    /// Learns what was seen and what other agents say; takes their map parcels out of the observation.
    fn learn(&mut self, observation: &mut Observation) {
        self.map.note_free(&observation.seen.free);
        self.map.note_wall(&observation.seen.wall);
        self.map.note_covered(self.briefing.extent.cell_of(&observation.pose.position));
        self.sharing.incoming(&mut self.map, &observation.parcels);
        observation.parcels.retain(|parcel| parcel.kind != MAP_PARCEL);
    }

    /// Completes a command that counts with what there is to share.
    fn count(&mut self, mut command: Command, observation: &Observation) -> Command {
        self.controller_due = command.wake;
        self.controller_wants_view = command.want_view;
        let Observation { tick, contacts, .. } = observation;
        let parcels = self.sharing.outgoing(&self.map, contacts, *tick, room_for_parcels(&command));
        command.parcels.extend(parcels);
        command.wake = command.wake.or(self.sharing.wants_to_be_asked_at(contacts, *tick));
        self.due = command.wake;
        command
    }
}

/// Bytes that are left in a command for more parcels.
fn room_for_parcels(command: &Command) -> usize {
    let of_parcels = command.parcels.iter().map(|parcel| parcel.data.len());
    let sizes = of_parcels.chain(command.relays.iter().map(|order| order.data.len()));
    let (number, data) = sizes.fold((0, 0), |(number, data), size| (number + 1, data + size));
    let way_points = if let Motion::Path(way_points) = &command.motion { way_points.len() } else { 0 };
    let lists = POINT_BYTES * way_points + PARCEL_BYTES_BARE * number + data;
    PARCEL_BYTES_MAX.saturating_sub(data).min(LIST_BYTES_MAX.saturating_sub(lists))
}

#[cfg(test)]
mod tests;
