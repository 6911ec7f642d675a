//! Conversion between domain types and the messages of the protocol. Visualisation messages are
//! made in [`crate::visualisation`].
//!
//! Invariants: no fragment of an observation is larger than [`OBSERVATION_BYTES_MAX`] on the wire;
//! [`command`] returns only actions that are legal for the world.
//!
//! There is no transport here.

use std::collections::BTreeMap;

use msgs::event_mask::EventMask;
use msgs::geometry_msgs;
use msgs::ids::{AgentId, Tick};
use msgs::limits::{
    AGENT_MESSAGE_BYTES_BARE, AGENT_MESSAGE_BYTES_MAX, INFO_BYTES_MAX, LIST_BYTES_MAX, MESSAGE_BYTES_BARE,
    OBSERVATION_BYTES_MAX, PATH_POINTS_MAX, POINT_BYTES, RECORDED_PROTOCOL, RELAY_BYTES_MAX,
};
use msgs::maes_msgs::{self, CellRuns, Observation as Part};
use msgs::relay_id::RelayId;
use msgs::scan_request::ScanRequest;
use msgs::stage::Stage;
use msgs::std_msgs::Header;
use msgs::wake_condition::WakeCondition;
use nalgebra::{Point3, Vector3};
use voxels::{Cell, Extent, Terrain};

use crate::scenario::{AgentsSection, Scenario};
use crate::world::body::{Motion, Pose};
use crate::world::collision::Surface;
use crate::world::comms::{AgentMessage, Peer};
use crate::world::map_change::CellBox;
use crate::world::{Action, Observation, World};

/// Bytes on the wire of a contact, with padding.
const CONTACT_BYTES: usize = 32;
/// Bytes on the wire of a run of cells.
const RUN_BYTES: usize = 6;

/// The frame of the world.
pub const MAP_FRAME: &str = "map";

/// The header of a message of a tick in the frame `map`.
#[must_use]
pub fn header(tick: Tick) -> Header {
    Header { stamp: tick.into(), frame_id: MAP_FRAME.to_owned() }
}

