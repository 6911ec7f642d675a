//! Transforms, odometry, paths and contacts.

use msgs::geometry_msgs::{
    Covariance, Pose, PoseStamped, PoseWithCovariance, Quaternion, Transform, TransformStamped, Twist,
    TwistWithCovariance, Vector3,
};
use msgs::ids::{AgentId, Tick};
use msgs::nav_msgs::{Odometry, Path};
use msgs::sensor_name::SensorName;
use msgs::std_msgs::ColorRGBA;
use msgs::std_msgs::Header;
use msgs::tf2_msgs::TFMessage;
use msgs::topics::TRANSFORMS_MAX;
use msgs::visualization_msgs::Marker;
use nalgebra::{Point3, SMatrix};
use protocol::limits::{MESSAGE_BYTES_BARE, POINT_BYTES, VIEW_BYTES_MAX};

use crate::wire::{MAP_FRAME, body_frame, header, lidar_frame, optical_frame, point, rotation, vector};
use world::World;
use world::body::Pose as BodyPose;
use world::lidar::{NamedScanner, PlaceOnBody};

/// Bytes on the wire of a pose with a header, with padding.
const POSE_BYTES: usize = 72;

/// Largest number of poses in a path; later waypoints are omitted.
const POSES_MAX: usize = (VIEW_BYTES_MAX - MESSAGE_BYTES_BARE) / POSE_BYTES;

/// Largest number of contact lines; later ones are omitted.
const LINES_MAX: usize = (VIEW_BYTES_MAX - MESSAGE_BYTES_BARE) / (2 * POINT_BYTES);

/// Width of a contact line, in cells.
const LINE_CELLS: f64 = 0.1;

/// Its colour.
const LINE_COLOUR: ColorRGBA = ColorRGBA { r: 0.1, g: 0.8, b: 0.2, a: 0.9 };

/// What decides the frames that do not move.
#[derive(Debug, Clone)]
pub struct StaticFrames {
    /// By agent, the names of the LiDARs and where they are on the body.
    pub lidars: Vec<Vec<(Option<SensorName>, PlaceOnBody)>>,
    /// Whether localisation drifts; otherwise the frame of each odometry is the map.
    pub has_drift: bool,
}

impl StaticFrames {
    pub(super) fn of(world: &World) -> Self {
        let mut agents = world.agents();
        let has_drift = agents.next().is_some_and(|agent| world.frames(agent).is_some());
        let place = |lidar: &NamedScanner| (lidar.name, lidar.scanner.place_on_body());
        let of_agent = |agent| world.sensors(agent).lidars().iter().map(place).collect();
        Self { lidars: world.agents().map(of_agent).collect(), has_drift }
    }
}

/// The poses of all bodies, in messages of bounded size.
pub(super) fn transforms(world: &World) -> impl Iterator<Item = TFMessage> + use<> {
    in_parts(crate::wire::transforms(world).transforms)
}

/// The frames of these agents that do not move at a tick: of the LiDARs, of the images of cameras,
/// and of odometry, where it is the map.
pub(super) fn static_transforms(frames: &StaticFrames, tick: Tick) -> impl Iterator<Item = TFMessage> + use<> {
    let StaticFrames { lidars, has_drift } = frames;
    let on_body = |lidar: &PlaceOnBody| {
        let (sin, cos) = libm::sincos(-0.5 * lidar.pitch_rad);
        Transform {
            translation: Vector3 { z: lidar.height_m, ..Vector3::default() },
            rotation: Quaternion { x: 0.0, y: sin + 0.0, z: 0.0, w: cos },
        }
    };
    // x to the right, y down, z ahead.
    let optical = Transform { rotation: Quaternion { x: -0.5, y: 0.5, z: -0.5, w: 0.5 }, ..Transform::default() };
    let frame = move |frame_id: String, child_frame_id: String, transform| {
        let header = Header { frame_id, ..header(tick) };
        TransformStamped { header, child_frame_id, transform }
    };
    let of_agent = |(agent, lidars): (u32, &Vec<(Option<SensorName>, PlaceOnBody)>)| {
        let agent = AgentId(agent);
        let of_lidar = |(name, lidar): &(Option<SensorName>, PlaceOnBody)| {
            let own = lidar_frame(agent, *name);
            let optical = lidar.is_camera.then(|| frame(own.clone(), optical_frame(agent, *name), optical));
            [Some(frame(body_frame(agent), own, on_body(lidar))), optical]
        };
        let odometry =
            (!has_drift).then(|| frame(MAP_FRAME.to_owned(), format!("agent_{agent}/odom"), Transform::default()));
        lidars.iter().flat_map(of_lidar).chain([odometry]).flatten().collect::<Vec<_>>()
    };
    in_parts((0..).zip(lidars).flat_map(of_agent).collect())
}

/// Transforms in messages of bounded size. Those of a body stay together.
pub(super) fn in_parts(transforms: Vec<TransformStamped>) -> impl Iterator<Item = TFMessage> {
    let mut parts: Vec<TFMessage> = Vec::new();
    for of_body in transforms.chunk_by(|parent, child| parent.child_frame_id == child.header.frame_id) {
        match parts.last_mut() {
            Some(part) if part.transforms.len() + of_body.len() <= TRANSFORMS_MAX => {
                part.transforms.extend_from_slice(of_body);
            }
            _ => parts.push(TFMessage { transforms: of_body.to_vec() }),
        }
    }
    parts.into_iter()
}

