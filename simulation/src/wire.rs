//! What the server says of its scenario and its world, as messages. What it exchanges with agents
//! is converted in [`protocol`]; visualisation messages are made in [`crate::visualisation`].
//!
//! There is no transport here.

use std::collections::{BTreeMap, BTreeSet};

use msgs::geometry_msgs;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs;
use msgs::sensor_name::SensorName;
use nalgebra::Point3;
use protocol::body_model::BodyModel;
pub use protocol::geometry::{MAP_FRAME, header, point, vector};
use protocol::kinematics::{turned, wrapped};
use protocol::limits::RECORDED_PROTOCOL;
use protocol::observation::Pose;
use protocol::run_info::{BASE_STATION, OF_BODY};
use voxels::{Cell, Extent, Terrain};

use crate::scenario::{AgentsSection, LidarSection, Scenario};
use world::World;
use world::localisation::Frames;
use world::map_change::CellBox;

/// The part of a scenario that agents may know, as it is recorded; the caller sets the version of
/// the protocol and the number of the run.
#[must_use]
pub fn scenario(scenario: &Scenario, extent: &Extent, rays: u32) -> maes_msgs::Scenario {
    let (bodies, body_of) = bodies(scenario);
    let of_ground = bodies.iter().enumerate().filter_map(|(number, body)| {
        let setting = body.ground_setting()?;
        Some(format!("{OF_BODY}{number}:{setting}"))
    });
    let settings = announced_settings(&scenario.agents).into_iter().chain(of_ground).collect();
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
        settings,
        bodies: bodies.into_iter().map(Into::into).collect(),
        body_of,
        lidar: maes_msgs::Lidar {
            rays,
            range_m: least(scenario, |lidar| lidar.range_m),
            fov_rad: least(scenario, |lidar| lidar.fov_rad),
            period_ticks: scenario.scan_timing().period_ticks,
        },
        communication_range_m: scenario.communication.range_m,
        radio: scenario.communication.message(),
        share_period_ticks: scenario.agents.share_period_ticks,
    }
}

/// The least of a number of the LiDARs: no agent expects to see what it does not.
fn least(scenario: &Scenario, number: impl Fn(&LidarSection) -> f64) -> f64 {
    scenario.lidars().map(|(_, lidar)| number(lidar)).fold(f64::INFINITY, f64::min)
}

