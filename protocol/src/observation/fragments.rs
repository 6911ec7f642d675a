//! Observations as messages: fragments of bounded size, and observations reassembled from them.
//!
//! Invariants: no fragment is larger than [`OBSERVATION_BYTES_MAX`] on the wire; a complete
//! observation is consistent with the run, whatever was received: cells and points lie inside the
//! map, numbers are finite, agents are part of the run; a fragment that is rejected leaves no trace
//! in one.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, CellRuns, Observation as Part};
use msgs::{cdr, geometry_msgs};
use nalgebra::Vector3;

use super::{
    AgentMessage, Cells, Collision, Contact, Energy, FieldOfView, MapFrame, Observation, Peer, Pose, Relay, RunInfo,
    Surface,
};
use crate::event_mask::EventMask;
use crate::geometry::{header, point, point_of, vector};
use crate::limits::{AGENT_MESSAGE_BYTES_BARE, MESSAGE_BYTES_BARE, OBSERVATION_BYTES_MAX};
use crate::relay_id::RelayId;
use crate::wire_error::WireError;

/// Bytes on the wire of a contact, with padding.
const CONTACT_BYTES: usize = 32;
/// Bytes on the wire of a run of cells.
const RUN_BYTES: usize = 6;

/// An observation as fragments, in order; the caller sets the number of the run. `phase` is
/// [`RUNNING`](Part::RUNNING) or [`ENDED`](Part::ENDED).
#[must_use]
pub fn split(observation: Observation, phase: u8) -> Vec<Part> {
    let first = Part {
        header: header(observation.tick),
        tick: observation.tick.0,
        run: 0,
        agent: observation.agent.0,
        part: 0,
        parts: 1,
        phase,
        position: point(&observation.pose.position),
        yaw_rad: observation.pose.yaw_rad,
        velocity_m_s: vector(&observation.velocity_in_map_m_s),
        yaw_rate_rad_s: observation.yaw_rate_rad_s,
        task_status: if observation.is_active { Part::ACTIVE } else { Part::IDLE },
        collision: match observation.collision.map(|collision| collision.surface) {
            None => Part::NONE,
            Some(Surface::Wall) => Part::WALL,
            Some(Surface::Floor) => Part::FLOOR,
            Some(Surface::Ceiling) => Part::CEILING,
        },
        collision_with_agent: observation.collision.is_some_and(|collision| collision.with_agent),
        events: observation.events.bits(),
        contacts: Vec::new(),
        messages: Vec::new(),
        scan_tick: observation.scan_tick.map_or(Part::NEVER, |tick| tick.0),
        seen_free: CellRuns::default(),
        seen_wall: CellRuns::default(),
        has_view: observation.view.is_some(),
        view_free: CellRuns::default(),
        view_wall: CellRuns::default(),
    };
    let mut parts = Parts {
        bare: first.clone(),
        left: OBSERVATION_BYTES_MAX
            - MESSAGE_BYTES_BARE
            - CONTACT_BYTES * (observation.contacts.len() + observation.relays.len()),
        done: Vec::new(),
        filling: first,
    };
    parts.filling.contacts = observation
        .contacts
        .iter()
        .map(|contact| (contact.agent.0, contact.position))
        .chain(observation.relays.iter().map(|relay| (relay.id.on_wire(), relay.position)))
        .map(|(agent, position)| maes_msgs::Contact { agent, position: point(&position) })
        .collect();
    let of_server = |kind, data| AgentMessage { peer: Peer::Server, kind, data };
    let energy = observation.energy.map(|energy| of_server(maes_msgs::AgentMessage::ENERGY, energy.to_data()));
    let field_of_view =
        observation.field_of_view.map(|view| of_server(maes_msgs::AgentMessage::FIELD_OF_VIEW, view.to_data()));
    let frames = &observation.map_frames;
    let map_frames =
        (!frames.is_empty()).then(|| of_server(maes_msgs::AgentMessage::MAP_FRAMES, MapFrame::to_data(frames)));
    for message in energy.into_iter().chain(field_of_view).chain(map_frames).chain(observation.messages) {
        parts.make_room(AGENT_MESSAGE_BYTES_BARE + message.data.len());
        parts.filling.messages.push(message.into());
    }
    parts.add_runs(&observation.seen.free, |part| &mut part.seen_free);
    parts.add_runs(&observation.seen.wall, |part| &mut part.seen_wall);
    if let Some(view) = &observation.view {
        parts.add_runs(&view.free, |part| &mut part.view_free);
        parts.add_runs(&view.wall, |part| &mut part.view_wall);
    }
    parts.finish()
}

/// Splits an observation into fragments of bounded size.
struct Parts {
    bare: Part,
    left: usize,
    done: Vec<Part>,
    filling: Part,
}

