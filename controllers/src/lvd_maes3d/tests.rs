use msgs::ids::AgentId;
use protocol::event_mask::EventMask;

use super::*;
use crate::testing::World;
use agent::observation::{Cells, Collision, Contact, Surface};

const FIELD: &str = "\
###############
#.............#
#.............#
#.............#
#.............#
#.............#
#.............#
#.............#
#.............#
#.............#
#.............#
#.............#
#.............#
#.............#
###############
";

/// A room with a pillar, with rock below and above, so that no wall at the edge of the map is
/// visible from inside.
fn hall() -> String {
    let rock = "###############\n".repeat(15);
    let edge = "###############\n".repeat(2);
    let inside = (0..11)
        .map(|row| if (4..7).contains(&row) { "##.....###..###\n" } else { "##...........##\n" })
        .collect::<String>();
    let layer = format!("{edge}{}{edge}", inside.replace("..###\n", "...##\n"));
    [rock.clone(), rock.clone(), layer.clone(), layer, rock.clone(), rock].join("\n")
}

const MIDDLE: Cell = Cell::new(7, 7, 0);

fn contact(x: i32, y: i32, z: i32) -> Contact {
    Contact { agent: AgentId(0), position: Extent::new([15, 15, 15], 1.0).unwrap().centre(Cell::new(x, y, z)) }
}

/// An agent in search mode with a scan from where it is.
fn searching_in(world: &mut World) -> LvdMaes3d {
    world.sense();
    let mut lvd = LvdMaes3d { is_in_search_mode: true, ..LvdMaes3d::new() };
    lvd.scan.load(world.map.extent(), &world.view());
    lvd
}

fn cover_all(world: &mut World) {
    for cell in world.left(&[CellState::Covered]) {
        world.map.note_covered(cell);
    }
}

fn to(cell: Cell) -> Motion {
    Motion::Path(vec![Extent::new([15, 15, 15], 1.0).unwrap().centre(cell)])
}

#[test]
fn acts_a_tick_late_at_the_start_and_after_each_task() {
    let mut world = World::new(FIELD, MIDDLE);
    let mut lvd = LvdMaes3d::new();
    world.sense();
    assert_eq!(world.ask(&mut lvd).wake, WakeCondition::at(Tick(1)));
    world.observation.tick = Tick(1);
    world.sense();
    assert_eq!(world.ask(&mut lvd).motion, to(Cell::new(7, 11, 0)));
    world.run(&mut lvd, 3);
    world.sense();
    world.observation.is_active = false;
    world.observation.tick = Tick(50);
    assert_eq!(world.ask(&mut lvd).wake, WakeCondition::at(Tick(51)));
    world.observation.tick = Tick(51);
    assert_ne!(world.ask(&mut lvd).motion, Motion::Keep);
}

#[test]
fn plus_z_wins_ties_and_cells_within_3_75_are_visited() {
    let mut world = World::new(FIELD, MIDDLE);
    world.run(&mut LvdMaes3d::new(), 2);
    assert_eq!(world.said, ["destination (7.5, 11.5, 0.5), exploration mode"]);
    assert_eq!(world.map.state(Cell::new(9, 4, 0)), CellState::Covered);
    assert_eq!(world.map.state(Cell::new(7, 3, 0)), CellState::Free);
}

#[test]
fn cells_between_two_agents_belong_to_both() {
    let (own, other) = (Cell::new(0, 0, 0), Cell::new(4, 0, 0));
    assert!(is_own(own, &[other], Cell::new(2, 0, 0)) && is_own(other, &[own], Cell::new(2, 0, 0)));
    assert!(!is_own(own, &[other], Cell::new(3, 0, 0)));
    let mut world = World::new(FIELD, MIDDLE);
    world.observation.contacts = vec![contact(7, 9, 0)];
    world.run(&mut LvdMaes3d::new(), 2);
    assert_eq!(world.said, ["destination (3.5, 7.5, 0.5), exploration mode"]);
}

#[test]
fn last_scan_is_used_even_from_another_place() {
    let mut world = World::new(FIELD, MIDDLE);
    world.sense();
    let extent = world.map.extent();
    let far = extent.index(Cell::new(13, 1, 0)).unwrap() as u32;
    world.sense();
    let mut observation = world.observation.clone();
    observation.tick = Tick(9);
    observation.view = Some(Cells { free: vec![far], wall: vec![] });
    let mut lvd = LvdMaes3d { notices_at: Some(Tick(9)), ..LvdMaes3d::new() };
    assert_eq!(world.ask_about(&mut lvd, &observation).motion, to(Cell::new(13, 1, 0)));
}

