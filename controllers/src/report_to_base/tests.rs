use protocol::agent_message::AgentMessage;
use voxels::Cell;

use super::*;
use crate::testing::{World, flat};

/// A gallery with the base at its left end.
const GALLERY: &str = "#################\n#...............#\n#################\n";

const BASE: AgentId = AgentId(0);

/// Rests always.
struct Resting;

impl Controller for Resting {
    fn decide(&mut self, _: &Observation, _: &mut Ctx<'_>) -> Command {
        Command::new(Motion::Stop, WakeCondition::on(EventMask::MESSAGE)).with_stage(Stage::Waiting)
    }
}

/// Moves to the right without an end.
struct Leaving;

impl Controller for Leaving {
    fn decide(&mut self, _: &Observation, ctx: &mut Ctx<'_>) -> Command {
        Command::new(Motion::Path(vec![ctx.place(flat(15, 1))]), WakeCondition::TASK_DONE)
    }
}

fn world() -> World {
    let mut world = World::known(GALLERY, flat(2, 1));
    world.run_info.base_stations = vec![BASE];
    world
}

fn reporter(world: &World, inner: Box<dyn Controller>, settings: &[&str]) -> Box<dyn Controller> {
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    let mut settings = Settings::parse(&settings).unwrap();
    Reporting::from_settings(&mut settings, AgentId(1), &world.run_info).unwrap().around(inner)
}

fn meet_base(world: &mut World) {
    let position = world.map.extent().centre(flat(1, 1));
    world.observation.contacts = vec![Contact { agent: BASE, position }];
    world.observation.events |= EventMask::CONTACTS;
}

fn part(world: &mut World, cell: Cell) {
    world.observation.contacts.clear();
    world.observation.events |= EventMask::CONTACTS;
    world.put(cell);
}

fn hear(world: &mut World, from: AgentId, said: AtBase) {
    let command = said.broadcast(Command::keep(WakeCondition::NEXT_TICK));
    let message = &command.messages[0];
    let (peer, data) = (Peer::One(from), message.data.clone());
    world.observation.messages = vec![AgentMessage { peer, kind: message.kind, data }];
    world.observation.events |= EventMask::MESSAGE;
}

fn ask(world: &mut World, controller: &mut dyn Controller) -> Command {
    let command = world.ask(controller);
    world.observation.messages.clear();
    command
}

#[test]
fn messages_round_trip_and_others_are_refused() {
    for said in [AtBase::Knows(0), AtBase::Knows(123_456), AtBase::Courier] {
        let command = said.broadcast(Command::keep(WakeCondition::NEXT_TICK));
        let message = &command.messages[0];
        assert_eq!(AtBase::decode(message.kind, &message.data), Some(said));
        assert_eq!(AtBase::decode(MessageType::Claims.number(), &message.data), None);
    }
    for wrong in [&[][..], &[2], &[VERSION, 1], &[VERSION, 1, 2, 3, 4, 5]] {
        assert_eq!(AtBase::decode(MessageType::AtBase.number(), wrong), None, "{wrong:?}");
    }
}

#[test]
fn wrapper_is_not_there_without_a_base_or_a_strategy() {
    let mut world = world();
    let known = world.map.free() as u32;
    let mut off = reporter(&world, Box::new(Resting), &["to_base=off"]);
    meet_base(&mut world);
    hear(&mut world, BASE, AtBase::Knows(known - 1));
    assert_eq!(ask(&mut world, &mut *off).wake.at, Tick(u64::MAX));
    world.run_info.base_stations.clear();
    let mut alone = reporter(&world, Box::new(Resting), &["to_base=rendezvous"]);
    assert_eq!(ask(&mut world, &mut *alone).wake.at, Tick(u64::MAX));
}

