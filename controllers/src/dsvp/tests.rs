use msgs::ids::AgentId;
use nalgebra::Point3;
use protocol::message_type::MessageType;

use super::super::testing::World;
use super::coordination::Alone;
use super::*;
use crate::settings::Settings;
use agent::command::{AgentMessage, Peer};
use agent::exploration_map::{CellState, Delta};
use agent::observation::Contact;

/// A planner that leaves others out of account, with these settings.
fn planner(world: &World, settings: &[&str]) -> Dsvp<Alone> {
    let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
    let params = Params::from_settings(&mut Settings::parse(&settings).unwrap(), Params::default()).unwrap();
    Dsvp::new(params, Alone, world.setup())
}

const CORRIDOR: &str = "
####################
#..................#
####################";

const T: &str = "
#############
#...........#
######.######
######.######
######.######
######.######
#############";

const ROOMS: &str = "
################
#......#.......#
#......#.......#
#..............#
#......#.......#
#......#.......#
################";

const PIT: &str = "
#########
####.####
#########

#########
####.####
#########

#########
####.####
#########

#########
#.......#
#########";

#[test]
fn explores_small_worlds_completely() {
    let (low, in_the_middle) = (Cell::new(1, 1, 0), Cell::new(6, 1, 0));
    for (name, drawing, start) in [
        ("corridor", CORRIDOR, low),
        ("corridor, from the middle", CORRIDOR, in_the_middle),
        ("T", T, in_the_middle),
        ("two rooms", ROOMS, low),
        ("pit", PIT, Cell::new(1, 1, 3)),
    ] {
        for kind in ["dsvp", "dsvp-auction", "dsvp-team"] {
            let mut world = World::new(drawing.trim_start(), start);
            let settings = &mut Settings::default();
            let mut controller: Box<dyn Controller> = match kind {
                "dsvp" => Box::new(alone(settings, world.setup()).unwrap()),
                "dsvp-auction" => Box::new(with_auction(settings, world.setup()).unwrap()),
                _ => Box::new(with_team(settings, world.setup()).unwrap()),
            };
            world.run(controller.as_mut(), 2000);
            let left = world.left(&[CellState::Free, CellState::Covered]);
            assert!(left.is_empty(), "{kind}, {name}: {left:?}, {:?}", world.said);
        }
    }
}

#[test]
fn goals_name_the_stages_of_measures() {
    let (cell, agent) = (Cell::new(1, 1, 0), AgentId(0));
    let stages = [
        Goal::Viewpoint { cell, gain: 3 },
        Goal::Frontier { cell, frontier: cell },
        Goal::Pursuit { agent, cell },
        Goal::Wandering { cell },
        Goal::Evasion { cell },
    ]
    .map(Goal::stage);
    let expected = [Stage::Exploring, Stage::Relocating, Stage::Carrying, Stage::Carrying, Stage::Waiting];
    assert_eq!(stages, expected);
    // Each reply with a text names one, and no other does.
    let mut world = World::new(ROOMS.trim_start(), Cell::new(1, 1, 0));
    let mut controller = planner(&world, &[]);
    for _ in 0..40 {
        world.sense();
        let command = world.ask(&mut controller);
        assert_eq!(command.stage.is_some(), !command.info.is_empty(), "{command:?}");
        world.arrive(&command.motion);
    }
    assert!(!world.said.is_empty());
}

#[test]
fn relocates_without_gain_nearby() {
    let mut world = World::new(ROOMS.trim_start(), Cell::new(1, 1, 0));
    // No viewpoint has such a gain.
    let mut controller = planner(&world, &["gain_min=1000"]);
    world.run(&mut controller, 2000);
    assert_eq!(world.left(&[CellState::Free, CellState::Covered]), []);
    let is_relocation = |said: &String| said.starts_with("relocation");
    assert!(world.said.iter().any(is_relocation), "{:?}", world.said);
    assert!(!world.said.iter().any(|said| said.starts_with("exploration")), "{:?}", world.said);
}

#[test]
fn abandoned_frontier_is_explored_after_a_map_update() {
    // The sensor does not reveal the rest of the corridor.
    let mut world = World::known("......??????", Cell::new(5, 0, 0));
    let extent = world.map.extent();
    let mut controller = planner(&world, &[]);
    let mut ask = |world: &mut World| {
        world.observation.tick = world.observation.tick.next();
        world.observation.scan_tick = Some(world.observation.tick);
        world.observation.is_active = false;
        world.ask(&mut controller).info
    };
    let said = ask(&mut world);
    assert!(!said.starts_with("relocation"), "it stands at the frontier: {said:?}");
    let mut other = ExplorationMap::new(extent);
    other.note_free(&[6, 7, 8]);
    world.map.merge(&Delta::of(extent, other.changes_since(0)), AgentId(0));
    let said = ask(&mut world);
    assert!(["exploration to (7, 0, 0)", "exploration to (8, 0, 0)"].iter().any(|to| said.starts_with(to)), "{said}");
}

