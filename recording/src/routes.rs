//! The routes of a recorded run: where its bodies truly were, from the transforms on `/tf`.
//!
//! Where localisation drifts, the pose of a body comes by way of the agent's map and odometry
//! (REP 105); the composition is its true position.

use std::collections::BTreeMap;

use msgs::cdr::CdrError;
use msgs::geometry_msgs::{Transform, Vector3};
use msgs::ids::{AgentId, Tick};
use msgs::tf2_msgs::TFMessage;
use msgs::topics;
use nalgebra::{Point3, Quaternion, Translation3, UnitQuaternion};
use simulation::wire::MAP_FRAME;

use crate::Recording;

/// The frame of a body, behind the name of its agent.
const BODY_FRAME: &str = "base_link";

/// Most frames between a body and the world: those of its odometry and of its map, and one more.
const CHAIN_MAX: usize = 4;

/// The route of a body: positions in the frame `map`, m, in parts between which it was not in the
/// world. A part has a position at least, and no two equal ones in a row.
pub type Route = Vec<Vec<[f64; 3]>>;

/// The routes of all agents of a recording that has poses every `period_ticks` ticks, by agent.
///
/// # Errors
/// If a message on `/tf` cannot be decoded.
pub fn read(recording: &Recording, period_ticks: u32) -> Result<BTreeMap<AgentId, Route>, CdrError> {
    let topic = topics::tf().name;
    let mut routes: BTreeMap<AgentId, (Route, Tick)> = BTreeMap::new();
    for message in recording.messages().filter(|message| message.channel.topic == topic) {
        let tick = message.tick();
        let poses: TFMessage = message.decode()?;
        // Those of scans, which are older, are there for visualisation messages.
        if poses.transforms.first().is_some_and(|first| first.header.stamp != tick.into()) {
            continue;
        }
        for (agent, position) in positions(&poses) {
            let (route, last) = routes.entry(agent).or_insert_with(|| (Vec::new(), tick));
            let was_away = tick.0.saturating_sub(last.0) > u64::from(period_ticks);
            *last = tick;
            match route.last_mut() {
                Some(part) if !was_away => {
                    if part.last() != Some(&position) {
                        part.push(position);
                    }
                }
                _ => route.push(vec![position]),
            }
        }
    }
    Ok(routes.into_iter().map(|(agent, (route, _))| (agent, route)).collect())
}

/// The positions of the bodies whose transforms are all in a message, m, in the frame `map`.
fn positions(message: &TFMessage) -> Vec<(AgentId, [f64; 3])> {
    let parents: BTreeMap<&str, (&str, &Transform)> = message
        .transforms
        .iter()
        .map(|stamped| (stamped.child_frame_id.as_str(), (stamped.header.frame_id.as_str(), &stamped.transform)))
        .collect();
    let position = |body: &str| {
        let (mut frame, mut position) = (body, Point3::origin());
        for _ in 0..CHAIN_MAX {
            let (parent, transform) = parents.get(frame)?;
            position = moved(transform, &position);
            frame = parent;
            if frame == MAP_FRAME {
                // A file that is no run of ours may hold any number.
                return position.iter().all(|along| along.is_finite()).then(|| position.coords.into());
            }
        }
        None
    };
    let of_body = |frame: &&str| {
        // Frames are named as topics are, without the first slash.
        let (agent, rest) = topics::split(&format!("/{frame}")).map(|(agent, rest)| (agent, rest.to_owned()))?;
        Some((agent, (rest == BODY_FRAME).then(|| position(frame))??))
    };
    parents.keys().filter_map(of_body).collect()
}

/// A point of the child frame in the parent frame.
fn moved(transform: &Transform, point: &Point3<f64>) -> Point3<f64> {
    let Transform { translation: Vector3 { x, y, z }, rotation } = transform;
    let turn = Quaternion::new(rotation.w, rotation.x, rotation.y, rotation.z);
    Translation3::new(*x, *y, *z) * (UnitQuaternion::new_unchecked(turn) * point)
}

#[cfg(test)]
mod tests {
    use msgs::geometry_msgs::{Quaternion, TransformStamped};
    use msgs::std_msgs::Header;

    use super::*;

    fn stamped(parent: &str, child: &str, [x, y, z]: [f64; 3], yaw_rad: f64) -> TransformStamped {
        let (sin, cos) = libm::sincos(yaw_rad / 2.0);
        let transform =
            Transform { translation: Vector3 { x, y, z }, rotation: Quaternion { x: 0.0, y: 0.0, z: sin, w: cos } };
        let header = Header { frame_id: parent.to_owned(), ..Header::default() };
        TransformStamped { header, child_frame_id: child.to_owned(), transform }
    }

    #[test]
    fn positions_are_those_in_the_map() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let transforms = vec![
            stamped("map", "agent_2/base_link", [1.0, 2.0, 3.0], 0.7),
            // By way of a map that is displaced and an odometry that is turned to the left.
            stamped("map", "agent_7/map", [0.5, 0.0, 0.0], 0.0),
            stamped("agent_7/map", "agent_7/odom", [1.0, 1.0, 0.0], quarter),
            stamped("agent_7/odom", "agent_7/base_link", [2.0, 0.0, 4.0], 0.0),
            // Not in the world, in no order, of a tool, and in a circle.
            stamped("agent_8/odom", "agent_8/base_link", [2.0, 0.0, 4.0], 0.0),
            stamped("map", "camera", [9.0, 9.0, 9.0], 0.0),
            stamped("agent_9/base_link", "agent_9/base_link", [9.0, 9.0, 9.0], 0.0),
        ];
        let found = positions(&TFMessage { transforms });
        assert_eq!(found.iter().map(|(agent, _)| agent.0).collect::<Vec<_>>(), [2, 7]);
        assert_eq!(found[0].1, [1.0, 2.0, 3.0]);
        for (found, expected) in found[1].1.iter().zip([1.5, 3.0, 4.0]) {
            assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
        }
    }
}