/// An observation as fragments, in order; the caller sets the number of the run. `phase` is
/// [`Part::RUNNING`] or [`Part::ENDED`].
#[must_use]
pub fn observation_parts(observation: Observation, phase: u8) -> Vec<Part> {
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
        .map(|(agent, position)| (agent.0, position))
        .chain(observation.relays.iter().map(|(relay, position)| (relay.on_wire(), position)))
        .map(|(agent, position)| maes_msgs::Contact { agent, position: point(position) })
        .collect();
    for message in observation.messages {
        parts.make_room(AGENT_MESSAGE_BYTES_BARE + message.data.len());
        parts.filling.messages.push(message_on_wire(message));
    }
    parts.add_runs(&observation.seen_free, |part| &mut part.seen_free);
    parts.add_runs(&observation.seen_wall, |part| &mut part.seen_wall);
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

/// The action and the wake-up condition of a command.
///
/// # Errors
/// Names the field, its value and the allowed values, if the command is not legal for a team of
/// `agents`.
pub fn command(message: &maes_msgs::Command, agents: u32) -> Result<(Action, WakeCondition), String> {
    if message.info.len() > INFO_BYTES_MAX {
        return Err(format!("info has {} bytes, at most {INFO_BYTES_MAX} are allowed", message.info.len()));
    }
    Stage::from_wire(message.stage).map_err(|error| error.to_string())?;
    let action = Action {
        motion: motion(&message.motion)?,
        lidar: ScanRequest::try_from(message.lidar).map_err(|error| error.to_string())?,
        want_view: message.want_view,
        messages: agent_messages(&message.messages, agents)?,
    };
    let list_bytes = POINT_BYTES * message.motion.path.len()
        + message.messages.iter().map(|message| AGENT_MESSAGE_BYTES_BARE + message.data.len()).sum::<usize>();
    if list_bytes > LIST_BYTES_MAX {
        return Err(format!("path and messages take {list_bytes} bytes, at most {LIST_BYTES_MAX} are allowed"));
    }
    let wake = WakeCondition {
        at: Tick(message.wake.at_tick.max(message.tick.saturating_add(1))),
        events: EventMask::from_bits_retain(message.wake.events),
    };
    Ok((action, wake))
}

fn motion(motion: &maes_msgs::Motion) -> Result<Motion, String> {
    use maes_msgs::Motion as WireMotion;
    Ok(match motion.kind {
        WireMotion::KEEP => Motion::Keep,
        WireMotion::STOP => Motion::Stop,
        WireMotion::MOVE => Motion::Move {
            pitch_rad: within(
                "motion.pitch_rad",
                motion.pitch_rad,
                -std::f64::consts::FRAC_PI_2,
                std::f64::consts::FRAC_PI_2,
            )?,
            distance_m: within("motion.distance_m", motion.distance_m, 0.0, f64::INFINITY)?,
        },
        WireMotion::TURN => Motion::Turn {
            angle_rad: within("motion.angle_rad", motion.angle_rad, -std::f64::consts::TAU, std::f64::consts::TAU)?,
        },
        WireMotion::PATH => {
            if motion.path.is_empty() {
                return Err(format!("motion.path has 0 waypoints, 1 to {PATH_POINTS_MAX} are allowed"));
            }
            Motion::Path(waypoints(&motion.path)?)
        }
        WireMotion::VELOCITY => Motion::Velocity {
            linear_in_body_m_s: Vector3::new(
                coordinate("motion.linear_m_s.x", motion.linear_m_s.x)?,
                coordinate("motion.linear_m_s.y", motion.linear_m_s.y)?,
                coordinate("motion.linear_m_s.z", motion.linear_m_s.z)?,
            ),
            yaw_rate_rad_s: coordinate("motion.yaw_rate_rad_s", motion.yaw_rate_rad_s)?,
            path: waypoints(&motion.path)?,
        },
        other => return Err(format!("motion.kind = {other}, 0 to 5 are allowed")),
    })
}

fn waypoints(path: &[geometry_msgs::Point]) -> Result<Vec<Point3<f64>>, String> {
    if path.len() > PATH_POINTS_MAX {
        return Err(format!("motion.path has {} waypoints, at most {PATH_POINTS_MAX} are allowed", path.len()));
    }
    let waypoint = |point: &geometry_msgs::Point| {
        Ok(Point3::new(
            coordinate("motion.path x", point.x)?,
            coordinate("motion.path y", point.y)?,
            coordinate("motion.path z", point.z)?,
        ))
    };
    path.iter().map(waypoint).collect()
}

fn agent_messages(messages: &[maes_msgs::AgentMessage], agents: u32) -> Result<Vec<AgentMessage>, String> {
    let bytes: usize = messages.iter().map(|message| message.data.len()).sum();
    if bytes > AGENT_MESSAGE_BYTES_MAX {
        return Err(format!("the messages hold {bytes} bytes, at most {AGENT_MESSAGE_BYTES_MAX} are allowed"));
    }
    messages
        .iter()
        .map(|message| {
            let relay = RelayId::from_wire(message.agent).filter(|relay| relay.owner.0 < agents);
            let peer = match (message.agent, relay) {
                (maes_msgs::AgentMessage::BROADCAST, _) => Peer::Broadcast,
                (maes_msgs::AgentMessage::LEAVE_RELAY, _) => Peer::NewRelay,
                (_, Some(relay)) => Peer::Relay(relay),
                (agent, _) if agent < agents => Peer::One(AgentId(agent)),
                (other, _) => {
                    return Err(format!(
                        "a message is for agent {other}, 0 to {}, BROADCAST, LEAVE_RELAY or a relay are allowed",
                        agents - 1
                    ));
                }
            };
            let bytes = message.data.len();
            if matches!(peer, Peer::Relay(_) | Peer::NewRelay) && bytes > RELAY_BYTES_MAX {
                return Err(format!("a message to a relay holds {bytes} bytes, at most {RELAY_BYTES_MAX} are allowed"));
            }
            Ok(AgentMessage { peer, kind: message.kind, data: message.data.clone() })
        })
        .collect()
}

/// Bound of lengths and rates, beyond which precision would suffer.
const COORDINATE_MAX: f64 = 1e6;

fn coordinate(field: &str, value: f64) -> Result<f64, String> {
    within(field, value, -COORDINATE_MAX, COORDINATE_MAX)
}

fn within(field: &str, value: f64, low: f64, high: f64) -> Result<f64, String> {
    if value >= low && value <= high {
        Ok(value)
    } else {
        Err(format!("{field} = {value}, {low} to {high} is allowed"))
    }
}

fn message_on_wire(message: AgentMessage) -> maes_msgs::AgentMessage {
    maes_msgs::AgentMessage {
        agent: match message.peer {
            Peer::One(agent) => agent.0,
            Peer::Broadcast => maes_msgs::AgentMessage::BROADCAST,
            Peer::Relay(relay) => relay.on_wire(),
            Peer::NewRelay => maes_msgs::AgentMessage::LEAVE_RELAY,
            Peer::Server => maes_msgs::AgentMessage::SERVER,
        },
        kind: message.kind,
        data: message.data,
    }
}

/// The part of a scenario that agents may know, as it is recorded; the caller sets the version of
/// the protocol and the number of the run.
#[must_use]
pub fn scenario(scenario: &Scenario, extent: &Extent, rays: u32) -> maes_msgs::Scenario {
    let (bodies, body_of) = bodies(scenario);
    maes_msgs::Scenario {
        protocol: RECORDED_PROTOCOL,
        run: 0,
        origin: 0,
        tick_ns: Tick::TICK_NS,
        duration_ticks: scenario.duration_ticks().0,
        size: extent.size(),
        cell_m: extent.cell_m(),
        agents: scenario.agents.count,
        agents_seed: agents_seed(scenario.seed),
        controller: scenario.agents.controller.clone(),
        settings: announced_settings(&scenario.agents),
        bodies,
        body_of,
        lidar: maes_msgs::Lidar {
            rays,
            range_m: scenario.lidar.range_m,
            fov_rad: scenario.lidar.fov_rad,
            period_ticks: scenario.lidar.period_ticks,
        },
        communication_range_m: scenario.communication.range_m,
        radio: scenario.communication.message(),
        share_period_ticks: scenario.agents.share_period_ticks,
    }
}

/// The different body models, and by agent the index of its own.
fn bodies(scenario: &Scenario) -> (Vec<maes_msgs::Body>, Vec<u8>) {
    let mut bodies = vec![maes_msgs::Body::from(scenario.body)];
    let mut body_of = vec![0; scenario.agents.count as usize];
    for (number, entry) in (1..=u8::MAX).zip(&scenario.bodies) {
        bodies.push(entry.keys.over(&scenario.body).into());
        for &agent in &entry.agents {
            body_of[agent as usize] = number;
        }
    }
    (bodies, body_of)
}

/// The settings of a controller, each `KEY=VALUE`.
#[must_use]
pub fn settings(set: &BTreeMap<String, toml::Value>) -> Vec<String> {
    let setting = |(key, value): (&String, &toml::Value)| match value {
        toml::Value::String(text) => format!("{key}={text}"),
        other => format!("{key}={other}"),
    };
    set.iter().map(setting).collect()
}

/// The settings as `Scenario.msg` has them: those of `agents.controller`, and the controllers of a
/// mix with theirs.
#[must_use]
pub fn announced_settings(agents: &AgentsSection) -> Vec<String> {
    let of_others = agents.mix.iter().zip(agents.mixed_ids()).filter(|(_, ids)| !ids.is_empty());
    let of_others = of_others.flat_map(|(entry, ids)| {
        let whose = id_ranges(&ids);
        let words = std::iter::once(entry.controller.clone()).chain(settings(&entry.set));
        words.map(|word| format!("@{whose}:{word}")).collect::<Vec<_>>()
    });
    settings(&agents.set).into_iter().chain(of_others).collect()
}

/// Ascending ids as `0-2,4`.
fn id_ranges(ids: &[u32]) -> String {
    let runs = ids.chunk_by(|before, after| before + 1 == *after);
    let text = |run: &[u32]| match run {
        [first, .., last] => format!("{first}-{last}"),
        run => run.iter().map(u32::to_string).collect(),
    };
    runs.map(text).collect::<Vec<_>>().join(",")
}

/// The seed of the agents, from which the seed of the map cannot be derived.
fn agents_seed(seed: u64) -> u64 {
    use rand_chacha::rand_core::Rng;
    voxels::random_streams::stream(seed, 0, "agents").next_u64()
}

/// The progress of a world.
#[must_use]
pub fn progress(world: &mut World) -> maes_msgs::Progress {
    let pairs_in_contact = world.pairs_in_contact();
    let coverage = world.coverage();
    maes_msgs::Progress {
        header: header(world.tick()),
        tick: world.tick().0,
        explored: coverage.explored(),
        covered: coverage.covered(),
        explored_by: coverage.explored_by(),
        covered_by: coverage.covered_by(),
        distance_m: world.distance_m(),
        believed_by: coverage.believed_by(),
        pairs_in_contact,
        message_bytes: world.totals().message_bytes_delivered,
    }
}

/// The poses of all bodies as transforms from `map` to `agent_<id>/base_link`.
#[must_use]
pub fn transforms(world: &World) -> msgs::tf2_msgs::TFMessage {
    let transforms = world
        .agents()
        .filter(|&agent| world.presence(agent).is_in_world())
        .map(|agent| transform(agent, world.tick(), world.body(agent).pose()))
        .collect();
    msgs::tf2_msgs::TFMessage { transforms }
}

/// The pose of a body at a tick as a transform from `map` to `agent_<id>/base_link`.
#[must_use]
pub fn transform(agent: AgentId, tick: Tick, pose: &Pose) -> geometry_msgs::TransformStamped {
    geometry_msgs::TransformStamped {
        header: header(tick),
        child_frame_id: body_frame(agent),
        transform: geometry_msgs::Transform {
            translation: vector(&pose.position.coords),
            rotation: rotation(pose.yaw_rad),
        },
    }
}

/// The frame of an agent's body: x forward, y left, z up, the origin in its centre.
pub fn body_frame(agent: AgentId) -> String {
    format!("agent_{agent}/base_link")
}

/// A pose (metres, radians, frame `map`) as a message.
#[must_use]
pub fn pose(pose: &Pose) -> geometry_msgs::Pose {
    geometry_msgs::Pose { position: point(&pose.position), orientation: rotation(pose.yaw_rad) }
}

/// The rotation about the vertical by `yaw_rad`, as a quaternion.
pub fn rotation(yaw_rad: f64) -> geometry_msgs::Quaternion {
    let (sin, cos) = libm::sincos(yaw_rad * 0.5);
    geometry_msgs::Quaternion { x: 0.0, y: 0.0, z: sin, w: cos }
}

/// What an intervention does to an agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Change {
    /// Its body is placed at a pose, at rest.
    Place(Pose),
    /// It leaves the run, and its body stays: only in recordings of earlier builds.
    Remove,
    /// It leaves the world with its body.
    Leave,
    /// It joins at a pose, at rest.
    Join(Pose),
}

