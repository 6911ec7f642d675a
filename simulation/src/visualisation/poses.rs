//! Transforms, odometry, paths and contacts.

use msgs::geometry_msgs::{
    Pose, PoseStamped, PoseWithCovariance, TransformStamped, Twist, TwistWithCovariance, Vector3,
};
use msgs::ids::{AgentId, Tick};
use msgs::limits::{MESSAGE_BYTES_BARE, POINT_BYTES, VIEW_BYTES_MAX};
use msgs::nav_msgs::{Odometry, Path};
use msgs::std_msgs::ColorRGBA;
use msgs::tf2_msgs::TFMessage;
use msgs::topics::TRANSFORMS_MAX;
use msgs::visualization_msgs::Marker;
use nalgebra::Point3;

use crate::wire::{body_frame, header, point, rotation, vector};
use crate::world::World;

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

/// The poses of all bodies, in messages of bounded size.
pub(super) fn transforms(world: &World) -> impl Iterator<Item = TFMessage> + use<> {
    in_parts(crate::wire::transforms(world).transforms)
}

/// The frame of each LiDAR: the centre of the body.
pub(super) fn static_transforms<A>(agents: A, tick: Tick) -> impl Iterator<Item = TFMessage> + use<A>
where
    A: Iterator<Item = AgentId>,
{
    let of_agent = |agent| {
        let frame = body_frame(agent);
        let child_frame_id = format!("agent_{agent}/lidar");
        let header = msgs::std_msgs::Header { frame_id: frame, ..header(tick) };
        TransformStamped { header, child_frame_id, ..TransformStamped::default() }
    };
    in_parts(agents.map(of_agent).collect())
}

fn in_parts(transforms: Vec<TransformStamped>) -> impl Iterator<Item = TFMessage> {
    let parts: Vec<TFMessage> =
        transforms.chunks(TRANSFORMS_MAX).map(|part| TFMessage { transforms: part.to_vec() }).collect();
    parts.into_iter()
}

/// The true pose of an agent at the start of this tick (metres, frame `map`), and its velocity in
/// the last fixed update (m/s and rad/s, frame of the body). The covariances are zero.
#[must_use]
pub fn odometry(world: &World, agent: AgentId) -> Odometry {
    let body = world.body(agent);
    let pose = body.pose();
    Odometry {
        header: header(world.tick()),
        child_frame_id: body_frame(agent),
        pose: PoseWithCovariance {
            pose: Pose { position: point(&pose.position), orientation: rotation(pose.yaw_rad) },
            ..PoseWithCovariance::default()
        },
        twist: TwistWithCovariance {
            twist: Twist {
                linear: vector(&body.velocity_in_body_m_s()),
                angular: Vector3 { z: body.yaw_rate_rad_s(), ..Vector3::default() },
            },
            ..TwistWithCovariance::default()
        },
    }
}

/// A path along waypoints (metres, frame `map`).
pub(super) fn path(tick: Tick, waypoints: &[Point3<f64>]) -> Path {
    let pose =
        |waypoint| PoseStamped { header: header(tick), pose: Pose { position: point(waypoint), ..Pose::default() } };
    Path { header: header(tick), poses: waypoints.iter().take(POSES_MAX).map(pose).collect() }
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