#[test]
fn selections_count_and_the_last_listed_point_remains() {
    let mut world = World::new(&hall(), Cell::new(3, 7, 2));
    let mut lvd = searching_in(&mut world);
    let extent = world.map.extent();
    let mut select = || lvd.occlusion_point(extent, Cell::new(3, 7, 2), &[]).unwrap().map(|(point, _)| point);
    let mut selected = Vec::new();
    while let Some(point) = select()
        && !selected.contains(&point)
    {
        selected.push(point);
    }
    let distances: Vec<i32> = selected.iter().map(|&point| squared(point - Cell::new(3, 7, 2))).collect();
    assert!(distances.is_sorted(), "{selected:?}");
    let is_beside_another = |point: &Cell| selected.iter().any(|other| squared(*other - *point) == 1);
    assert!(selected.iter().any(is_beside_another), "{selected:?}");
    let last = select();
    assert_eq!((select(), select()), (last, last));
    let selections = &lvd.selections;
    assert!(selections[&last.unwrap()] > 3 && selections.len() == selected.len());
}

#[test]
fn unvisited_cell_in_view_ends_search_mode_at_own_centre() {
    let mut world = World::new(FIELD, MIDDLE);
    let mut lvd = searching_in(&mut world);
    cover_all(&mut world);
    world.sense();
    let mut observation = world.observation.clone();
    observation.is_active = true;
    observation.events = EventMask::NEW_CELL;
    assert_eq!(world.ask_about(&mut lvd, &observation).motion, Motion::Keep);
    // On another map, one cell is not visited; it belongs to another agent.
    let mut world = World::new(FIELD, MIDDLE);
    let mut lvd = searching_in(&mut world);
    for cell in world.left(&[CellState::Covered]).into_iter().filter(|&cell| cell != Cell::new(13, 13, 0)) {
        world.map.note_covered(cell);
    }
    observation.contacts = vec![contact(13, 13, 0)];
    observation.pose.yaw_rad = std::f64::consts::FRAC_PI_2;
    let command = world.ask_about(&mut lvd, &observation);
    assert_eq!((command.motion, lvd.is_in_search_mode), (to(MIDDLE), false));
    observation.events = EventMask::empty();
    assert_eq!(world.ask_about(&mut lvd, &observation).motion, Motion::Keep);
}

#[test]
fn wall_at_the_edge_of_the_map_is_an_error() {
    let mut world = World::new(FIELD, MIDDLE);
    let mut lvd = searching_in(&mut world);
    cover_all(&mut world);
    assert_eq!(lvd.occlusion_point(world.map.extent(), MIDDLE, &[]), Err(OutOfBounds));
    world.sense();
    let mut observation = world.observation.clone();
    observation.tick = Tick(5);
    lvd.notices_at = Some(Tick(5));
    let command = world.ask_about(&mut lvd, &observation);
    assert_eq!((command.motion, command.info.as_str()), (Motion::Keep, NO_DESTINATION));
    assert!(lvd.selections.is_empty());
}

/// When it looks again that has found no destination at a tick, with the agents in contact.
fn looks_again_at(lvd: &mut LvdMaes3d, world: &mut World, tick: u64, contacts: &[Contact]) -> u64 {
    world.observation.tick = Tick(tick);
    world.observation.scan_tick = Some(Tick(tick / 10 * 10));
    world.observation.view = Some(world.view());
    world.observation.contacts = contacts.to_vec();
    lvd.is_in_search_mode = false;
    let command = world.ask(lvd);
    assert_eq!((command.motion, command.stage), (Motion::Keep, Some(Stage::Waiting)));
    assert_eq!(command.wake.events, EventMask::MESSAGE | EventMask::CONTACTS);
    command.wake.at.0
}

#[test]
fn without_destination_it_waits_for_the_next_scan_then_for_changes() {
    let mut world = World::new(FIELD, MIDDLE);
    world.sense();
    cover_all(&mut world);
    let mut lvd = LvdMaes3d { notices_at: Some(Tick(5)), ..LvdMaes3d::new() };
    // The first view may be from another place; that of the next scan changes nothing.
    assert_eq!(looks_again_at(&mut lvd, &mut world, 5, &[]), 10);
    assert_eq!(looks_again_at(&mut lvd, &mut world, 10, &[]), 10 + IDLE_TICKS);
}

#[test]
fn another_agent_that_moves_is_watched_in_each_tick() {
    let mut world = World::new(FIELD, MIDDLE);
    world.sense();
    for cell in world.left(&[CellState::Covered]).into_iter().filter(|&cell| cell != Cell::new(1, 1, 0)) {
        world.map.note_covered(cell);
    }
    let mut lvd = LvdMaes3d { notices_at: Some(Tick(5)), ..LvdMaes3d::new() };
    assert_eq!(looks_again_at(&mut lvd, &mut world, 301, &[contact(3, 2, 0)]), 302);
    assert_eq!(looks_again_at(&mut lvd, &mut world, 302, &[contact(4, 2, 0)]), 303);
    assert_eq!(looks_again_at(&mut lvd, &mut world, 303, &[contact(4, 2, 0)]), 310, "it rests");
    // What it leaves is this agent's.
    world.observation.contacts.clear();
    assert_eq!(world.ask(&mut lvd).motion, to(Cell::new(1, 1, 0)));
}

