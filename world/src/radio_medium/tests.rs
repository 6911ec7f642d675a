use std::f64::consts::TAU;

use proptest::prelude::*;
use protocol::body_model::BodyModel;
use protocol::event_mask::EventMask;
use protocol::observation::Relay;
use protocol::observation::RequestKind;
use protocol::wake_condition::WakeCondition;
use voxels::{Extent, Grid, Terrain};

use super::*;
use crate::WorldParams;
use crate::body::Pose;
use crate::comms::{Comms, ContactModel};
use crate::lidar::{Pattern, Scanner};

const A: AgentId = AgentId(0);
const B: AgentId = AgentId(1);

fn perfect() -> Comms {
    Comms::perfect(ContactModel::LineOfSightAndRange { range_m: f64::INFINITY })
}

/// A gallery with a bend, so that its ends do not see each other: agents in both ends and in the
/// bend.
fn gallery(comms: Comms, agents: usize) -> World {
    let solid = "#########\n#########\n#########\n#########\n#########\n";
    let layer = "#########\n#.......#\n#.#####.#\n#.#####.#\n#########\n";
    let terrain = Grid::from_text(&[solid, layer, solid].join("\n")).unwrap();
    let places = [(1.5, 1.5), (7.5, 1.5), (1.5, 3.5)];
    let starts: Vec<Pose> =
        places[..agents].iter().map(|&(x, y)| Pose { position: Point3::new(x, y, 1.5), yaw_rad: 0.0 }).collect();
    World::new(terrain, params(comms), &starts)
}

/// Two agents in a hall.
fn hall(comms: Comms) -> World {
    let mut terrain = Grid::new(Extent::new([8, 5, 5], 1.0).unwrap(), Terrain::Free);
    voxels::close_shell(&mut terrain, 1);
    let at = |x| Pose { position: Point3::new(x, 2.5, 2.5), yaw_rad: 0.0 };
    World::new(terrain, params(comms), &[at(1.5), at(6.5)])
}

fn params(comms: Comms) -> WorldParams {
    WorldParams::new(BodyModel::default(), Scanner::new(Pattern::Lattice { rays: 10 }, f64::INFINITY, TAU), comms)
}

fn message(peer: Peer, data: &[u8]) -> AgentMessage {
    AgentMessage { peer, kind: 7, data: data.into() }
}

fn sends(messages: Vec<AgentMessage>) -> Command {
    Command { messages, ..Command::keep(WakeCondition::NEXT_TICK) }
}

fn received(world: &mut World, agent: AgentId) -> Vec<AgentMessage> {
    world.observe(agent, RequestKind::Scheduled).messages
}

#[test]
fn packet_loss_has_its_share_and_is_reproducible() {
    let lost = |seed, loss| {
        let mut world = hall(Comms { loss, seed, ..perfect() });
        let arrived: Vec<Vec<AgentMessage>> = (0..500)
            .map(|n| {
                let numbered = |m: u8| message(Peer::One(B), &[m, (n % 256) as u8]);
                world.step([(A, sends(vec![numbered(0), numbered(1)]))].into());
                received(&mut world, B)
            })
            .collect();
        let totals = world.totals();
        assert_eq!(totals.messages_sent, 1000);
        assert_eq!(totals.messages_delivered + totals.messages_lost_radio, 1000);
        (totals.messages_lost_radio, arrived)
    };
    let some = lost(1, 0.25);
    assert!((200..300).contains(&some.0), "{}", some.0);
    assert_eq!(some, lost(1, 0.25));
    assert_ne!(some.1, lost(2, 0.25).1);
    assert_eq!((lost(1, 0.0).0, lost(1, 1.0).0), (0, 1000));
}