#[test]
fn one_that_rests_with_news_goes_back_until_the_base_has_them() {
    let mut world = world();
    let known = world.map.free() as u32;
    let mut agent = reporter(&world, Box::new(Resting), &["to_base=rendezvous"]);
    meet_base(&mut world);
    hear(&mut world, BASE, AtBase::Knows(known));
    assert_eq!(ask(&mut world, &mut *agent).wake.at, Tick(u64::MAX), "the base has all");
    part(&mut world, flat(12, 1));
    let wall = world.map.extent().index(flat(16, 1)).unwrap() as u32;
    world.map.note_free(&[wall]);
    world.wait(10);
    let waits = ask(&mut world, &mut *agent);
    assert_eq!((waits.motion, waits.wake.at), (Motion::Keep, Tick(100)), "it rests since tick 0");
    world.wait(90);
    let back = ask(&mut world, &mut *agent);
    assert_eq!(back.motion, Motion::Path(vec![world.map.extent().centre(flat(1, 1))]));
    assert_eq!(back.stage, Some(Stage::Carrying));
    world.put(flat(6, 1));
    meet_base(&mut world);
    let hands_over = ask(&mut world, &mut *agent);
    assert_eq!((hands_over.motion, hands_over.wake.at), (Motion::Stop, Tick(110)));
    world.wait(10);
    assert_eq!(ask(&mut world, &mut *agent).wake.at, Tick(100 + HAND_OVER_TICKS), "the base lacks a cell");
    hear(&mut world, BASE, AtBase::Knows(known + 1));
    world.wait(10);
    let done = ask(&mut world, &mut *agent);
    assert_eq!((done.stage, done.wake.at), (Some(Stage::Waiting), Tick(u64::MAX)));
}

#[test]
fn news_wait_for_their_time_and_for_a_courier() {
    let mut world = world();
    let mut agent = reporter(&world, Box::new(Leaving), &["to_base=rendezvous", "report_s=40"]);
    meet_base(&mut world);
    let known = world.map.free() as u32;
    hear(&mut world, BASE, AtBase::Knows(known));
    ask(&mut world, &mut *agent);
    part(&mut world, flat(8, 1));
    let wall = world.map.extent().index(flat(16, 1)).unwrap() as u32;
    world.map.note_free(&[wall]);
    world.wait(100);
    // Another agent takes them.
    hear(&mut world, AgentId(2), AtBase::Courier);
    assert_eq!(ask(&mut world, &mut *agent).wake.at, Tick(2100));
    world.wait(2000);
    let position = world.map.extent().centre(flat(13, 1));
    world.observation.contacts = vec![Contact { agent: AgentId(2), position }];
    let back = ask(&mut world, &mut *agent);
    assert_eq!(back.stage, Some(Stage::Carrying));
    let told = back.messages.iter().map(|message| AtBase::decode(message.kind, &message.data));
    assert_eq!(told.collect::<Vec<_>>(), [Some(AtBase::Courier)]);
}

#[test]
fn no_courier_is_announced_where_no_path_is_known() {
    let split = "#################\n#......#........#\n#################\n";
    let mut world = World::known(split, flat(2, 1));
    world.run_info.base_stations = vec![BASE];
    let known = world.map.free() as u32;
    let mut agent = reporter(&world, Box::new(Resting), &["to_base=rendezvous"]);
    meet_base(&mut world);
    hear(&mut world, BASE, AtBase::Knows(known));
    ask(&mut world, &mut *agent);
    part(&mut world, flat(12, 1));
    let wall = world.map.extent().index(flat(16, 1)).unwrap() as u32;
    world.map.note_free(&[wall]);
    world.wait(100);
    let position = world.map.extent().centre(flat(13, 1));
    world.observation.contacts = vec![Contact { agent: AgentId(2), position }];
    let stays = ask(&mut world, &mut *agent);
    assert_eq!((stays.stage, stays.messages.len()), (Some(Stage::Waiting), 0));
}

#[test]
fn relays_are_left_on_the_way_out_of_sight_of_the_base() {
    let bend = "#######\n#.....#\n#####.#\n#####.#\n#######\n";
    let position = World::known(bend, flat(2, 3)).map.extent().centre(flat(1, 3));
    let dropped = |settings: &[&str], contact: AgentId| {
        let mut world = World::known(bend, flat(2, 3));
        world.run_info.base_stations = vec![BASE];
        let mut agent = reporter(&world, Box::new(Resting), settings);
        world.observation.contacts = vec![Contact { agent: contact, position }];
        world.put(flat(5, 3));
        world.observation.velocity_in_map_m_s = nalgebra::Vector3::new(0.0, -1.0, 0.0);
        let command = ask(&mut world, &mut *agent);
        command.messages.iter().filter(|message| message.peer == Peer::NewRelay).count()
    };
    assert_eq!(dropped(&["to_base=relay-chain"], BASE), 1);
    assert_eq!(dropped(&["to_base=rendezvous"], BASE), 0);
    assert_eq!(dropped(&["to_base=relay-chain"], AgentId(2)), 0, "it is no base");
}
