use voxels::Cell;

use super::*;
use crate::testing::{World, flat};

/// A room, and a lane as wide as one body with something unexplored at its end.
const LANE: &str = "\
    ############\n\
    #....#######\n\
    #..........?\n\
    #....#######\n\
    ############\n";

const LOWER: AgentId = AgentId(0);
const HIGHER: AgentId = AgentId(2);

/// Agent 1 in a cell, in contact with another one in the middle of a cell.
fn meeting(map: &str, here: Cell, agent: AgentId, there: Cell) -> World {
    let mut world = World::known(map, here);
    let position = world.map.extent().centre(there);
    world.observation.contacts.push(Contact { agent, position });
    world
}

/// What it does at a blockage after another 10 s.
fn note(blockages: &mut Blockages, world: &mut World) -> Option<Command> {
    world.wait(500);
    let observation = world.observation.clone();
    blockages.note(&observation, &world.ctx())
}

/// Where it goes at the first of some blockages at which it leaves the way, and the number of that
/// blockage.
fn leaves(world: &mut World, blockages: usize) -> Option<(usize, Cell)> {
    let mut state = Blockages::default();
    let command = |number| Some((number, note(&mut state, world)?.motion));
    let motions: Vec<(usize, Motion)> = (1..=blockages).filter_map(command).collect();
    let extent = world.map.extent();
    motions.into_iter().find_map(|(number, motion)| match motion {
        Motion::Path(waypoints) => Some((number, extent.cell_of(waypoints.last()?))),
        _ => None,
    })
}

#[test]
fn no_body_nearby_is_no_blockage() {
    let mut world = World::known(LANE, flat(7, 2));
    let mut blockages = Blockages::default();
    assert!((0..20).all(|_| note(&mut blockages, &mut world).is_none()));
}

#[test]
fn a_body_is_shut_in_that_reaches_no_frontier() {
    for (here, there, expected) in [((4, 2), (3, 2), true), ((6, 2), (7, 2), false), ((2, 2), (3, 2), false)] {
        let (here, there) = (flat(here.0, here.1), flat(there.0, there.1));
        let mut world = meeting(LANE, here, LOWER, there);
        let (observation, at) = (world.observation.clone(), world.map.extent().centre(there));
        assert_eq!(room::is_shut_in((LOWER, at), &observation, &world.ctx()), expected, "{here:?} {there:?}");
    }
}

#[test]
fn the_mouth_of_a_lane_is_left_for_a_place_beside_it() {
    let mut world = meeting(LANE, flat(4, 2), LOWER, flat(3, 2));
    let (_, to) = leaves(&mut world, 4).unwrap();
    assert!([flat(4, 1), flat(4, 3)].contains(&to), "{to:?}");
}

#[test]
fn a_lane_is_left_for_the_room_before_it() {
    // Nothing is unexplored, so the other one wants to come out.
    let mut world = meeting(&LANE.replace('?', "#"), flat(7, 2), LOWER, flat(8, 2));
    let (_, to) = leaves(&mut world, 4).unwrap();
    assert!(to.x <= 4 && to.y != 2, "{to:?}");
    // Not if a third one is behind it, and not towards the other one.
    let behind = Contact { agent: HIGHER, position: world.map.extent().centre(flat(6, 2)) };
    world.observation.contacts.push(behind);
    assert_eq!(leaves(&mut world, 20), None);
}

#[test]
fn the_higher_id_leaves_first() {
    let numbers = [LOWER, HIGHER].map(|other| leaves(&mut meeting(LANE, flat(4, 2), other, flat(3, 2)), 20).unwrap().0);
    assert_eq!(numbers, [4, 4 + LATER as usize]);
    // One with a frontier before it is no reason to go far.
    let far = |other| leaves(&mut meeting(LANE, flat(8, 2), other, flat(9, 2)), 30).unwrap().0;
    let late = 3 + LATE_TURNS[0] as usize;
    assert_eq!([far(LOWER), far(HIGHER)], [late, late + LATER as usize]);
}

#[test]
fn it_stays_away_until_the_other_one_has_passed_or_for_a_time() {
    for passes in [true, false] {
        let mut world = meeting(LANE, flat(4, 2), LOWER, flat(3, 2));
        let mut blockages = Blockages::default();
        assert_eq!((0..3).filter_map(|_| note(&mut blockages, &mut world)).count(), 0);
        assert!(matches!(note(&mut blockages, &mut world).unwrap().motion, Motion::Path(_)));
        world.put(flat(4, 1));
        let still = |world: &mut World, blockages: &mut Blockages| {
            world.wait(500);
            let observation = world.observation.clone();
            blockages.still_waits(&observation, &world.ctx()).is_some()
        };
        assert!(still(&mut world, &mut blockages) && still(&mut world, &mut blockages));
        if passes {
            world.observation.contacts[0].position = world.map.extent().centre(flat(10, 2));
            assert!(!still(&mut world, &mut blockages));
        } else {
            assert_eq!((0..10).filter(|_| still(&mut world, &mut blockages)).count(), 1);
        }
    }
}