impl Parts {
    fn make_room(&mut self, bytes: usize) {
        if bytes > self.left {
            self.done.push(std::mem::replace(&mut self.filling, self.bare.clone()));
            self.left = OBSERVATION_BYTES_MAX - MESSAGE_BYTES_BARE;
        }
        self.left -= bytes;
    }

    fn add_runs(&mut self, cells: &[u32], list: impl Fn(&mut Part) -> &mut CellRuns) {
        let (starts, lengths) = voxels::runs(cells.iter().copied());
        for (start, length) in starts.into_iter().zip(lengths) {
            self.make_room(RUN_BYTES);
            let list = list(&mut self.filling);
            list.start.push(start);
            list.length.push(length);
        }
    }

    fn finish(mut self) -> Vec<Part> {
        self.done.push(self.filling);
        let parts = u16::try_from(self.done.len()).expect("an inbox and a map fit into 65535 parts");
        for (number, part) in (0..).zip(&mut self.done) {
            part.part = number;
            part.parts = parts;
        }
        self.done
    }
}

/// The last tick of the longest run.
const TICK_MAX: Tick = Tick(10_000_000_000);

/// Reassembles observations from fragments, in any order and with repetitions.
#[derive(Debug, Clone, Default)]
pub struct FragmentReassembler {
    tick: Tick,
    phase: u8,
    parts: BTreeMap<u16, Part>,
}

/// A complete observation.
#[derive(Debug, Clone, PartialEq)]
pub struct Reassembled {
    /// Whether the run is over.
    pub has_ended: bool,
    /// The observation.
    pub observation: Observation,
}

impl FragmentReassembler {
    /// Adds a fragment; returns the observation if it was the last one missing.
    ///
    /// # Errors
    /// If the fragments disagree or hold values that are illegal in the run.
    pub fn take(&mut self, part: Part, run_info: &RunInfo) -> Result<Option<Reassembled>, WireError> {
        let tick = Tick(part.tick);
        let wrong = WireError::Part { tick, part: part.part, parts: part.parts };
        if part.part >= part.parts {
            return Err(wrong);
        }
        if tick != self.tick || part.phase != self.phase {
            *self = Self { tick, phase: part.phase, parts: BTreeMap::new() };
        }
        if self.parts.values().any(|other| other.parts != part.parts) {
            return Err(wrong);
        }
        check(&part, run_info)?;
        let parts = usize::from(part.parts);
        self.parts.insert(part.part, part);
        if self.parts.len() < parts {
            return Ok(None);
        }
        let parts = std::mem::take(&mut self.parts);
        assemble(parts.into_values(), run_info).map(Some)
    }
}

/// Checks the numbers of a fragment: a NaN would otherwise spread through all computations.
fn check(part: &Part, run_info: &RunInfo) -> Result<(), WireError> {
    let tick = Tick(part.tick);
    let require = |holds: bool, field, value: &dyn std::fmt::Debug, allowed: &dyn std::fmt::Display| match holds {
        true => Ok(()),
        false => Err(WireError::Value { tick, field, value: format!("{value:?}"), allowed: allowed.to_string() }),
    };
    let extent = &run_info.extent;
    let is_inside = |place: &geometry_msgs::Point| {
        [place.x, place.y, place.z].iter().all(|along| along.is_finite())
            && extent.contains(extent.cell_of(&point_of(place)))
    };
    let takes_part = |agent: u32| {
        agent < run_info.agents || RelayId::from_wire(agent).is_some_and(|relay| relay.owner.0 < run_info.agents)
    };
    let inside = "a place in the map";
    let last = run_info.agents.saturating_sub(1);
    let ids = format_args!("agents, 0 to {last}, and their relays");
    // The run may have been made longer, which this agent learns from this observation.
    require(tick <= TICK_MAX, "tick", &tick, &format_args!("a tick of a run, 0 to {TICK_MAX}"))?;
    require(is_inside(&part.position), "position", &part.position, &inside)?;
    require(part.yaw_rad.abs() <= TAU, "yaw_rad", &part.yaw_rad, &"-2 pi to 2 pi")?;
    let geometry_msgs::Vector3 { x, y, z } = part.velocity_m_s;
    for (field, value) in
        [("velocity_m_s.x", x), ("velocity_m_s.y", y), ("velocity_m_s.z", z), ("yaw_rate_rad_s", part.yaw_rate_rad_s)]
    {
        require(value.is_finite(), field, &value, &"a finite number")?;
    }
    for contact in &part.contacts {
        require(takes_part(contact.agent), "contacts", &contact.agent, &ids)?;
        require(is_inside(&contact.position), "contacts", &contact.position, &inside)?;
    }
    let is_ascending = part.contacts.is_sorted_by(|a, b| a.agent < b.agent);
    require(is_ascending, "contacts", &part.contacts.len(), &"each agent once, ascending")?;
    for message in part.messages.iter().filter(|message| message.agent != maes_msgs::AgentMessage::SERVER) {
        require(takes_part(message.agent), "messages", &message.agent, &ids)?;
    }
    Ok(())
}