/// The pose of an agent by odometry at the start of this tick (metres), and its velocity in the
/// last fixed update (m/s and rad/s, frame of the body). What is exact has covariances of 1e-9
/// (m^2, rad^2) on their diagonals: zeros would mean that they are not known. The frame of the pose
/// is `map`, in which it is exact, or, if localisation drifts, `agent_<id>/odom`.
#[must_use]
pub fn odometry(world: &World, agent: AgentId) -> Odometry {
    let body = world.body(agent);
    let exact = covariance(EXACT_VARIANCE);
    let (header, pose, covariance_of_pose) = match world.frames(agent) {
        None => (header(world.tick()), *body.pose(), exact),
        Some(frames) => {
            let header = Header { frame_id: format!("agent_{agent}/odom"), ..header(world.tick()) };
            (header, frames.odometry, drifted_covariance(&frames.covariance))
        }
    };
    Odometry {
        header,
        child_frame_id: body_frame(agent),
        pose: PoseWithCovariance {
            pose: Pose { position: point(&pose.position), orientation: rotation(pose.yaw_rad) },
            covariance: covariance_of_pose,
        },
        twist: TwistWithCovariance {
            twist: Twist {
                linear: vector(&body.velocity_in_body_m_s()),
                angular: Vector3 { z: body.yaw_rate_rad_s(), ..Vector3::default() },
            },
            covariance: exact,
        },
    }
}

/// The same with the position that the agent measures for itself, and the variance of that; a
/// position that drifts has no other error.
#[must_use]
pub fn measured_odometry(world: &World, agent: AgentId) -> Odometry {
    let mut odometry = odometry(world, agent);
    if world.frames(agent).is_some() {
        return odometry;
    }
    odometry.pose.pose.position = point(&world.measured_position(agent));
    odometry.pose.covariance = covariance(world.measured_variance_m2().max(EXACT_VARIANCE));
    odometry
}

/// Variance of what is exact: of no consequence for a filter, and not singular (m^2, rad^2).
const EXACT_VARIANCE: f64 = 1e-9;

/// A covariance without correlations, row by row: this variance along x, y and z, and an exact
/// orientation.
fn covariance(position_variance: f64) -> Covariance {
    let mut covariance = Covariance::default();
    for axis in 0..6 {
        covariance.0[axis * 7] = if axis < 3 { position_variance } else { EXACT_VARIANCE };
    }
    covariance
}

/// The covariance of a pose from that of x, y, z and heading; roll and pitch are exact.
fn drifted_covariance(drifted: &SMatrix<f64, 4, 4>) -> Covariance {
    /// The rows of x, y, z and heading among those of x, y, z, roll, pitch and yaw.
    const ROWS: [usize; 4] = [0, 1, 2, 5];
    let mut covariance = covariance(EXACT_VARIANCE);
    for (row, &at_row) in ROWS.iter().enumerate() {
        for (column, &at_column) in ROWS.iter().enumerate() {
            let exact = if row == column { EXACT_VARIANCE } else { 0.0 };
            covariance.0[at_row * 6 + at_column] = drifted[(row, column)] + exact;
        }
    }
    covariance
}

/// A path of a body along waypoints (metres, frame `map`). At each the heading is that of the way
/// to the next one, at the last that of the way to it; a vertical way keeps the heading.
pub(super) fn path(tick: Tick, from: &BodyPose, waypoints: &[Point3<f64>]) -> Path {
    let (mut before, mut yaw_rad) = (from.position, from.yaw_rad);
    let mut headings = Vec::with_capacity(waypoints.len() + 1);
    for waypoint in waypoints.iter().take(POSES_MAX) {
        let way = waypoint - before;
        if way.xy() != nalgebra::Vector2::zeros() {
            yaw_rad = libm::atan2(way.y, way.x);
        }
        headings.push(yaw_rad);
        before = *waypoint;
    }
    // That of the way that begins there.
    let headings = headings.iter().skip(1).chain(headings.last());
    let poses = waypoints.iter().zip(headings).map(|(waypoint, yaw_rad)| PoseStamped {
        header: header(tick),
        pose: Pose { position: point(waypoint), orientation: rotation(*yaw_rad) },
    });
    Path { header: header(tick), poses: poses.collect() }
}

/// A line for each pair of agents in contact, from each agent to the relays that it reaches, and
/// for each pair of relays in contact.
pub(super) fn contacts(world: &mut World) -> Marker {
    let mut ends = Vec::new();
    for one in world.agents() {
        for other in world.in_contact_with(one).into_iter().filter(|&other| other > one) {
            ends.extend([one, other].map(|agent| point(&world.body(agent).pose().position)));
        }
    }
    for agent in world.agents() {
        let body = world.body(agent).pose().position;
        ends.extend(world.relays_of(agent).iter().flat_map(|(_, relay)| [point(&body), point(relay)]));
    }
    let relays = world.relays();
    let links = world.relay_links().iter();
    ends.extend(links.flat_map(|&(one, other)| [one, other]).map(|relay| point(&relays[relay].position)));
    ends.truncate(2 * LINES_MAX);
    let width_m = LINE_CELLS * world.terrain().extent().cell_m();
    Marker::lines(header(world.tick()), "contacts", 0, width_m, LINE_COLOUR, ends)
}