#[test]
fn packet_loss_is_independent_of_other_senders() {
    let arrivals = |with_other: bool| {
        let mut world = gallery(Comms { contact: ContactModel::Global, loss: 0.5, seed: 9, ..perfect() }, 3);
        (0..200_u8)
            .map(|n| {
                let mut actions = BTreeMap::from([(B, sends(vec![message(Peer::Broadcast, &[n])]))]);
                if with_other {
                    actions.insert(A, sends(vec![message(Peer::Broadcast, b"x"); 3]));
                }
                world.step(actions);
                let mut arrived = received(&mut world, AgentId(2));
                arrived.retain(|message| message.peer == Peer::One(B));
                arrived
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(arrivals(false), arrivals(true));
}

#[test]
fn limited_rate_keeps_order_and_drops_overflow() {
    // 1000 bytes in a second are 20 in a tick; a message takes 16 beside its data.
    let mut world = hall(Comms { bytes_per_s: 1000.0, queue_bytes: 100, ..perfect() });
    let messages = (0..4).map(|n| message(Peer::One(B), &[n; 24])).collect();
    world.step([(A, sends(messages))].into());
    let mut arrived = Vec::new();
    for tick in 1..20 {
        arrived.extend(received(&mut world, B).into_iter().map(|message| (tick, message.data[0])));
        world.step(BTreeMap::new());
    }
    // Two wait, and the third and the fourth do not fit.
    assert_eq!(arrived, [(2, 0), (4, 1)]);
    assert_eq!((world.totals().messages_queue_full, world.totals().messages_delivered), (2, 2));
    // Idle time is not saved up.
    world.step([(A, sends(vec![message(Peer::One(B), &[9; 24])]))].into());
    assert_eq!(received(&mut world, B), []);
    world.step(BTreeMap::new());
    assert_eq!(received(&mut world, B).len(), 1);
}

#[test]
fn contact_is_checked_when_a_message_is_complete() {
    let range = ContactModel::LineOfSightAndRange { range_m: 5.0 };
    let mut world = hall(Comms { contact: range, bytes_per_s: 1000.0, queue_bytes: 1000, ..perfect() });
    world.step([(A, sends(vec![message(Peer::Broadcast, &[1; 24])]))].into());
    let away = Pose { position: Point3::new(6.8 - 0.3, 2.5, 1.5), yaw_rad: 0.0 };
    world.place(B, away).unwrap();
    world.step(BTreeMap::new());
    assert_eq!(
        (received(&mut world, B).len(), world.totals().messages_sent),
        (0, 0),
        "no agent is in contact any more"
    );
}

#[test]
fn first_contact_is_reported_once_in_each_share_period() {
    let range = ContactModel::LineOfSightAndRange { range_m: 4.5 };
    let mut world = hall(Comms { contact: range, ..perfect() });
    world.params.share_period_ticks = 10;
    let stand = |world: &mut World, x| {
        world.place(B, Pose { position: Point3::new(x, 2.5, 2.5), yaw_rad: 0.0 }).unwrap();
    };
    const NEAR: f64 = 5.5;
    const FAR: f64 = 6.5;
    let mut reported = Vec::new();
    for tick in 0..50 {
        match tick {
            0 | 7 | 33 => stand(&mut world, NEAR),
            5 | 21 => stand(&mut world, FAR),
            _ => {}
        }
        if world.events(A, EventMask::FIRST_CONTACT) != EventMask::empty() {
            let observation = world.observe(A, RequestKind::Scheduled);
            assert_eq!(
                (observation.events & EventMask::FIRST_CONTACT, observation.contacts.len()),
                (EventMask::FIRST_CONTACT, 1)
            );
            reported.push(tick);
        }
        // Only to those who ask for it.
        assert_eq!(world.observe(B, RequestKind::Scheduled).events & EventMask::FIRST_CONTACT, EventMask::empty());
        world.step(BTreeMap::new());
    }
    assert_eq!(reported, [0, 10, 20, 33, 40]);
}

#[test]
fn relays_connect_agents_and_store_content() {
    let mut world = gallery(Comms { relays_per_agent: 1, ..perfect() }, 2);
    let contacts = |world: &mut World, agent| world.observe(agent, RequestKind::Scheduled).contacts.len();
    assert_eq!((contacts(&mut world, A), contacts(&mut world, B)), (0, 0));
    // One in each leg of the gallery, in sight of each other.
    let place = |world: &mut World, agent, x, y| {
        world.place(agent, Pose { position: Point3::new(x, y, 1.5), yaw_rad: 0.0 }).unwrap();
    };
    place(&mut world, A, 1.5, 3.5);
    world.step([(A, sends(vec![message(Peer::NewRelay, b"corner"), message(Peer::NewRelay, b"none left")]))].into());
    assert_eq!((world.totals().relays_left, world.totals().relays_refused), (1, 1));
    place(&mut world, A, 1.5, 1.5);
    place(&mut world, B, 7.5, 3.5);
    world.step([(B, sends(vec![message(Peer::NewRelay, b"")]))].into());
    place(&mut world, B, 7.5, 1.5);
    assert_eq!(world.relays().len(), 2);
    assert_eq!(world.relay_links(), [(0, 1)]);
    assert_eq!((contacts(&mut world, A), contacts(&mut world, B)), (1, 1));
    assert_eq!(world.pairs_in_contact(), 1);

    let first = RelayId { owner: A, number: 0 };
    let second = RelayId { owner: B, number: 0 };
    let observation = world.observe(A, RequestKind::Scheduled);
    assert_eq!(observation.relays, [Relay { id: first, position: Point3::new(1.5, 3.5, 1.5) }]);
    assert_eq!(world.totals().relay_readings, 1, "B has read the corner from the other corner");
    received(&mut world, B);
    // Out of sight, so out of reach for writing; but messages go over both.
    let words = vec![
        message(Peer::Relay(second), b"far"),
        message(Peer::Relay(first), b"near"),
        message(Peer::One(B), b"hello"),
    ];
    world.step([(A, sends(words))].into());
    assert_eq!((world.totals().relay_writings, world.totals().relay_writings_lost), (1, 1));
    assert_eq!(received(&mut world, B), [message(Peer::One(A), b"hello")]);
    place(&mut world, B, 7.5, 3.5);
    world.step(BTreeMap::new());
    assert_eq!(world.events(B, EventMask::CONTACTS | EventMask::MESSAGE), EventMask::CONTACTS | EventMask::MESSAGE);
    assert_eq!(received(&mut world, B), [message(Peer::Relay(first), b"near")]);
    world.step(BTreeMap::new());
    assert_eq!(received(&mut world, B), [], "delivered once");
}

#[test]
fn relays_are_read_within_the_read_range() {
    let mut world = hall(Comms { relays_per_agent: 1, relay_read_range_m: 2.0, ..perfect() });
    world.step([(A, sends(vec![message(Peer::NewRelay, b"x")]))].into());
    assert_eq!(world.observe(B, RequestKind::Scheduled).relays, []);
    world.place(B, Pose { position: Point3::new(3.5, 2.5, 2.5), yaw_rad: 0.0 }).unwrap();
    world.step(BTreeMap::new());
    let observation = world.observe(B, RequestKind::Scheduled);
    assert_eq!((observation.relays.len(), observation.messages.len()), (1, 1));
}

proptest! {
    #[test]
    fn queue_keeps_order_and_bytes(
        sizes in prop::collection::vec(0..400_usize, 1..40),
        bytes_per_tick in 1.0..500.0_f64,
    ) {
        let mut queue = Queue::default();
        for (n, &size) in sizes.iter().enumerate() {
            let message = AgentMessage { kind: n as u8, ..message(Peer::Broadcast, &vec![0; size]) };
            prop_assert!(queue.push(message, u64::MAX));
        }
        let all: u64 = sizes.iter().map(|&size| (size + AGENT_MESSAGE_BYTES_BARE) as u64).sum();
        prop_assert_eq!(queue.bytes, all);
        let mut sent = Vec::new();
        let mut bytes = 0;
        let mut ticks = 0.0;
        while !queue.messages.is_empty() {
            ticks += 1.0;
            let through = queue.send(bytes_per_tick);
            bytes += through.iter().map(bytes_on_air).sum::<u64>();
            prop_assert!(bytes as f64 <= ticks * bytes_per_tick + 1e-6, "never faster than it can");
            sent.extend(through.into_iter().map(|message| (usize::from(message.kind), message.data.len())));
        }
        prop_assert!((ticks - 1.0) * bytes_per_tick <= all as f64 + 1e-6, "nor slower");
        prop_assert_eq!((bytes, queue.bytes), (all, 0));
        prop_assert_eq!(sent, sizes.into_iter().enumerate().collect::<Vec<_>>());
    }

    /// A radio that can send everything at once is one without a limit.
    #[test]
    fn very_fast_radio_equals_unlimited_radio(sizes in prop::collection::vec((0..2_u32, 0..100_usize), 0..20)) {
        let run = |bytes_per_s| {
            let mut world = hall(Comms { bytes_per_s, queue_bytes: 1 << 20, ..perfect() });
            let arrived: Vec<_> = sizes
                .iter()
                .map(|&(sender, size)| {
                    world.step([(AgentId(sender), sends(vec![message(Peer::Broadcast, &vec![1; size]); 2]))].into());
                    [A, B].map(|agent| received(&mut world, agent))
                })
                .collect();
            (arrived, world.totals().clone())
        };
        prop_assert_eq!(run(1e9), run(f64::INFINITY));
    }
}
