//! An agent: merges its observations into its map, shares the map, calls its controller, and
//! replies to each tick once.
//!
//! Invariants: in a committed tick, the map holds all that was observed and received before the
//! controller is called; a resent observation gets the same reply, byte for byte.
//!
//! **Committed and speculative.** A server without look-ahead requests a command in every tick. It
//! ignores replies before the wake-up condition of the last committed command fires, unless the
//! reply acts, and it repeats the observation delta once the agent is due. So that such polling
//! changes nothing, an agent that is polled between its wake-ups merges nothing, sends nothing, and
//! does not call its controller, unless [`Controller::is_polled_between_wakes`]: then it keeps the
//! observation aside, in case the controller acts all the same and the reply is committed.
//!
//! **Two wake-up conditions.** Map sharing has wake-up conditions of its own. In a tick that is due
//! for sharing alone, the controller is not called: the observation is deferred to the tick that
//! the controller has asked for, so controllers need not know of sharing. They do not see map
//! messages either.
//!
//! **Change of the controller.** The server may tell of another run info. Then the agent replaces
//! its controller by the one that is now asked for, and calls it in the same tick. Map, sharing and
//! counters stay: the new controller knows what the agent has learned, and has decided nothing yet.

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, Observation as Part};
use protocol::limits::{AGENT_MESSAGE_BYTES_BARE, AGENT_MESSAGE_BYTES_MAX, LIST_BYTES_MAX, POINT_BYTES};
use protocol::message_type::MessageType;
use protocol::signed::Verified;

use agent::blind_spot::BlindSpot;
use agent::command::{Command, Motion, WakeCondition};
use agent::exploration_map::ExplorationMap;
use agent::navigation::NavigationTask;
use agent::observation::{Observation, RunInfo};
use agent::path::Neighbours;
use agent::sharing::Sharing;
use controllers::{Controller, ControllerError, Ctx, Failure, Successors};
use protocol::observation::fragments::{FragmentReassembler, Reassembled};
use protocol::wire_error::WireError;
use thiserror::Error;

/// One agent.
pub struct Agent {
    id: AgentId,
    run_info: RunInfo,
    map: ExplorationMap,
    sharing: Sharing,
    navigation: NavigationTask,
    blind_spot: BlindSpot,
    controller: Box<dyn Controller>,
    successors: Successors,
    reassembler: FragmentReassembler,
    last_reply: Option<maes_msgs::Command>,
    /// The wake-up condition of the last committed command.
    due: WakeCondition,
    /// The controller's part of the wake-up condition.
    controller_wake: WakeCondition,
    /// Whether the controller has requested the view in its next observation.
    controller_wants_view: bool,
    /// Observations of ticks that were due for sharing alone, which the controller has not seen.
    deferred: Option<Observation>,
    /// Observations received between its wake-ups since the last committed one, not merged into the
    /// map.
    unmerged: Option<Observation>,
}

/// Why an agent cannot continue.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum AgentError {
    /// The server violates the protocol.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// The controller that is to take over cannot be built.
    #[error("observation of tick {tick}: {source}")]
    Controller {
        /// The tick of the observation.
        tick: Tick,
        /// What is wrong.
        source: ControllerError,
    },
}

/// The reaction to a fragment of an observation.
#[derive(Debug, Clone, PartialEq)]
pub enum Reaction {
    /// None: other fragments are missing, or the observation is outdated.
    None,
    /// A command.
    Reply(maes_msgs::Command),
    /// The acknowledgement of the end of the run.
    Acknowledge(maes_msgs::Command),
}

impl Agent {
    /// An agent with an unexplored map.
    ///
    /// # Panics
    /// If the agent is not part of the run.
    #[must_use]
    pub fn new(id: AgentId, run_info: RunInfo, controller: Box<dyn Controller>) -> Self {
        Self {
            id,
            map: ExplorationMap::new(run_info.extent),
            sharing: Sharing::new(id, run_info.share_period_ticks, run_info.agents),
            navigation: NavigationTask::new(run_info.bodies.of(id), run_info.extent.cell_m()),
            run_info,
            blind_spot: BlindSpot::default(),
            controller,
            successors: Box::new(|_| Ok(None)),
            reassembler: FragmentReassembler::default(),
            last_reply: None,
            due: WakeCondition::NEXT_TICK,
            controller_wake: WakeCondition::NEXT_TICK,
            controller_wants_view: false,
            deferred: None,
            unmerged: None,
        }
    }

