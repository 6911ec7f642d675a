//! Legal commands, and the property that controllers give no others, whatever they observe.

use std::f64::consts::{FRAC_PI_2, TAU};

use msgs::ids::{AgentId, Tick};
use msgs::shared_bytes::SharedBytes;
use nalgebra::{Point3, Vector3};
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;
use protocol::event_mask::EventMask;
use protocol::field_of_view::FieldOfView;
use protocol::limits::{AGENT_MESSAGE_BYTES_MAX, INFO_BYTES_MAX, PATH_POINTS_MAX, RELAY_BYTES_MAX};
use protocol::relay_id::RelayId;
use voxels::{Cell, Extent, Grid, Terrain};

use super::{AGENT, World};
use crate::{NAMES, build};
use agent::command::{AgentMessage, Command, Motion, Peer, ScanRequest};
use agent::observation::{Cells, Collision, Contact, Observation, Pose, Relay, RunInfo, Surface};

/// Size of the world of the observations, cells.
const SIZE: [u32; 3] = [6, 5, 6];

/// Settings with other decisions than the defaults.
const OTHER_SETTINGS: [(&str, &[&str]); 6] = [
    ("nearest-frontier", &["relays=on"]),
    ("lvd", &["search_time=budgeted", "search_cells_per_tick=1"]),
    ("lvd", &["search_time=background", "search_ticks=3", "visit_radius_m=1"]),
    ("lvd", &["leg_max_m=0", "near_m=0", "merge_m=0", "visits_max=1", "visit_radius_m=0"]),
    ("nearest-frontier", &["search_time=budgeted", "search_cells_per_tick=1"]),
    ("nearest-frontier", &["search_time=background", "search_ticks=3"]),
];

/// The rules of `msgs/msg/Motion.msg` and its like.
pub(super) fn assert_legal(command: &Command) {
    let is_coordinate = |along: f64| along.abs() <= 1e6;
    let is_legal_path = |points: &[Point3<f64>]| {
        points.len() <= PATH_POINTS_MAX && points.iter().all(|point| point.iter().all(|&along| is_coordinate(along)))
    };
    let is_legal_motion = match &command.motion {
        Motion::Keep | Motion::Stop => true,
        Motion::Move { pitch_rad, distance_m } => pitch_rad.abs() <= FRAC_PI_2 && *distance_m >= 0.0,
        Motion::Turn { angle_rad } => angle_rad.abs() <= TAU,
        Motion::Path(points) => !points.is_empty() && is_legal_path(points),
        Motion::Velocity { linear_in_body_m_s, yaw_rate_rad_s, path } => {
            linear_in_body_m_s.iter().all(|&along| is_coordinate(along))
                && is_coordinate(*yaw_rate_rad_s)
                && is_legal_path(path)
        }
    };
    assert!(is_legal_motion, "{command:?}");
    assert_ne!(command.lidar, ScanRequest::Every(0), "{command:?}");
    assert!(command.info.len() <= INFO_BYTES_MAX, "{command:?}");
    let mut to_relays = command.messages.iter().filter(|message| message.peer.is_relay());
    assert!(to_relays.all(|message| message.data.len() <= RELAY_BYTES_MAX), "{command:?}");
    let bytes: usize = command.messages.iter().map(|message| message.data.len()).sum();
    assert!(bytes <= AGENT_MESSAGE_BYTES_MAX, "{command:?}");
}

/// Mostly in the map, else on its edges, outside, or not finite.
fn place() -> impl Strategy<Value = Point3<f64>> {
    let wild = || prop_oneof![4 => -2.0..8.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => -1e300..1e300];
    let coordinates = prop_oneof![
        3 => (0.0..6.0, 0.0..5.0, 0.0..6.0),
        2 => (-2.0..8.0, -2.0..8.0, -2.0..8.0),
        1 => (wild(), wild(), wild()),
    ];
    (coordinates, any::<bool>()).prop_map(|((x, y, z), is_at_centre)| {
        let place = Point3::new(x, y, z);
        if is_at_centre { place.map(|along: f64| along.floor() + 0.5) } else { place }
    })
}

