use msgs::cdr;
use msgs::maes_msgs::{
    AgentMessage as WireMessage, Command, Motion as WireMotion, ScanRequest as WireScanRequest,
    WakeCondition as WireWakeCondition,
};
use msgs::shared_bytes::SharedBytes;
use msgs::stage::Stage;
use proptest::prelude::*;

use super::*;
use crate::world::body::Pose;
use crate::world::lidar::ScanView;

fn observation() -> Observation {
    Observation {
        tick: Tick(50),
        agent: AgentId(3),
        pose: Pose { position: Point3::new(1.0, 2.0, 3.0), yaw_rad: 0.5 },
        velocity_in_map_m_s: Vector3::zeros(),
        yaw_rate_rad_s: 0.0,
        is_active: true,
        collision: None,
        events: EventMask::empty(),
        relays: Vec::new(),
        contacts: vec![(AgentId(1), Point3::new(4.0, 5.0, 6.0))],
        messages: Vec::new(),
        scan_tick: None,
        seen_free: Vec::new(),
        seen_wall: Vec::new(),
        view: None,
    }
}

fn indices(runs: &CellRuns) -> impl Iterator<Item = u32> + '_ {
    voxels::indices(&runs.start, &runs.length)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]
    #[test]
    fn large_observations_are_split_without_loss(
        step in 1..4_u32,
        cells in 0..80_000_u32,
        message_bytes in prop::collection::vec(0..=AGENT_MESSAGE_BYTES_MAX, 0..6),
        contacts in 0..1000_u32,
    ) {
        let list: Vec<u32> = (0..cells).map(|cell| cell * step).collect();
        let whole = Observation {
            contacts: (0..contacts).map(|agent| (AgentId(agent), Point3::origin())).collect(),
            messages: message_bytes
                .iter()
                .map(|&bytes| AgentMessage { peer: Peer::One(AgentId(1)), kind: 2, data: vec![7; bytes].into() })
                .collect(),
            seen_free: list.clone(),
            seen_wall: list.clone(),
            view: Some(ScanView { free: list.clone(), wall: list.clone(), hits: Vec::new() }),
            ..observation()
        };
        let parts = observation_parts(whole.clone(), Part::RUNNING);
        let mut joined: [Vec<u32>; 4] = Default::default();
        let mut messages = Vec::new();
        for (number, part) in parts.iter().enumerate() {
            prop_assert_eq!((usize::from(part.part), usize::from(part.parts)), (number, parts.len()));
            prop_assert!(cdr::encode(part).len() <= OBSERVATION_BYTES_MAX);
            prop_assert_eq!((part.tick, part.agent, part.has_view), (50, 3, true));
            joined[0].extend(indices(&part.seen_free));
            joined[1].extend(indices(&part.seen_wall));
            joined[2].extend(indices(&part.view_free));
            joined[3].extend(indices(&part.view_wall));
            messages.extend(part.messages.iter().map(|message| message.data.len()));
        }
        for joined in joined {
            prop_assert_eq!(&joined, &list);
        }
        prop_assert_eq!(messages, message_bytes);
        prop_assert_eq!(parts[0].contacts.len(), contacts as usize);
        prop_assert!(parts[1..].iter().all(|part| part.contacts.is_empty()));
    }

    #[test]
    fn any_command_is_refused_or_legal(
        kind in 0..8_u8,
        numbers in prop::array::uniform4(any::<f64>()),
        path in prop::collection::vec(any::<f64>(), 0..5),
        lidar in (0..6_u8, any::<u32>()),
        receiver in any::<u32>(),
        stage in 0..7_u8,
    ) {
        let [pitch_rad, distance_m, angle_rad, other] = numbers;
        let message = Command {
            motion: WireMotion {
                kind,
                pitch_rad,
                distance_m,
                angle_rad,
                path: path.iter().map(|&x| geometry_msgs::Point { x, y: 0.0, z: 0.0 }).collect(),
                linear_m_s: geometry_msgs::Vector3 { x: other, y: 0.0, z: 0.0 },
                yaw_rate_rad_s: other,
            },
            lidar: WireScanRequest { kind: lidar.0, period_ticks: lidar.1 },
            messages: vec![WireMessage { agent: receiver, kind: 0, data: SharedBytes::default() }],
            stage,
            ..Command::default()
        };
        if let Ok((action, _)) = command(&message, 5) {
            prop_assert!(Stage::from_wire(stage).is_ok());
            match action.motion {
                Motion::Move { pitch_rad, distance_m } => {
                    prop_assert!(pitch_rad.abs() <= std::f64::consts::FRAC_PI_2 && distance_m >= 0.0);
                }
                Motion::Turn { angle_rad } => prop_assert!(angle_rad.abs() <= std::f64::consts::TAU),
                Motion::Path(points) => {
                    prop_assert!(!points.is_empty() && points.iter().all(|point| point.x.abs() <= 1e6));
                }
                Motion::Velocity { linear_in_body_m_s, yaw_rate_rad_s, path } => {
                    prop_assert!(linear_in_body_m_s.x.is_finite() && yaw_rate_rad_s.is_finite());
                    prop_assert!(path.iter().all(|point| point.x.abs() <= 1e6));
                }
                Motion::Keep | Motion::Stop => {}
            }
            prop_assert!(action.lidar != ScanRequest::Every(0));
        }
    }
}