/// The different body models, and by agent the index of its own.
fn bodies(scenario: &Scenario) -> (Vec<BodyModel>, Vec<u8>) {
    let mut bodies = vec![scenario.body];
    let mut body_of = vec![0; scenario.agents.count as usize];
    for (number, entry) in (1..=u8::MAX).zip(&scenario.bodies) {
        bodies.push(entry.keys.over(&scenario.body));
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
    let stations: BTreeSet<u32> = agents.base_stations.iter().copied().collect();
    let of_stations = (!stations.is_empty()).then(|| {
        let ids = id_ranges(&stations.into_iter().collect::<Vec<_>>());
        format!("@{ids}:{BASE_STATION}")
    });
    settings(&agents.set).into_iter().chain(of_others).chain(of_stations).collect()
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

/// The poses of all bodies as transforms from `map` to `agent_<id>/base_link`, and those of moving
/// obstacles.
#[must_use]
pub fn transforms(world: &World) -> msgs::tf2_msgs::TFMessage {
    let in_world = world.agents().filter(|&agent| world.presence(agent).is_in_world());
    let of_bodies = in_world.flat_map(|agent| present_transforms(world, agent));
    msgs::tf2_msgs::TFMessage { transforms: of_bodies.chain(obstacle_transforms(world)).collect() }
}

/// The present places of the moving obstacles as transforms from `map` to `obstacle_<number>`.
pub(crate) fn obstacle_transforms(world: &World) -> impl Iterator<Item = geometry_msgs::TransformStamped> {
    world.moving_obstacles().iter().enumerate().map(|(number, obstacle)| geometry_msgs::TransformStamped {
        header: header(world.tick()),
        child_frame_id: obstacle_frame(number),
        transform: geometry_msgs::Transform { translation: vector(&obstacle.centre.coords), rotation: rotation(0.0) },
    })
}

/// The present pose of a body as transforms from `map` to `agent_<id>/base_link`.
#[must_use]
pub fn present_transforms(world: &World, agent: AgentId) -> Vec<geometry_msgs::TransformStamped> {
    transforms_of(agent, world.tick(), world.body(agent).pose(), world.frames(agent).as_ref())
}

/// The pose of a body at a tick as transforms from `map` to `agent_<id>/base_link`: one, or, if
/// localisation drifts, those by way of the agent's map and of its odometry (REP 105).
#[must_use]
pub fn transforms_of(
    agent: AgentId,
    tick: Tick,
    pose: &Pose,
    frames: Option<&Frames>,
) -> Vec<geometry_msgs::TransformStamped> {
    let transform = |parent: String, child: String, pose: &Pose| geometry_msgs::TransformStamped {
        header: msgs::std_msgs::Header { frame_id: parent, ..header(tick) },
        child_frame_id: child,
        transform: geometry_msgs::Transform {
            translation: vector(&pose.position.coords),
            rotation: rotation(pose.yaw_rad),
        },
    };
    let Some(Frames { map_offset_m, odometry, .. }) = frames else {
        return vec![transform(MAP_FRAME.to_owned(), body_frame(agent), pose)];
    };
    let map = Pose { position: Point3::from(-map_offset_m), yaw_rad: 0.0 };
    let yaw_rad = wrapped(pose.yaw_rad - odometry.yaw_rad);
    let believed = pose.position + map_offset_m;
    let odom = Pose { position: believed - turned(&odometry.position.coords, yaw_rad), yaw_rad };
    let [map_frame, odom_frame] = ["map", "odom"].map(|name| format!("agent_{agent}/{name}"));
    vec![
        transform(MAP_FRAME.to_owned(), map_frame.clone(), &map),
        transform(map_frame, odom_frame.clone(), &odom),
        transform(odom_frame, body_frame(agent), odometry),
    ]
}

/// The frame of an agent's body: x forward, y left, z up, the origin in its centre.
pub fn body_frame(agent: AgentId) -> String {
    format!("agent_{agent}/base_link")
}

/// The frame of a moving obstacle, with the axes of the map and the origin in its centre.
pub(crate) fn obstacle_frame(number: usize) -> String {
    format!("obstacle_{number}")
}

/// The frame of its LiDAR, or of that with a name, where that is mounted: x ahead, z up.
pub(crate) fn lidar_frame(agent: AgentId, sensor: Option<SensorName>) -> String {
    sensor.map_or_else(|| format!("agent_{agent}/lidar"), |name| format!("agent_{agent}/{name}"))
}

/// The frame of the images of a camera: x to the right, y down, z ahead.
pub(crate) fn optical_frame(agent: AgentId, sensor: Option<SensorName>) -> String {
    match sensor {
        Some(name) => format!("agent_{agent}/{name}_optical_frame"),
        None => format!("agent_{agent}/camera_optical_frame"),
    }
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

/// What has made a change of the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapChangeCause {
    /// An event of the scenario.
    Event,
    /// A request: the change is an intervention.
    Request,
}

/// A change of the map at the beginning of this tick.
#[must_use]
pub fn map_change(tick: Tick, cells: CellBox, terrain: Terrain, cause: MapChangeCause) -> maes_msgs::MapChange {
    use maes_msgs::MapChange as Message;
    let along = |cell: Cell| [cell.x, cell.y, cell.z].map(i32::cast_unsigned);
    Message {
        header: header(tick),
        tick: tick.0,
        kind: match (terrain, cause) {
            (Terrain::Free, MapChangeCause::Event) => Message::FREE,
            (Terrain::Wall, MapChangeCause::Event) => Message::WALL,
            (Terrain::Free, MapChangeCause::Request) => Message::FREE_ON_REQUEST,
            (Terrain::Wall, MapChangeCause::Request) => Message::WALL_ON_REQUEST,
        },
        low: along(cells.low),
        high: along(cells.high),
    }
}

/// The cells, what they become and what has made the change of a message, on a map of this extent.
///
/// # Errors
/// If the kind is unknown, or the box is not one of cells inside the outermost layer of the map.
pub fn map_change_of(
    message: &maes_msgs::MapChange,
    extent: Extent,
) -> Result<(CellBox, Terrain, MapChangeCause), String> {
    use maes_msgs::MapChange as Message;
    let (terrain, cause) = match message.kind {
        Message::FREE => (Terrain::Free, MapChangeCause::Event),
        Message::WALL => (Terrain::Wall, MapChangeCause::Event),
        Message::FREE_ON_REQUEST => (Terrain::Free, MapChangeCause::Request),
        Message::WALL_ON_REQUEST => (Terrain::Wall, MapChangeCause::Request),
        kind => return Err(format!("a change of the map of kind {kind}: expected 0 to 3")),
    };
    let axes = || message.low.iter().zip(&message.high).zip(extent.size());
    if !axes().all(|((&low, &high), size)| (1..=high).contains(&low) && high < size - 1) {
        return Err(format!(
            "a change of the map from cell {:?} to {:?}: expected cells inside the outermost layer",
            message.low, message.high
        ));
    }
    let cell = |[x, y, z]: [u32; 3]| Cell::new(x.cast_signed(), y.cast_signed(), z.cast_signed());
    Ok((CellBox { low: cell(message.low), high: cell(message.high) }, terrain, cause))
}

#[cfg(test)]
mod tests;