/// A change of an agent before this tick.
#[must_use]
pub fn intervention(tick: Tick, agent: AgentId, change: &Change) -> maes_msgs::Intervention {
    use maes_msgs::Intervention as Message;
    let (kind, pose) = match change {
        Change::Place(pose) => (Message::PLACE, Some(pose)),
        Change::Remove => (Message::REMOVE, None),
        Change::Leave => (Message::LEAVE, None),
        Change::Join(pose) => (Message::JOIN, Some(pose)),
    };
    Message {
        header: header(tick),
        tick: tick.0,
        kind,
        agent: agent.0,
        position: pose.map(|pose| point(&pose.position)).unwrap_or_default(),
        yaw_rad: pose.map_or(0.0, |pose| pose.yaw_rad),
    }
}

/// The change that an intervention makes.
///
/// # Errors
/// If its kind is unknown.
pub fn change(intervention: &maes_msgs::Intervention) -> Result<Change, String> {
    use maes_msgs::Intervention as Message;
    let Message { position: geometry_msgs::Point { x, y, z }, yaw_rad, .. } = *intervention;
    let pose = Pose { position: Point3::new(x, y, z), yaw_rad };
    match intervention.kind {
        Message::PLACE => Ok(Change::Place(pose)),
        Message::REMOVE => Ok(Change::Remove),
        Message::LEAVE => Ok(Change::Leave),
        Message::JOIN => Ok(Change::Join(pose)),
        kind => Err(format!("an intervention of kind {kind}: expected 0 to 3")),
    }
}

