//! A case for each planner that shows its idea, and what holds of all.

use nalgebra::Point3;

use crate::settings::Settings;
use crate::testing::World;
use crate::{Controller, Setup};
use agent::command::{AgentMessage, Peer};
use agent::exploration_map::CellState;
use agent::observation::Contact;
use msgs::ids::{AgentId, Tick};
use protocol::message_type::MessageType;
use voxels::Cell;

const NAMES: [&str; 4] = ["hungarian", "rendezvous", "racer", "c2-explorer"];

fn build(name: &str, settings: &[&str], setup: Setup<'_>) -> Box<dyn Controller> {
    let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
    let registration = crate::REGISTRY.iter().find(|registration| registration.name == name).unwrap();
    (registration.construct)(&mut Settings::parse(&settings).unwrap(), setup).unwrap()
}

/// A corridor along x with an unknown opening at each end, and this agent (id 1) at `x`.
fn corridor(x: i32, contacts: &[(u32, f64)]) -> World {
    let mut drawing = vec!["#".repeat(45); 3];
    drawing[1] = format!("?????{}?????", ".".repeat(35));
    let mut world = World::known(&drawing.join("\n"), Cell::new(x, 1, 0));
    world.observation.scan_tick = Some(world.observation.tick);
    let contact = |&(agent, x)| Contact { agent: AgentId(agent), position: Point3::new(x, 1.5, 0.5) };
    world.observation.contacts = contacts.iter().map(contact).collect();
    world
}

fn choice(name: &str, x: i32, contacts: &[(u32, f64)]) -> String {
    let mut world = corridor(x, contacts);
    let mut controller = build(name, &[], world.setup());
    world.ask(&mut *controller).info
}

/// The agent is nearer to the low end. Alone it goes there; if the other one is nearer still, the
/// sum of paths is least with this agent at the high end.
#[test]
fn planners_that_divide_leave_an_end_to_another_agent() {
    for name in ["hungarian", "racer", "c2-explorer"] {
        let [alone, shared] = [choice(name, 18, &[]), choice(name, 18, &[(2, 8.5)])];
        assert!(alone.contains("to (5, 1, 0)"), "{name}: {alone}");
        assert!(shared.contains("to (39, 1, 0)"), "{name}: {shared}");
    }
}

/// The other agent proposes or divides if its id is lower, and this one takes that over.
#[test]
fn parts_of_others_are_taken_over() {
    for name in ["racer", "c2-explorer"] {
        let mut world = corridor(18, &[(2, 38.5)]);
        let mut controller = build(name, &[], world.setup());
        let command = world.ask(&mut *controller);
        let parts: Vec<_> =
            command.messages.iter().filter(|message| message.kind == MessageType::Parts.number()).collect();
        assert_eq!(parts.len(), 1, "{name}");
        assert!(command.info.contains("to (5, 1, 0)"), "{name}: {}", command.info);
        // Agents 0 and 1 are in contact at the same places, and 0 says that all is its own: the
        // table of agent 1 as that of agent 0.
        let mut data = parts[0].data.to_vec();
        for entry in data[1..].chunks_mut(16) {
            entry[4..8].copy_from_slice(&0_u32.to_le_bytes());
            entry[8..16].copy_from_slice(&7_u64.to_le_bytes());
        }
        let mut world = corridor(18, &[(0, 38.5)]);
        world.observation.tick = Tick(9);
        world.observation.scan_tick = Some(Tick(9));
        world.observation.messages =
            vec![AgentMessage { peer: Peer::One(AgentId(0)), kind: MessageType::Parts.number(), data: data.into() }];
        let mut controller = build(name, &[], world.setup());
        let info = world.ask(&mut *controller).info;
        assert!(info.starts_with("relocation to "), "nothing is its own, and it relocates: {name}: {info}");
    }
}

#[test]
fn members_leave_in_time_for_the_meeting_and_wait_no_longer_than_said() {
    let mut world = corridor(30, &[(2, 29.5)]);
    let mut controller = build("rendezvous", &["interval_s=60", "wait_s=10"], world.setup());
    let command = world.ask(&mut *controller);
    let meeting = command.messages.iter().find(|message| message.kind == MessageType::Meeting.number()).unwrap();
    let number = |at: usize| u64::from_le_bytes(meeting.data[at..at + 8].try_into().unwrap());
    assert_eq!((number(1), number(9)), (0, 3000), "60 s later");
    let place = u32::from_le_bytes(meeting.data[17..21].try_into().unwrap()) as usize;
    let place = world.map.extent().cell_at(place);
    // At 0.8 m/s the agent has to leave when the rest of the time is that of the path.
    world.observation.contacts.clear();
    world.put(Cell::new(if place.x < 22 { 35 } else { 9 }, 1, 0));
    let far_m = (world.observation.pose.position - world.map.extent().centre(place)).norm();
    let mut ask_at = |world: &mut World, tick: f64| {
        world.observation.tick = Tick(tick as u64);
        world.observation.scan_tick = Some(world.observation.tick);
        world.observation.is_active = false;
        world.ask(&mut *controller).info
    };
    let leaves = 3000.0 - far_m / 0.8 * 50.0;
    let early = ask_at(&mut world, leaves - 500.0);
    assert!(!early.contains("meeting"), "{early}");
    let goes = ask_at(&mut world, leaves + 500.0);
    assert!(goes.starts_with("to the meeting at "), "{goes}");
    world.put(place);
    assert_eq!(ask_at(&mut world, 3100.0), "waits for the meeting");
    let gone = ask_at(&mut world, 3500.0);
    assert!(!gone.contains("meeting"), "the other one has not come: {gone}");
}

#[test]
fn all_explore_alone_and_end() {
    let rooms = "
################
#......#.......#
#......#.......#
#..............#
#......#.......#
################";
    for name in NAMES {
        for settings in [&[][..], &["regions=1"]] {
            let mut world = World::new(rooms.trim_start(), Cell::new(1, 1, 0));
            let mut controller = build(name, settings, world.setup());
            world.run(&mut *controller, 2000);
            assert_eq!(world.left(&[CellState::Free, CellState::Covered]), [], "{name}");
        }
    }
}

#[test]
fn settings_are_checked() {
    let check = |name: &str, setting: &str| crate::check(name, &[setting.to_owned()]);
    for (name, legal, illegal) in [
        ("hungarian", "lease_s=0", "regions=0"),
        ("rendezvous", "wait_s=0", "interval_s=0"),
        ("racer", "load_max=1", "load_max=0.4"),
        ("racer", "block_m=0.1", "pair_s=0"),
        ("c2-explorer", "contiguity_m=0", "slack=-1"),
    ] {
        assert!(check(name, legal).is_ok(), "{name} {legal}");
        assert!(check(name, illegal).is_err(), "{name} {illegal}");
    }
}
