//! What a controller answers is legal, whatever it is told.

use std::f64::consts::{FRAC_PI_2, TAU};

use msgs::ids::{AgentId, Tick};
use msgs::limits::{INFO_BYTES_MAX, PATH_POINTS_MAX};
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use voxels::Cell;

use super::scene::Scene;
use super::{NAMES, build};
use crate::command::{Command, LidarRequest, Motion};
use crate::observation::{Cells, Collision, Contact, Observation, Pose, Received, Surface};

const SIZE: i32 = 6;
const VOLUME: u32 = (SIZE * SIZE * SIZE) as u32;

/// As `msgs/msg/Task.msg` and its like have it.
fn is_legal(command: &Command) -> bool {
    let is_coordinate = |along: f64| along.abs() <= 1e6;
    let is_legal_motion = match &command.motion {
        Motion::Keep | Motion::Stop => true,
        Motion::Move { pitch_rad, distance_m } => pitch_rad.abs() <= FRAC_PI_2 && *distance_m >= 0.0,
        Motion::Turn { angle_rad } => angle_rad.abs() <= TAU,
        Motion::Path(points) => {
            (1..=PATH_POINTS_MAX).contains(&points.len())
                && points.iter().all(|point| point.iter().all(|&along| is_coordinate(along)))
        }
        Motion::Velocity { linear_in_body_m_s, yaw_rate_rad_s } => {
            linear_in_body_m_s.iter().all(|&along| is_coordinate(along)) && is_coordinate(*yaw_rate_rad_s)
        }
    };
    is_legal_motion && command.lidar != LidarRequest::Every(0) && command.info.len() <= INFO_BYTES_MAX
}

prop_compose! {
    /// Anywhere in the map, on its edges and outside.
    fn place()(coordinates in [-2.0..8.0, -2.0..8.0, -2.0..8.0], is_at_centre: bool) -> Point3<f64> {
        let place = Point3::from(coordinates);
        if is_at_centre { place.map(|along: f64| along.floor() + 0.5) } else { place }
    }
}

fn cells() -> impl Strategy<Value = Cells> {
    let some = || proptest::collection::btree_set(0..VOLUME, 0..120).prop_map(|cells| cells.into_iter().collect());
    (some(), some()).prop_map(|(free, wall)| Cells { free, wall })
}

fn collisions() -> impl Strategy<Value = Option<Collision>> {
    let surface = prop_oneof![Just(Surface::Wall), Just(Surface::Floor), Just(Surface::Ceiling)];
    proptest::option::of((surface, any::<bool>()).prop_map(|(surface, with_agent)| Collision { surface, with_agent }))
}

prop_compose! {
    fn observations()(
        (later, position, yaw_rad) in (0u64..2000, place(), -3.2..3.2),
        (is_active, collision, events) in (any::<bool>(), collisions(), any::<u8>()),
        (contact, data) in (proptest::option::of(place()), proptest::collection::vec(any::<u8>(), 0..40)),
        (has_scanned, seen, view) in (any::<bool>(), cells(), proptest::option::of(cells())),
        kind: u8,
    ) -> Observation {
        Observation {
            // The time since the observation before.
            tick: Tick(later),
            pose: Pose { position, yaw_rad },
            velocity_m_s: Vector3::zeros(),
            yaw_rate_rad_s: 0.0,
            is_active,
            collision,
            events,
            contacts: contact.into_iter().map(|position| Contact { agent: AgentId(1), position }).collect(),
            parcels: vec![Received { from: AgentId(1), kind, data }],
            scan_tick: has_scanned.then_some(Tick(later)),
            seen,
            view,
        }
    }
}

proptest! {
    #[test]
    fn whatever_is_observed_the_answer_is_legal(
        observations in proptest::collection::vec(observations(), 1..12),
        seed: u64,
    ) {
        let world = vec![".".repeat(SIZE as usize); SIZE as usize].join("\n") + "\n";
        let world = vec![world; SIZE as usize].join("\n");
        for name in NAMES {
            let mut controller = build(name, &[], AgentId(0), seed).unwrap();
            let mut scene = Scene::new(&world, Cell::default());
            prop_assert_eq!(scene.map.extent().volume(), VOLUME as usize);
            let mut tick = Tick::ZERO;
            for observation in &observations {
                tick = tick.after(observation.tick.0);
                let scan_tick = observation.scan_tick.map(|_| tick);
                scene.observation = Observation { tick, scan_tick, ..observation.clone() };
                scene.map.note_free(&observation.seen.free);
                scene.map.note_wall(&observation.seen.wall);
                let command = scene.ask(controller.as_mut());
                prop_assert!(is_legal(&command), "{name}: {command:?}");
            }
        }
    }
}