#[track_caller]
fn refuses(message: &Command, expected: &str) {
    let reason = command(message, 5).unwrap_err();
    assert!(reason.contains(expected), "{reason}");
}

#[test]
fn refusals_name_field_value_and_what_is_allowed() {
    let motion = |motion: WireMotion| Command { motion, ..Command::default() };
    let moving = WireMotion { kind: WireMotion::MOVE, ..WireMotion::default() };
    refuses(&motion(WireMotion { kind: 6, ..WireMotion::default() }), "motion.kind = 6, 0 to 5 are allowed");
    refuses(
        &motion(WireMotion { distance_m: f64::NAN, ..moving.clone() }),
        "motion.distance_m = NaN, 0 to inf is allowed",
    );
    refuses(&motion(WireMotion { distance_m: -1.0, ..moving.clone() }), "motion.distance_m = -1");
    refuses(&motion(WireMotion { pitch_rad: 2.0, ..moving }), "motion.pitch_rad = 2");
    refuses(
        &motion(WireMotion { kind: WireMotion::PATH, ..WireMotion::default() }),
        "motion.path has 0 waypoints, 1 to 1024 are allowed",
    );
    refuses(
        &Command { lidar: WireScanRequest { kind: WireScanRequest::EVERY, period_ticks: 0 }, ..Command::default() },
        "lidar.period_ticks = 0",
    );
    let message = |agent, bytes| WireMessage { agent, kind: 0, data: vec![0; bytes].into() };
    refuses(&Command { messages: vec![message(5, 1)], ..Command::default() }, "a message is for agent 5, 0 to 4");
    refuses(
        &Command { messages: vec![message(1, 50_000), message(2, 50_000)], ..Command::default() },
        "the messages hold 100000 bytes, at most 57344 are allowed",
    );
    refuses(&Command { info: "x".repeat(2000), ..Command::default() }, "info has 2000 bytes");
}

#[test]
fn next_request_is_never_before_the_next_tick() {
    let wake = |tick, at_tick| {
        let message = Command { tick, wake: WireWakeCondition { at_tick, events: 3 }, ..Command::default() };
        command(&message, 5).unwrap().1
    };
    assert_eq!(wake(7, 0).at, Tick(8));
    assert_eq!(wake(7, 20), WakeCondition { at: Tick(20), events: EventMask::from_bits_retain(3) });
    assert_eq!(wake(u64::MAX, 0).at, Tick(u64::MAX));
}

#[test]
fn a_scenario_says_which_body_each_agent_has() {
    let text = "seed = 1\nduration_s = 1.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 4 }\n\
                [[bodies]]\nagents = [3, 1]\nkind = \"aerial\"\n[[bodies]]\nagents = [2]\nradius_m = 0.2\n";
    let message = scenario(&Scenario::parse("s.toml", text, &[]).unwrap(), &Extent::new([20; 3], 1.0).unwrap(), 10);
    assert_eq!(message.body_of, [0, 1, 2, 1]);
    let bodies: Vec<_> = message.bodies.iter().map(|body| (body.kind, body.radius_m, body.speed_max_m_s)).collect();
    assert_eq!(bodies, [(0, 0.4, 1.5), (1, 0.4, 3.0), (0, 0.2, 1.5)]);
}

#[test]
fn relay_ids_round_trip() {
    let relay = RelayId { owner: AgentId(4), number: 7 };
    let says = |agent, bytes| {
        let message = maes_msgs::AgentMessage { agent, kind: 2, data: vec![1; bytes].into() };
        command(&Command { messages: vec![message], ..Command::default() }, 5)
            .map(|(action, _)| action.messages[0].peer)
    };
    assert_eq!(says(relay.on_wire(), RELAY_BYTES_MAX), Ok(Peer::Relay(relay)));
    assert_eq!(says(maes_msgs::AgentMessage::LEAVE_RELAY, 0), Ok(Peer::NewRelay));
    assert!(
        says(maes_msgs::AgentMessage::LEAVE_RELAY, RELAY_BYTES_MAX + 1)
            .unwrap_err()
            .contains("at most 4096 are allowed")
    );
    let foreign = RelayId { owner: AgentId(5), number: 0 };
    assert!(says(foreign.on_wire(), 0).unwrap_err().contains("0 to 4, BROADCAST, LEAVE_RELAY or a relay are allowed"));

    let place = Point3::new(1.0, 1.0, 1.0);
    let messages = vec![AgentMessage { peer: Peer::Relay(relay), kind: 2, data: vec![5].into() }];
    let observed = Observation { relays: vec![(relay, place)], messages, ..observation() };
    let parts = observation_parts(observed, Part::RUNNING);
    assert_eq!(parts[0].contacts.iter().map(|contact| contact.agent).collect::<Vec<_>>(), [1, relay.on_wire()]);
    assert_eq!(parts[0].messages[0].agent, relay.on_wire());
}

#[test]
fn interventions_are_read_as_they_were_written() {
    let pose = Pose { position: Point3::new(1.0, 2.0, 3.0), yaw_rad: 0.5 };
    for done in [Change::Place(pose), Change::Remove, Change::Leave, Change::Join(pose)] {
        assert_eq!(change(&intervention(Tick(7), AgentId(3), &done)), Ok(done));
    }
    let unknown = maes_msgs::Intervention { kind: 4, ..Default::default() };
    assert_eq!(change(&unknown), Err("an intervention of kind 4: expected 0 to 3".to_owned()));
}