fn assemble(mut parts: impl Iterator<Item = Part>, run_info_before: &RunInfo) -> Result<Reassembled, WireError> {
    let first = parts.next().expect("an observation has at least one part");
    let tick = Tick(first.tick);
    let volume = run_info_before.extent.volume();
    let surface = match first.collision {
        Part::WALL => Some(Surface::Wall),
        Part::FLOOR => Some(Surface::Floor),
        Part::CEILING => Some(Surface::Ceiling),
        _ => None,
    };
    let mut observation = Observation {
        tick,
        agent: AgentId(first.agent),
        pose: Pose { position: point_of(&first.position), yaw_rad: first.yaw_rad },
        velocity_in_map_m_s: Vector3::new(first.velocity_m_s.x, first.velocity_m_s.y, first.velocity_m_s.z),
        yaw_rate_rad_s: first.yaw_rate_rad_s,
        is_active: first.task_status == Part::ACTIVE,
        collision: surface.map(|surface| Collision { surface, with_agent: first.collision_with_agent }),
        events: EventMask::from_bits_retain(first.events),
        contacts: Vec::with_capacity(first.contacts.len()),
        relays: Vec::new(),
        messages: Vec::new(),
        scan_tick: (first.scan_tick != Part::NEVER).then_some(Tick(first.scan_tick)),
        seen: Cells::default(),
        view: first.has_view.then(Cells::default),
        energy: None,
        field_of_view: None,
        map_frames: Vec::new(),
        change: None,
    };
    for contact in &first.contacts {
        let position = point_of(&contact.position);
        match RelayId::from_wire(contact.agent) {
            Some(id) => observation.relays.push(Relay { id, position }),
            None => observation.contacts.push(Contact { agent: AgentId(contact.agent), position }),
        }
    }
    let has_ended = first.phase == Part::ENDED;
    for part in std::iter::once(first).chain(parts) {
        let add = |list: &mut Vec<u32>, runs: &CellRuns| -> Result<(), WireError> {
            voxels::check_runs(&runs.start, &runs.length, volume)
                .map_err(|source| WireError::Cells { tick, source })?;
            list.extend(voxels::indices(&runs.start, &runs.length));
            Ok(())
        };
        add(&mut observation.seen.free, &part.seen_free)?;
        add(&mut observation.seen.wall, &part.seen_wall)?;
        if let Some(view) = &mut observation.view {
            add(&mut view.free, &part.view_free)?;
            add(&mut view.wall, &part.view_wall)?;
        }
        for maes_msgs::AgentMessage { agent, kind, data } in part.messages {
            match Peer::sender(agent) {
                Peer::Server => match kind {
                    maes_msgs::AgentMessage::SCENARIO => {
                        let change = changed_run_info(&data, run_info_before, AgentId(part.agent), tick)?;
                        observation.change = Some(Box::new(change));
                    }
                    maes_msgs::AgentMessage::ENERGY => {
                        observation.energy = Some(Box::new(Energy::from_data(&data, tick)?));
                    }
                    maes_msgs::AgentMessage::FIELD_OF_VIEW => {
                        observation.field_of_view = Some(FieldOfView::from_data(&data, tick)?);
                    }
                    maes_msgs::AgentMessage::MAP_FRAMES => {
                        observation.map_frames = MapFrame::from_data(&data, tick, run_info_before.agents)?;
                    }
                    kind => {
                        let allowed = "SCENARIO, ENERGY, FIELD_OF_VIEW or MAP_FRAMES from the server".to_owned();
                        let value = format!("kind {kind}");
                        return Err(WireError::Value { tick, field: "messages", value, allowed });
                    }
                },
                peer => observation.messages.push(AgentMessage { peer, kind, data }),
            }
        }
    }
    Ok(Reassembled { has_ended, observation })
}

/// The run info that a message of the server holds; team and map are those of before.
fn changed_run_info(data: &[u8], before: &RunInfo, agent: AgentId, tick: Tick) -> Result<RunInfo, WireError> {
    let wrong = |value: String| {
        let allowed = "a scenario with the team and the map of this run".to_owned();
        WireError::Value { tick, field: "messages", value, allowed }
    };
    let scenario: maes_msgs::Scenario = cdr::decode(data).map_err(|error| wrong(error.to_string()))?;
    let now = RunInfo::from_message(&scenario, agent)?;
    if (now.extent, now.agents, &now.bodies) != (before.extent, before.agents, &before.bodies) {
        return Err(wrong(format!("{} agents in a map of {:?} cells", now.agents, now.extent.size())));
    }
    Ok(now)
}

#[cfg(test)]
mod tests;