#[test]
fn unproductive_viewpoint_is_not_chosen_again() {
    // It has arrived, and the scan has revealed nothing.
    let cell = Cell::new(4, 0, 0);
    let mut world = World::known("????.????", cell);
    world.observation.scan_tick = Some(world.observation.tick);
    let mut blind = Dsvp { goal: Some(Goal::Viewpoint { cell, gain: 9 }), ..planner(&world, &["gain_min=1"]) };
    world.ask(&mut blind);
    assert!(blind.unproductive.contains(&cell));
}

#[test]
fn pursues_the_last_contact_and_then_wanders() {
    let mut world = World::new(ROOMS.trim_start(), Cell::new(1, 1, 0));
    let met_at = Point3::new(13.5, 4.5, 0.5);
    world.observation.contacts = vec![Contact { agent: AgentId(2), position: met_at }];
    let mut controller = planner(&world, &[]);
    world.ask(&mut controller);
    world.observation.contacts.clear();
    world.run(&mut controller, 2000);
    let with_news: Vec<&String> = world.said.iter().filter(|said| said.starts_with("with news")).collect();
    assert_eq!(with_news[0], "with news to agent 2, last at (13, 4, 0)");
    assert!(with_news[1].starts_with("with news to ("), "{with_news:?}");
    assert!(world.been.contains(&Cell::new(13, 4, 0)));
}

/// In rooms without anything left, after a contact that reported these agents to have nothing left:
/// the texts for people, and whether the agent sent reports to that contact.
fn after_contact_with(finished: &[u32]) -> (Vec<String>, bool) {
    let mut world = World::new(ROOMS.trim_start(), Cell::new(1, 1, 0));
    let mut controller = planner(&world, &[]);
    world.observation.contacts = vec![Contact { agent: AgentId(2), position: Point3::new(13.5, 4.5, 0.5) }];
    world.run(&mut controller, 500);
    world.said.clear();
    let report = |id: &u32| [&id.to_le_bytes()[..], &7_u64.to_le_bytes(), &[1]].concat();
    let data: Vec<u8> = [1].into_iter().chain(finished.iter().flat_map(report)).collect();
    world.observation.messages =
        vec![AgentMessage { peer: Peer::One(AgentId(2)), kind: MessageType::Finished.number(), data: data.into() }];
    world.observation.scan_tick = Some(world.observation.tick);
    let sent = world.ask(&mut controller).messages;
    world.observation.messages.clear();
    world.observation.contacts.clear();
    world.run(&mut controller, 500);
    (world.said, sent.iter().any(|message| message.kind == MessageType::Finished.number()))
}

#[test]
fn the_map_is_carried_only_to_agents_that_may_have_something_left() {
    let (said, _) = after_contact_with(&[]);
    assert!(said.iter().any(|said| said.starts_with("with news to agent 2")), "{said:?}");
    // Agent 0 has never been met.
    let (said, has_sent) = after_contact_with(&[2]);
    assert!(said.iter().all(|said| !said.contains("agent 2")), "{said:?}");
    assert!(said.iter().any(|said| said.starts_with("with news to (")), "{said:?}");
    assert!(has_sent);
}

#[test]
fn team_with_nothing_left_rests() {
    let (said, has_sent) = after_contact_with(&[0, 2]);
    assert_eq!(said.last().unwrap(), "nothing left to do");
    assert!(said.iter().all(|said| !said.starts_with("with news")), "{said:?}");
    assert!(has_sent);
}

#[test]
fn mutual_blockage_is_resolved() {
    let mut world = World::new(CORRIDOR.trim_start(), Cell::new(4, 1, 0));
    world.observation.contacts = vec![Contact { agent: AgentId(2), position: Point3::new(6.5, 1.5, 0.5) }];
    let mut controller = planner(&world, &[]);
    world.run(&mut controller, 400);
    assert!(world.said.iter().any(|said| said == "gives way"), "{:?}", world.said);
    assert!(world.said.iter().any(|said| said.starts_with("out of the way")), "{:?}", world.said);
    assert_eq!(world.collisions, 0);
    world.observation.contacts.clear();
    world.run(&mut controller, 2000);
    assert_eq!(world.left(&[CellState::Free, CellState::Covered]), []);
}

/// The planner rested before the body, though it knew a frontier on its own side of it.
#[test]
fn body_that_stays_leaves_other_frontiers() {
    let mut world = World::known("??..................??", Cell::new(8, 0, 0));
    world.observation.contacts = vec![Contact { agent: AgentId(2), position: Point3::new(10.5, 0.5, 0.5) }];
    let mut controller = planner(&world, &[]);
    let mut goals = Vec::new();
    for _ in 0..8 {
        world.wait(300);
        let observation = world.observation.clone();
        let ctx = &mut world.ctx();
        controller.resolve_blockage(&observation, ctx, &Obstacles::of(&observation, ctx));
        goals.extend(controller.goal);
    }
    let cell = Cell::new(2, 0, 0);
    assert!(goals.contains(&Goal::Frontier { cell, frontier: cell }), "{goals:?}");
}