#[test]
fn a_detour_comes_before_steps_aside_and_rests() {
    let mut world = meeting(LANE, flat(2, 2), HIGHER, flat(3, 2));
    let mut blockages = Blockages::default();
    let mut yields = Vec::new();
    for _ in 0..10 {
        world.wait(500);
        let observation = world.observation.clone();
        let detour = |_: &Obstacles| Some(Command::new(Motion::Stop, WakeCondition::NEXT_TICK));
        yields.extend(blockages.note_between_steps(&observation, &world.ctx(), detour));
    }
    let is_detour = |number: usize| matches!(yields[number], Yield::Detour(_));
    let is_step = |number: usize| yields[number] == Yield::StepAside;
    assert!(is_detour(0) && is_step(1) && is_step(2) && is_step(3), "{yields:?}");
    // After each rest it tries again to get past.
    assert!(matches!(yields[4], Yield::Rest(_)) && is_detour(5) && matches!(yields[6], Yield::Rest(_)), "{yields:?}");
}

/// Controllers that go to whatever frontier they can come to.
const EXPLORERS: [&str; 2] = ["lvd", "nearest-frontier"];

/// Free cells that a body comes to by steps to faces from where it is, past one that stands in a
/// cell.
fn reached(world: &World, standing: Cell) -> Vec<Cell> {
    let extent = world.map.extent();
    let mut reached = vec![extent.cell_of(&world.observation.pose.position)];
    let mut next = 0;
    while let Some(&cell) = reached.get(next) {
        next += 1;
        for beside in cell.neighbours6() {
            if beside != standing && world.map.state(beside).is_free() && !reached.contains(&beside) {
                reached.push(beside);
            }
        }
    }
    reached
}

#[test]
fn explorers_go_the_other_way_round_a_body_that_stays() {
    // Two ways around a block; a body stands in one of them, and in a door of the other map.
    let ring = "........\n.######.\n.######.\n.######.\n.######.\n........\n";
    let doors = "...#....\n........\n...#....\n...#....\n........\n...#....\n";
    for (text, start, standing) in
        [(ring, flat(0, 0), flat(3, 0)), (ring, flat(7, 5), flat(7, 2)), (doors, flat(0, 4), flat(3, 4))]
    {
        for name in EXPLORERS {
            let mut world = World::new(text, start).aerial();
            let position = world.map.extent().centre(standing);
            world.observation.contacts.push(Contact { agent: HIGHER, position });
            let mut controller = crate::build(name, &[], AgentId(1), &world.run_info).unwrap();
            world.run(&mut *controller, 20_000);
            let frontiers: Vec<Cell> =
                reached(&world, standing).into_iter().filter(|&cell| world.map.is_frontier(cell)).collect();
            assert!(frontiers.is_empty(), "{name} leaves {frontiers:?} in\n{text}: {:?}", world.said.last());
        }
    }
}

#[test]
fn the_last_one_of_a_jam_leaves_and_then_the_next_one() {
    // This one is between two others, and the one behind it goes away.
    let mut world = meeting(&LANE.replace('?', "#"), flat(7, 2), LOWER, flat(8, 2));
    let behind = Contact { agent: AgentId(3), position: world.map.extent().centre(flat(6, 2)) };
    world.observation.contacts.push(behind);
    let mut blockages = Blockages::default();
    let is_way = |command: &Option<Command>| matches!(command, Some(Command { motion: Motion::Path(_), .. }));
    assert!(!(0..12).any(|_| is_way(&note(&mut blockages, &mut world))));
    world.observation.contacts[1].position = world.map.extent().centre(flat(1, 1));
    assert!(is_way(&note(&mut blockages, &mut world)));
}

#[test]
fn without_room_it_goes_back_a_little() {
    // A lane without a room: nowhere does a body let another one pass.
    let lane = "##########\n#........?\n##########\n";
    let mut world = meeting(lane, flat(6, 1), LOWER, flat(7, 1));
    let (_, to) = leaves(&mut world, 30).unwrap();
    assert!((1..=4).contains(&to.x), "{to:?}");
}