    /// The same agent, whose controller is replaced when the server asks for another one.
    #[must_use]
    pub fn with_successors(self, successors: Successors) -> Self {
        Self { successors, ..self }
    }

    /// The id of the agent.
    #[must_use]
    pub fn id(&self) -> AgentId {
        self.id
    }

    /// The map of the agent.
    #[must_use]
    pub fn map(&self) -> &ExplorationMap {
        &self.map
    }

    /// The state of its map sharing.
    #[must_use]
    pub fn sharing(&self) -> &Sharing {
        &self.sharing
    }

    /// Why its controller cannot continue, after a call of [`Agent::take`] whose reply is void.
    pub fn failure(&mut self) -> Option<Failure> {
        self.controller.failure()
    }

    /// The last tick that was replied to.
    #[must_use]
    pub fn last_tick(&self) -> Option<Tick> {
        self.last_reply.as_ref().map(|command| Tick(command.tick))
    }

    /// Processes a fragment of an observation.
    ///
    /// # Errors
    /// If the server violates the protocol, or the controller that is to take over cannot be built.
    ///
    /// # Panics
    /// Never: a map has fewer than 2^32 cells.
    pub fn take(&mut self, part: Verified<Part>) -> Result<Reaction, AgentError> {
        let part = part.into_inner();
        if part.phase != Part::ENDED
            && let Some(last_reply) = &self.last_reply
            && part.tick <= last_reply.tick
        {
            let is_resent = part.tick == last_reply.tick && part.is_last();
            return Ok(if is_resent { Reaction::Reply(last_reply.clone()) } else { Reaction::None });
        }
        let Some(Reassembled { has_ended, mut observation }) = self.reassembler.take(part, &self.run_info)? else {
            return Ok(Reaction::None);
        };
        self.run_info.field_of_view = observation.field_of_view;
        let tick = observation.tick;
        if has_ended {
            self.merge(&mut observation)?;
            let acknowledgement = Command::keep(WakeCondition::NEXT_TICK).into_message(self.id, tick);
            return Ok(Reaction::Acknowledge(acknowledgement));
        }
        // The server makes every agent due whose controller changes.
        let takes_over = observation.change.as_ref().is_some_and(|now| self.is_another_controller(now));
        let command = if takes_over || self.due.is_met(tick, observation.events) {
            self.reply_to_wake(observation)?
        } else if self.controller.is_polled_between_wakes() {
            self.reply_to_poll(observation)?
        } else {
            Command::keep(self.due)
        };
        let command = maes_msgs::Command {
            known_free: u32::try_from(self.map.free()).expect("an extent has at most 2^30 cells"),
            failed_searches: self.navigation.failures(),
            ..command.into_message(self.id, tick)
        };
        self.last_reply = Some(command.clone());
        Ok(Reaction::Reply(command))
    }

    fn reply_to_wake(&mut self, mut observation: Observation) -> Result<Command, AgentError> {
        // The server repeats it in this observation.
        self.unmerged = None;
        self.merge(&mut observation)?;
        if let Some(earlier) = self.deferred.take() {
            observation = observation.merged_with(earlier);
        }
        if self.controller_wake.is_met(observation.tick, observation.events) {
            let command = self.decide(&observation);
            // Controllers that rest look for viewpoints again after a while; one that is to be
            // called in the next tick has something to do.
            let rests = !observation.is_active && matches!(command.motion, Motion::Keep | Motion::Stop);
            if rests && command.wake.at > observation.tick.next() {
                let moves = self.navigation.moves(Neighbours::TwentySix);
                self.blind_spot.fill(&mut self.map, moves, &observation);
            }
            Ok(self.commit(command, &observation))
        } else {
            let command = Command { want_view: self.controller_wants_view, ..Command::keep(self.controller_wake) };
            let command = self.commit(command, &observation);
            self.deferred = Some(observation);
            Ok(command)
        }
    }