fn relay(number: u32) -> RelayId {
    RelayId { owner: AgentId(number % 2), number }
}

fn cells() -> impl Strategy<Value = Cells> {
    let some = || btree_set(0..SIZE.iter().product(), 0..120).prop_map(|cells| cells.into_iter().collect());
    (some(), some()).prop_map(|(free, wall)| Cells { free, wall })
}

fn collision() -> impl Strategy<Value = Collision> {
    let surface = prop_oneof![Just(Surface::Wall), Just(Surface::Floor), Just(Surface::Ceiling)];
    (surface, any::<bool>()).prop_map(|(surface, with_agent)| Collision { surface, with_agent })
}

prop_compose! {
    /// Observations need not be consistent, nor possible.
    fn observation()(
        (tick, position, yaw_rad) in (0u64..2000, place(), -3.2..3.2),
        (is_active, collision, events) in (any::<bool>(), prop::option::of(collision()), any::<u8>()),
        contacts in vec((0u32..4, place()), 0..3),
        relays in vec((0u32..4, place()), 0..3),
        messages in vec((0u32..4, any::<u8>(), vec(any::<u8>(), 0..40)), 0..3),
        (has_scanned, seen, view) in (prop::bool::weighted(0.8), cells(), prop::option::of(cells())),
    ) -> Observation {
        Observation {
            tick: Tick(tick),
            pose: Pose { position, yaw_rad },
            agent: AGENT,
            velocity_in_map_m_s: Vector3::zeros(),
            yaw_rate_rad_s: 0.0,
            is_active,
            collision,
            events: EventMask::from_bits_retain(events),
            contacts: contacts
                .into_iter()
                .map(|(agent, position)| Contact { agent: AgentId(agent), position })
                .collect(),
            relays: relays.iter().map(|&(number, position)| Relay { id: relay(number), position }).collect(),
            messages: relays
                .iter()
                .map(|&(number, _)| (Peer::Relay(relay(number)), 1, SharedBytes::default()))
                .chain(messages.into_iter().map(|(from, kind, data)| (Peer::One(AgentId(from)), kind, data.into())))
                .map(|(peer, kind, data)| AgentMessage { peer, kind, data })
                .collect(),
            scan_tick: has_scanned.then_some(Tick(tick)),
            seen,
            view,
            energy: None,
            field_of_view: None,
            map_frames: Vec::new(),
            change: None,
        }
    }
}

/// A sequence of observations, mostly in the order of their ticks.
fn observations() -> impl Strategy<Value = Vec<Observation>> {
    (vec(observation(), 1..12), prop::bool::weighted(0.75)).prop_map(|(mut observations, are_in_order)| {
        let mut now = Tick::ZERO;
        for observation in observations.iter_mut().filter(|_| are_in_order) {
            now = now.after(observation.tick.0);
            observation.tick = now;
            observation.scan_tick = observation.scan_tick.map(|_| now);
        }
        observations
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn commands_are_legal_for_any_observation(
        observations in observations(), seed: u64, is_aerial: bool,
        has_camera in prop::bool::weighted(0.05),
    ) {
        let extent = Extent::new(SIZE, 1.0).unwrap();
        for (name, settings) in NAMES.into_iter().map(|name| (name, &[][..])).chain(OTHER_SETTINGS) {
            let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
            let mut world = World::of(Grid::new(extent, Terrain::Free), Cell::default());
            if is_aerial {
                world = world.aerial();
            }
            let run_info = RunInfo { agents_seed: seed, ..world.run_info.clone() };
            let mut controller = build(name, &settings, AGENT, &run_info).unwrap();
            world.run_info.field_of_view = has_camera.then_some(FieldOfView {
                horizontal_rad: 1.4,
                lowest_rad: -0.5,
                highest_rad: 0.5,
                spacing_rad: 0.02,
                min_range_m: 0.0,
            });
            for observation in &observations {
                world.map.note_free(&observation.seen.free);
                world.map.note_wall(&observation.seen.wall);
                world.ask_about(controller.as_mut(), observation);
            }
        }
    }
}