#[test]
fn path_is_not_searched_again_until_the_map_changes() {
    let mut world = World::new(FIELD, MIDDLE);
    let index = |cell| Extent::new([15, 15, 1], 1.0).unwrap().index(cell).unwrap() as u32;
    // Seen free, with unexplored cells before it.
    let far = Cell::new(7, 11, 0);
    world.map.note_covered(MIDDLE);
    world.map.note_free(&[index(far)]);
    world.observation.view = Some(Cells { free: vec![index(far)], wall: vec![] });
    let mut lvd = LvdMaes3d { notices_at: Some(Tick::ZERO), ..LvdMaes3d::new() };
    let first = world.ask(&mut lvd);
    assert_eq!((first.motion, first.stage), (Motion::Keep, Some(Stage::Waiting)));
    assert_eq!(lvd.no_path.map(|(from, to, _)| (from, to)), Some((MIDDLE, far)));
    world.map.note_free(&[8, 9, 10].map(|y| index(Cell::new(7, y, 0))));
    world.wait(20);
    assert_eq!(world.ask(&mut lvd).motion, to(far));
}

#[test]
fn vertical_legs_begin_with_a_turn() {
    let layer = "#####\n#...#\n#####\n".to_owned();
    let shaft = "#####\n#.###\n#####\n".to_owned();
    let rock = "#####\n#####\n#####\n".to_owned();
    let layers = [&rock, &layer, &shaft, &shaft, &shaft, &shaft, &rock].map(String::as_str);
    let mut world = World::new(&layers.join("\n"), Cell::new(1, 1, 1));
    let mut lvd = LvdMaes3d { notices_at: Some(Tick::ZERO), ..LvdMaes3d::new() };
    world.sense();
    let above = Cell::new(1, 1, 5);
    let mut observation = world.observation.clone();
    observation.view = Some(Cells { free: vec![world.map.extent().index(above).unwrap() as u32], wall: vec![] });
    let turn = world.ask_about(&mut lvd, &observation);
    assert_eq!(turn.motion, Motion::turn(std::f64::consts::FRAC_PI_2));
    // Between two legs it chooses nothing, and loses no tick.
    observation.tick = Tick(100);
    observation.events = EventMask::TASK_DONE;
    observation.pose.yaw_rad = std::f64::consts::FRAC_PI_2;
    let up = world.ask_about(&mut lvd, &observation);
    assert_eq!(up.motion, Motion::Path(vec![world.map.extent().centre(above)]));
    observation.tick = Tick(200);
    assert_eq!(world.ask_about(&mut lvd, &observation).wake, WakeCondition::at(Tick(201)));
    // A collision ends the path.
    let mut observation = Observation { tick: Tick(201), collision: None, ..observation };
    observation.pose.yaw_rad = 0.0;
    assert_eq!(world.ask_about(&mut lvd, &observation).motion, turn.motion);
    observation.collision = Some(Collision { surface: Surface::Wall, with_agent: false });
    assert_eq!(world.ask_about(&mut lvd, &observation).motion, turn.motion, "it sets out again");
}

#[test]
fn visits_a_room_with_a_pillar() {
    let mut world = World::new(&hall(), Cell::new(3, 7, 2));
    world.run(&mut LvdMaes3d::new(), 2000);
    assert!(world.said.iter().any(|said| said.ends_with("search mode")), "{:?}", world.said);
    assert_eq!(world.left(&[CellState::Covered]), []);
}

#[test]
fn path_search_uses_faces_and_takes_no_time() {
    let start = Cell::new(3, 7, 2);
    let mut world = World::known(&hall(), start);
    let far = world.left(&[]).into_iter().filter(|&cell| squared(cell - start) > 15);
    let path = |world: &mut World, goal, by| world.ctx().go_to_cell_by(goal, by, SearchTime::Instant);
    let mut both =
        far.map(|goal| (goal, [Neighbours::Six, Neighbours::TwentySix].map(|by| path(&mut world, goal, by))));
    let (goal, [over_faces, _]) = both.find(|(_, [one, other])| one != other).unwrap();
    world.observation.view = Some(Cells { free: vec![world.map.extent().index(goal).unwrap() as u32], wall: vec![] });
    let mut lvd = LvdMaes3d { notices_at: Some(Tick::ZERO), ..LvdMaes3d::new() };
    assert_eq!(NavigationStatus::Go(world.ask(&mut lvd).motion), over_faces);
}