    fn reply_to_poll(&mut self, observation: Observation) -> Result<Command, AgentError> {
        let mut shown = Observation { change: None, ..observation.clone() };
        shown.messages.retain(|message| !message.is_from_agent(MessageType::Map));
        let mut whole = match self.unmerged.take() {
            Some(earlier) => observation.merged_with(earlier),
            None => observation,
        };
        let command = self.decide(&shown);
        if command.is_noop() {
            self.unmerged = Some(whole);
            return Ok(Command::keep(self.due));
        }
        self.merge(&mut whole)?;
        Ok(self.commit(command, &whole))
    }

    fn is_another_controller(&self, now: &RunInfo) -> bool {
        (&now.controller, &now.settings) != (&self.run_info.controller, &self.run_info.settings)
    }

    /// Adopts the run info that holds from now on.
    fn adopt(&mut self, now: RunInfo, tick: Tick) -> Result<(), AgentError> {
        let takes_over = self.is_another_controller(&now);
        self.sharing.set_period(now.share_period_ticks);
        self.run_info = RunInfo { field_of_view: self.run_info.field_of_view, ..now };
        if takes_over {
            self.controller_wake = WakeCondition::NEXT_TICK;
            let successor = (self.successors)(&self.run_info);
            if let Some(controller) = successor.map_err(|source| AgentError::Controller { tick, source })? {
                self.controller = controller;
                self.navigation.reset();
                self.controller_wants_view = false;
                self.deferred = None;
            }
        }
        Ok(())
    }

    fn decide(&mut self, observation: &Observation) -> Command {
        let mut ctx = Ctx::new(self.id, &self.run_info, observation, &mut self.map, &mut self.navigation);
        self.controller.decide(observation, &mut ctx)
    }

    /// Merges what was seen and the map messages into the map; removes the map messages from the
    /// observation. A change of the run info comes first.
    fn merge(&mut self, observation: &mut Observation) -> Result<(), AgentError> {
        if let Some(now) = observation.change.take() {
            self.adopt(*now, observation.tick)?;
        }
        self.map.note_free(&observation.seen.free);
        self.map.note_wall(&observation.seen.wall);
        let position = observation.pose.position;
        self.map.note_covered(self.run_info.extent.cell_of(&position));
        // A body between cells is in several, of which it plans with one.
        let planned = self.navigation.cell_near(&self.map, &position);
        if self.map.state(planned).is_free() {
            self.map.note_covered(planned);
        }
        self.blind_spot.note_collision(&mut self.map, self.navigation.moves(Neighbours::TwentySix), observation);
        self.sharing.set_frames(&observation.map_frames);
        self.sharing.incoming(&mut self.map, &observation.messages);
        observation.messages.retain(|message| !message.is_from_agent(MessageType::Map));
        Ok(())
    }

    /// Completes a command that will be committed: with map messages, and with the wake-up
    /// condition of map sharing.
    fn commit(&mut self, mut command: Command, observation: &Observation) -> Command {
        self.controller_wake = command.wake;
        self.controller_wants_view = command.want_view;
        let Observation { tick, contacts, .. } = observation;
        let messages = self.sharing.outgoing(&self.map, contacts, *tick, message_budget(&command));
        command.messages.extend(messages);
        command.wake = command.wake.or(self.sharing.next_wake(contacts, *tick));
        self.due = command.wake;
        command
    }
}

/// Bytes left in a command for further messages.
fn message_budget(command: &Command) -> usize {
    let sizes = command.messages.iter().map(|message| message.data.len());
    let (number, data) = sizes.fold((0, 0), |(number, data), size| (number + 1, data + size));
    let waypoints = if let Motion::Path(waypoints) = &command.motion { waypoints.len() } else { 0 };
    let lists = POINT_BYTES * waypoints + AGENT_MESSAGE_BYTES_BARE * number + data;
    AGENT_MESSAGE_BYTES_MAX.saturating_sub(data).min(LIST_BYTES_MAX.saturating_sub(lists))
}

#[cfg(test)]
mod tests;