/// A change of the map at the beginning of this tick.
#[must_use]
pub fn map_change(tick: Tick, cells: CellBox, terrain: Terrain) -> maes_msgs::MapChange {
    let along = |cell: Cell| [cell.x, cell.y, cell.z].map(i32::cast_unsigned);
    maes_msgs::MapChange {
        header: header(tick),
        tick: tick.0,
        kind: match terrain {
            Terrain::Free => maes_msgs::MapChange::FREE,
            Terrain::Wall => maes_msgs::MapChange::WALL,
        },
        low: along(cells.low),
        high: along(cells.high),
    }
}

/// The cells that a recorded change of a map of this extent sets, and to what.
///
/// # Errors
/// If its kind is unknown, or the cells are no box inside the map.
pub fn changed_cells(change: &maes_msgs::MapChange, extent: Extent) -> Result<(CellBox, Terrain), String> {
    let terrain = match change.kind {
        maes_msgs::MapChange::FREE => Terrain::Free,
        maes_msgs::MapChange::WALL => Terrain::Wall,
        kind => return Err(format!("a change of the map of kind {kind}: expected 0 or 1")),
    };
    let maes_msgs::MapChange { low, high, .. } = change;
    let is_inside = (0..3).all(|axis| low[axis] <= high[axis] && high[axis] < extent.size()[axis]);
    if !is_inside {
        return Err(format!("a change of the map from {low:?} to {high:?}: expected a box of cells inside the map"));
    }
    let cell = |[x, y, z]: [u32; 3]| Cell::new(x.cast_signed(), y.cast_signed(), z.cast_signed());
    Ok((CellBox { low: cell(*low), high: cell(*high) }, terrain))
}

/// A point in metres as a message.
#[must_use]
pub fn point(point: &Point3<f64>) -> geometry_msgs::Point {
    geometry_msgs::Point { x: point.x, y: point.y, z: point.z }
}

/// A vector as a message.
#[must_use]
pub fn vector(vector: &Vector3<f64>) -> geometry_msgs::Vector3 {
    geometry_msgs::Vector3 { x: vector.x, y: vector.y, z: vector.z }
}

#[cfg(test)]
mod tests;
