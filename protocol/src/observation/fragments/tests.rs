use nalgebra::Point3;
use proptest::prelude::*;

use super::*;
use crate::limits::AGENT_MESSAGE_BYTES_MAX;

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
    RunInfo::from_message(&scenario, AgentId(0)).unwrap()
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
    assert!(RunInfo::from_message(&scenario, AgentId(0)).is_err());
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
        assert!(refused(&|part| part.contacts = vec![contact(0, x)]).contains("expected a place in the map"), "{x}");
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
    assert_eq!(reassembler.take(part(5, 0, 1, 0), &run()), Err(WireError::Part { tick: Tick(5), part: 0, parts: 1 }));
}

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
        contacts: vec![Contact { agent: AgentId(1), position: Point3::new(4.0, 5.0, 6.0) }],
        messages: Vec::new(),
        scan_tick: None,
        seen: Cells::default(),
        view: None,
        energy: None,
        field_of_view: None,
        map_frames: Vec::new(),
        change: None,
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
            contacts: (0..contacts).map(|agent| Contact { agent: AgentId(agent), position: Point3::origin() }).collect(),
            messages: message_bytes
                .iter()
                .map(|&bytes| AgentMessage { peer: Peer::One(AgentId(1)), kind: 2, data: vec![7; bytes].into() })
                .collect(),
            seen: Cells { free: list.clone(), wall: list.clone() },
            view: Some(Cells { free: list.clone(), wall: list.clone() }),
            ..observation()
        };
        let parts = split(whole.clone(), Part::RUNNING);
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
}

#[test]
fn relays_are_contacts_and_senders() {
    let relay = RelayId { owner: AgentId(4), number: 7 };
    let place = Point3::new(1.0, 1.0, 1.0);
    let messages = vec![AgentMessage { peer: Peer::Relay(relay), kind: 2, data: vec![5].into() }];
    let relays = vec![Relay { id: relay, position: place }];
    let parts = split(Observation { relays, messages, ..observation() }, Part::RUNNING);
    assert_eq!(parts[0].contacts.iter().map(|contact| contact.agent).collect::<Vec<_>>(), [1, relay.on_wire()]);
    assert_eq!(parts[0].messages[0].agent, relay.on_wire());
}

#[test]
fn field_of_view_is_a_message_of_the_server() {
    let (horizontal_rad, lowest_rad, highest_rad, spacing_rad, min_range_m) = (1.4, -0.5, 0.5, 0.02, 0.3);
    let view = FieldOfView { horizontal_rad, lowest_rad, highest_rad, spacing_rad, min_range_m };
    let (agent, contacts) = (AgentId(0), Vec::new());
    let map_frames = vec![MapFrame { agent: AgentId(0), origin: Point3::new(1.0, 0.0, -2.0) }];
    let expected = Observation { agent, contacts, field_of_view: Some(view), map_frames, ..observation() };
    let [part] = &split(expected.clone(), Part::RUNNING)[..] else { panic!("it is small") };
    assert_eq!(part.messages[0].kind, maes_msgs::AgentMessage::FIELD_OF_VIEW);
    let reassembled = FragmentReassembler::default().take(part.clone(), &run());
    assert_eq!(reassembled.map(|whole| whole.map(|whole| whole.observation)), Ok(Some(expected)));
}
