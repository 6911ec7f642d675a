//! Observations from messages: fragments are checked and reassembled.
//!
//! Invariant: a complete observation is consistent with the run, whatever was received; a fragment
//! that is rejected leaves no trace in one.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use msgs::cdr;
use msgs::event_mask::EventMask;
use msgs::geometry_msgs;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, CellRuns, Observation as Part};
use msgs::relay_id::RelayId;
use nalgebra::{Point3, Vector3};

use super::{WireError, run_info};
use agent::observation::{
    Cells, Collision, Contact, Observation, Pose, Reading, ReceivedMessage, Relay, RunInfo, Surface,
};

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
            && extent.contains(extent.cell_of(&point(place)))
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
        pose: Pose { position: point(&first.position), yaw_rad: first.yaw_rad },
        velocity_m_s: Vector3::new(first.velocity_m_s.x, first.velocity_m_s.y, first.velocity_m_s.z),
        yaw_rate_rad_s: first.yaw_rate_rad_s,
        is_active: first.task_status == Part::ACTIVE,
        collision: surface.map(|surface| Collision { surface, with_agent: first.collision_with_agent }),
        events: EventMask::from_bits_retain(first.events),
        contacts: Vec::with_capacity(first.contacts.len()),
        relays: Vec::new(),
        messages: Vec::new(),
        readings: Vec::new(),
        scan_tick: (first.scan_tick != Part::NEVER).then_some(Tick(first.scan_tick)),
        seen: Cells::default(),
        view: first.has_view.then(Cells::default),
        change: None,
    };
    for contact in &first.contacts {
        let position = point(&contact.position);
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
            if agent == maes_msgs::AgentMessage::SERVER {
                observation.change =
                    Some(Box::new(changed_run_info(&data, run_info_before, AgentId(part.agent), tick)?));
                continue;
            }
            match RelayId::from_wire(agent) {
                Some(relay) => observation.readings.push(Reading { relay, kind, data }),
                None => observation.messages.push(ReceivedMessage { from: AgentId(agent), kind, data }),
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
    let now = run_info(&scenario, agent)?;
    if (now.extent, now.agents, &now.bodies) != (before.extent, before.agents, &before.bodies) {
        return Err(wrong(format!("{} agents in a map of {:?} cells", now.agents, now.extent.size())));
    }
    Ok(now)
}

fn point(point: &geometry_msgs::Point) -> Point3<f64> {
    Point3::new(point.x, point.y, point.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(tick: u64, part: u16, parts: u16, start: u32) -> Part {
        let seen_free = CellRuns { start: vec![start], length: vec![2] };
        Part { tick, part, parts, seen_free, ..Part::default() }
    }

    fn run() -> RunInfo {
        let size = [4, 4, 4];
        let (bodies, body_of) = (vec![maes_msgs::Body::default()], vec![0; 2]);
        let (cell_m, duration_ticks) = (1.0, 9);
        let scenario =
            maes_msgs::Scenario { size, cell_m, agents: 2, duration_ticks, bodies, body_of, ..Default::default() };
        run_info(&scenario, AgentId(0)).unwrap()
    }

    #[test]
    fn fragments_reassemble_in_any_order_and_repeated() {
        let mut reassembler = FragmentReassembler::default();
        let run = run();
        assert_eq!(reassembler.take(part(5, 1, 3, 10), &run), Ok(None));
        assert_eq!(reassembler.take(part(5, 1, 3, 10), &run), Ok(None));
        assert_eq!(reassembler.take(part(5, 2, 3, 20), &run), Ok(None));
        let whole = reassembler.take(part(5, 0, 3, 0), &run).unwrap().unwrap();
        assert_eq!(whole.observation.seen.free, [0, 1, 10, 11, 20, 21]);
        assert!(!whole.has_ended);
    }

    #[test]
    fn new_tick_drops_incomplete_fragments() {
        let mut reassembler = FragmentReassembler::default();
        let run = run();
        assert_eq!(reassembler.take(part(5, 0, 2, 0), &run), Ok(None));
        assert_eq!(reassembler.take(part(6, 1, 2, 10), &run), Ok(None));
        let whole = reassembler.take(part(6, 0, 2, 4), &run).unwrap().unwrap();
        assert_eq!(whole.observation.seen.free, [4, 5, 10, 11]);
    }

    #[test]
    fn inconsistent_fragments_and_cells_are_refused() {
        let run = run();
        assert!(matches!(FragmentReassembler::default().take(part(5, 1, 1, 0), &run), Err(WireError::Part { .. })));
        assert!(matches!(FragmentReassembler::default().take(part(5, 0, 1, 63), &run), Err(WireError::Cells { .. })));
        let scenario = maes_msgs::Scenario { size: [0, 1, 1], cell_m: 1.0, ..Default::default() };
        assert!(run_info(&scenario, AgentId(0)).is_err());
    }

    #[test]
    fn illegal_values_are_refused() {
        let refused = |change: &dyn Fn(&mut Part)| {
            let mut wrong = part(5, 0, 1, 0);
            change(&mut wrong);
            FragmentReassembler::default().take(wrong, &run()).unwrap_err().to_string()
        };
        let place = |x| geometry_msgs::Point { x, y: 1.0, z: 1.0 };
        let contact = |agent, x| maes_msgs::Contact { agent, position: place(x) };
        assert_eq!(
            refused(&|part| part.yaw_rad = f64::NAN),
            "observation of tick 5: yaw_rad = NaN: expected -2 pi to 2 pi"
        );
        for x in [f64::NAN, f64::INFINITY, -0.5, 4.0] {
            assert!(refused(&|part| part.position = place(x)).contains("position = Point"), "{x}");
            assert!(
                refused(&|part| part.contacts = vec![contact(0, x)]).contains("expected a place in the map"),
                "{x}"
            );
        }
        assert!(refused(&|part| part.velocity_m_s.z = f64::INFINITY).contains("velocity_m_s.z = inf"));
        assert!(refused(&|part| part.yaw_rate_rad_s = f64::NAN).contains("yaw_rate_rad_s = NaN"));
        assert!(
            refused(&|part| part.contacts = vec![contact(2, 1.0)])
                .contains("contacts = 2: expected agents, 0 to 1, and their relays")
        );
        assert!(refused(&|part| part.contacts = vec![contact(1, 1.0); 2]).contains("each agent once, ascending"));
        let message = maes_msgs::AgentMessage { agent: 2, ..Default::default() };
        assert!(
            refused(&|part| part.messages = vec![message.clone()])
                .contains("messages = 2: expected agents, 0 to 1, and their relays")
        );
        assert!(refused(&|part| part.tick = u64::MAX).contains("expected a tick of a run, 0 to 10000000000"));
    }

    #[test]
    fn fragments_must_agree_on_their_count() {
        let mut reassembler = FragmentReassembler::default();
        assert_eq!(reassembler.take(part(5, 1, 2, 10), &run()), Ok(None));
        assert_eq!(
            reassembler.take(part(5, 0, 1, 0), &run()),
            Err(WireError::Part { tick: Tick(5), part: 0, parts: 1 })
        );
    }
}
