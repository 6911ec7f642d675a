use msgs::geometry_msgs;
use msgs::maes_msgs::{
    AgentMessage as WireMessage, Command as WireCommand, Motion as WireMotion, ScanRequest as WireScanRequest,
    WakeCondition as WireWakeCondition,
};
use proptest::prelude::*;

use super::*;
use crate::limits::RELAY_BYTES_MAX;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]
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
        let message = WireCommand {
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
            ..WireCommand::default()
        };
        if let Ok(command) = Command::from_message(&message, 5) {
            prop_assert!(Stage::from_wire(stage).is_ok());
            match command.motion {
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
            prop_assert!(command.lidar != ScanRequest::Every(0));
        }
    }
}

#[track_caller]
fn refuses(message: &WireCommand, expected: &str) {
    let reason = Command::from_message(message, 5).unwrap_err();
    assert!(reason.contains(expected), "{reason}");
}

#[test]
fn refusals_name_field_value_and_what_is_allowed() {
    let motion = |motion: WireMotion| WireCommand { motion, ..WireCommand::default() };
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
        &WireCommand {
            lidar: WireScanRequest { kind: WireScanRequest::EVERY, period_ticks: 0 },
            ..WireCommand::default()
        },
        "lidar.period_ticks = 0",
    );
    let message = |agent, bytes| WireMessage { agent, kind: 0, data: vec![0; bytes].into() };
    refuses(
        &WireCommand { messages: vec![message(5, 1)], ..WireCommand::default() },
        "a message is for agent 5, 0 to 4",
    );
    refuses(
        &WireCommand { messages: vec![message(1, 50_000), message(2, 50_000)], ..WireCommand::default() },
        "the messages hold 100000 bytes, at most 57344 are allowed",
    );
    refuses(&WireCommand { info: "x".repeat(2000), ..WireCommand::default() }, "info has 2000 bytes");
}

#[test]
fn next_request_is_never_before_the_next_tick() {
    let wake = |tick, at_tick| {
        let message = WireCommand { tick, wake: WireWakeCondition { at_tick, events: 3 }, ..WireCommand::default() };
        Command::from_message(&message, 5).unwrap().wake
    };
    assert_eq!(wake(7, 0).at, Tick(8));
    assert_eq!(wake(7, 20), WakeCondition { at: Tick(20), events: EventMask::from_bits_retain(3) });
    assert_eq!(wake(u64::MAX, 0).at, Tick(u64::MAX));
}

#[test]
fn relay_ids_round_trip() {
    let relay = RelayId { owner: AgentId(4), number: 7 };
    let says = |agent, bytes| {
        let message = WireMessage { agent, kind: 2, data: vec![1; bytes].into() };
        Command::from_message(&WireCommand { messages: vec![message], ..WireCommand::default() }, 5)
            .map(|command| command.messages[0].peer)
    };
    assert_eq!(says(relay.on_wire(), RELAY_BYTES_MAX), Ok(Peer::Relay(relay)));
    assert_eq!(says(WireMessage::LEAVE_RELAY, 0), Ok(Peer::NewRelay));
    assert!(says(WireMessage::LEAVE_RELAY, RELAY_BYTES_MAX + 1).unwrap_err().contains("at most 4096 are allowed"));
    let foreign = RelayId { owner: AgentId(5), number: 0 };
    assert!(says(foreign.on_wire(), 0).unwrap_err().contains("0 to 4, BROADCAST, LEAVE_RELAY or a relay are allowed"));
}

#[test]
fn messages_to_relays_come_last() {
    let relay = RelayId { owner: AgentId(0), number: 1 };
    let command = Command::keep(WakeCondition::NEXT_TICK).with_relay(1, vec![1]).with_message(None, 2, vec![2]);
    let command = command.with_relay_update(relay, 3, vec![3]).with_message(Some(AgentId(1)), 4, vec![4]);
    let kinds = |command: &Command| command.messages.iter().map(|message| message.kind).collect::<Vec<_>>();
    let message = command.into_message(AgentId(0), Tick(1));
    assert_eq!(kinds(&Command::from_message(&message, 2).unwrap()), [2, 4, 1, 3]);
}

#[test]
fn a_stage_alone_is_an_act() {
    let keep = Command::keep(WakeCondition::NEXT_TICK);
    assert!(keep.is_noop() && !keep.with_stage(Stage::Waiting).is_noop());
}

#[test]
fn info_is_cut_at_a_character_boundary() {
    let said = Command::keep(WakeCondition::NEXT_TICK).with_info("\u{e9}".repeat(INFO_BYTES_MAX));
    assert_eq!(said.info.len(), INFO_BYTES_MAX / 2 * 2);
    assert_eq!(Command::keep(WakeCondition::NEXT_TICK).with_info("short").info, "short");
}
