use super::frontiers::CLEARED_FROM;
use super::*;
use crate::testing::{RADIUS_M, World, drawn, flat};
use agent::bodies::{BodyKind, BodyModel};
use agent::path::Moves;
use protocol::event_mask::EventMask;

/// The moves of a body that fits into a cell.
fn moves() -> Moves {
    Moves::new(RADIUS_M, 1.0, Neighbours::Six)
}

fn rng() -> ChaCha8Rng {
    voxels::random_streams::stream(1, 0, "test")
}

fn planner() -> DsvpMaes3d {
    DsvpMaes3d::new(rng())
}

/// Passes the tick in which the end of a task is not noticed yet, and requests a decision.
fn act(world: &mut World, planner: &mut DsvpMaes3d) -> Command {
    let late = world.ask(planner);
    assert_eq!(late.motion, Motion::Keep);
    assert_eq!(late.wake, WakeCondition::at(world.observation.tick.next()));
    world.wait(1);
    world.ask(planner)
}

fn destination(world: &World, command: &Command) -> Cell {
    let Motion::Path(waypoints) = &command.motion else { panic!("{command:?}") };
    world.map.extent().cell_of(waypoints.last().unwrap())
}

/// A wide room with an unknown right side.
fn room() -> String {
    [".........?"; 9].join("\n") + "\n"
}

/// In the room, with all known cells in view.
fn in_room() -> World {
    let mut world = World::known(&room(), flat(4, 4));
    world.show(&(0..81).map(|number| flat(number % 9, number / 9)).collect::<Vec<_>>());
    world
}

/// A bent corridor with unknown ends: both are visible from the corner, only one from an end.
const BENT: &str = "\
    ?.....\n\
    #####.\n\
    #####.\n\
    #####?\n";

#[test]
fn waits_for_a_scan_and_a_tick_and_always_requests_the_view() {
    let mut world = World::known(&room(), flat(4, 4));
    let mut planner = planner();
    assert_eq!(world.ask(&mut planner), Command::keep(WakeCondition::NEXT_TICK).with_view_request());
    world.observation = Observation { tick: Tick(1), ..in_room().observation };
    // One tick after the start the status becomes idle, with or without a scan.
    let go = world.ask(&mut planner);
    assert!(matches!(go.motion, Motion::Path(_)) && go.want_view, "{go:?}");
    assert_eq!(go.wake, UNDER_WAY);
    assert_eq!(world.ask(&mut planner), Command::keep(UNDER_WAY).with_view_request());
    // The end of a task is noticed a tick late; a collision at once.
    world.arrive(&go.motion);
    let go = act(&mut world, &mut planner);
    assert!(matches!(go.motion, Motion::Path(_)));
    world.collide();
    assert!(matches!(world.ask(&mut planner).motion, Motion::Path(_)));
}

#[test]
fn frontiers_along_y_are_always_chosen() {
    let map = drawn("?????\n.....\n.....\n.....\n?????\n");
    let view = Cells { free: (0..25).collect(), wall: Vec::new() };
    let here = Point3::new(2.5, 2.5, 0.5);
    let (chosen, others) = local_frontiers(&view, &map, here);
    // Straight ahead first; of two at equal distances the one with the lower index.
    assert_eq!(chosen, [flat(2, 3), flat(1, 3), flat(3, 3), flat(0, 3), flat(4, 3)]);
    assert_eq!(others, (0..5).map(|x| flat(x, 1)).collect::<Vec<_>>());
    // Moving the other way changes nothing.
    let (chosen, _) = local_frontiers(&view, &map, Point3::new(2.5, 0.5, 0.5));
    assert!(chosen.contains(&flat(2, 3)));
}

#[test]
fn local_frontiers_are_not_covered() {
    let mut map = drawn("....?\n");
    let view = Cells { free: (0..4).collect(), wall: Vec::new() };
    let here = Point3::new(0.5, 0.5, 0.5);
    assert_eq!(local_frontiers(&view, &map, here), (vec![flat(3, 0)], Vec::new()));
    map.note_covered(flat(3, 0));
    assert!(map.is_frontier(flat(3, 0)));
    assert_eq!(local_frontiers(&view, &map, here), (Vec::new(), Vec::new()));
}

#[test]
fn new_frontiers_are_listed_once_and_others_repeatedly() {
    let map = drawn("?.?.?.?.?\n");
    let view = Cells { free: vec![1, 3, 5, 7], wall: Vec::new() };
    let mut frontiers = Frontiers::default();
    frontiers.push_new(&view, &map);
    frontiers.push_new(&view, &map);
    assert_eq!(frontiers.list, [1, 3, 5, 7].map(|x| flat(x, 0)));
    frontiers.push(flat(1, 0), &map);
    assert_eq!(frontiers.list.len(), 5);
    assert_eq!(frontiers.take_last(), Some(flat(1, 0)));
    frontiers.list_again();
    assert!(frontiers.listed.contains(&flat(1, 0)), "it is on the list once more");
}

#[test]
fn early_purge_changes_only_the_length_of_the_list() {
    let mut map = drawn(&room());
    let mut frontiers = Frontiers::default();
    for number in 0..20 * CLEARED_FROM {
        frontiers.push(flat(8, number as i32 % 9), &map);
        if number == 5 * CLEARED_FROM {
            map.note_wall(&(0..4).map(|y| 10 * y + 9).collect::<Vec<_>>());
        }
    }
    let all = (0..20 * CLEARED_FROM).map(|number| flat(8, number as i32 % 9)).filter(|&cell| map.is_frontier(cell));
    frontiers.clear_of_others(&map);
    assert!(frontiers.list.iter().copied().eq(all));
    assert!(frontiers.cleared > CLEARED_FROM);
}

#[test]
fn samples_are_biased_near_and_within_the_horizon() {
    let mut rng = rng();
    let root = Point3::new(100.5, 100.5, 100.5);
    let chosen = [flat(500, 0), flat(500, 9)];
    let mut near = [0; 2];
    for _ in 0..10_000 {
        let at = sample(&mut rng, root, &chosen);
        if let Some(which) = chosen.iter().position(|&cell| (at - centre(cell)).amax() <= JITTER) {
            near[which] += 1;
        } else {
            assert!((at - root).amax() <= HORIZON, "{at}");
        }
    }
    let [first, second] = near;
    assert!((2800..3200).contains(&(first + second)) && (1300..1700).contains(&first), "{near:?}");
    for _ in 0..1000 {
        assert!((sample(&mut rng, root, &[]) - root).amax() <= HORIZON);
    }
}

#[test]
fn only_edge_ends_are_checked_and_covered_ends_refused() {
    // A wall between two rooms that a step of one cell can only cross at its corner.
    let mut map = drawn("..\n..\n");
    assert!(is_open(Graph::new(&map, &moves()), Point3::new(1.2, 1.2, 0.5)));
    map.note_covered(flat(1, 1));
    assert!(!is_open(Graph::new(&map, &moves()), Point3::new(1.2, 1.2, 0.5)), "covered");
    assert!(!is_open(Graph::new(&map, &moves()), Point3::new(-0.1, 0.5, 0.5)), "outside");

    // A body could not pass between the walls at a corner; an edge of the tree does.
    let map = drawn("#.\n.#\n");
    let mut trees = Trees::new(Point3::new(0.9, 0.9, 0.5));
    for stage in 0..20 {
        trees.grow(&mut voxels::random_streams::stream(1, stage, "test"), Graph::new(&map, &moves()), &[flat(1, 1)]);
    }
    let has_crossed = |tree: &Tree| tree.post_order().into_iter().any(|node| cell_of(tree.at(node)) == flat(1, 1));
    assert!(has_crossed(&trees.local) && has_crossed(&trees.global));
}

#[test]
fn edges_are_at_most_one_cell_long() {
    let from = Point3::new(1.0, 2.0, 3.0);
    assert_eq!(step(from, Point3::new(1.0, 2.0, 9.0)), Point3::new(1.0, 2.0, 4.0));
    assert_eq!(step(from, Point3::new(1.0, 2.5, 3.0)), Point3::new(1.0, 2.5, 3.0));
    assert_eq!(step(from, from), from);
}

#[test]
fn stage_always_draws_200_samples() {
    let map = drawn("....\n....\n");
    let mut trees = Trees::new(Point3::new(0.5, 0.5, 0.5));
    let mut drawn_by_stage = rng();
    trees.grow(&mut drawn_by_stage, Graph::new(&map, &moves()), &[]);
    let mut drawn_here = rng();
    for _ in 0..200 {
        sample(&mut drawn_here, Point3::new(0.5, 0.5, 0.5), &[]);
    }
    assert_eq!(drawn_by_stage.random::<u64>(), drawn_here.random::<u64>());
    assert!(trees.local.len() > 1 && trees.local.len() < 201);
}

#[test]
fn neighbour_towards_y_has_no_gain() {
    let with = |cell: Cell, is_wall: bool| {
        let mut map = drawn(&["...\n...\n..."; 3].join("\n\n").replace('.', "?"));
        for offset in FACES {
            let neighbour = Cell::new(1, 1, 1) + offset;
            let index = map.extent().index(neighbour).unwrap() as u32;
            if neighbour != cell {
                map.note_free(&[index]);
            } else if is_wall {
                map.note_wall(&[index]);
            }
        }
        Gains::of(Graph::new(&map, &moves()), &mut Vec::new()).at(Cell::new(1, 1, 1))
    };
    for offset in FACES {
        let counts = if offset == Cell::new(0, 1, 0) { 0.0 } else { 1.0 };
        let neighbour = Cell::new(1, 1, 1) + offset;
        assert_eq!(with(neighbour, false), 10.0 * counts, "{offset:?}");
        assert_eq!(with(neighbour, true), -counts, "{offset:?}");
    }
}

#[test]
fn relocation_takes_the_last_of_the_list() {
    // Both ends are behind a corner; the far one is last on the list.
    let corridor = "....?\n.####\n.####\n...?#\n".replace("...?#", "..?##");
    let mut world = World::known(&corridor, flat(0, 2));
    world.show(&[flat(0, 2)]);
    let mut planner = planner();
    for far_is_last in [true, false] {
        planner.is_done = false;
        planner.frontiers = Frontiers::default();
        let (far, near) = (flat(3, 3), flat(1, 0));
        for cell in if far_is_last { [near, far] } else { [far, near] } {
            planner.frontiers.push(cell, &world.map);
        }
        let go = act(&mut world, &mut planner);
        assert_eq!(destination(&world, &go), if far_is_last { far } else { near });
        assert_eq!(planner.frontiers.list.len(), 1);
        world.observation.is_active = false;
    }
}

#[test]
fn relocation_discards_frontiers_in_straight_reach() {
    let mut world = World::known(BENT, flat(5, 3));
    world.show(&[flat(5, 3)]);
    let mut planner = planner();
    // Both ends can be reached straight from the corner: the last one left is the destination, and
    // the list is empty.
    for cell in [flat(1, 3), flat(5, 1)] {
        planner.frontiers.push(cell, &world.map);
    }
    let go = act(&mut world, &mut planner);
    assert_eq!(destination(&world, &go), flat(1, 3));
    assert!(planner.is_done && planner.frontiers.list.is_empty());
    assert_eq!(go.wake, NEVER);

    // From the other end, the last one can be reached straight and is discarded; the one behind the
    // corner ends the loop.
    let mut world = World::known(BENT, flat(3, 3));
    world.show(&[flat(3, 3)]);
    let mut planner = self::planner();
    for cell in [flat(1, 3), flat(5, 1), flat(1, 3)] {
        planner.frontiers.push(cell, &world.map);
    }
    let go = act(&mut world, &mut planner);
    assert_eq!(destination(&world, &go), flat(5, 1));
    assert!(!planner.is_done);
    assert_eq!(planner.frontiers.list, [flat(1, 3)], "the first entry is another one");
}

#[test]
fn relocation_skips_former_frontiers() {
    let mut world = World::known(BENT, flat(5, 3));
    world.show(&[flat(5, 3)]);
    let mut planner = planner();
    for cell in [flat(1, 3), flat(5, 1)] {
        planner.frontiers.push(cell, &world.map);
    }
    world.map.note_wall(&[5]);
    let go = act(&mut world, &mut planner);
    assert_eq!(destination(&world, &go), flat(1, 3));
}

#[test]
fn done_agent_stays_done() {
    let mut world = World::known("...\n", flat(1, 0));
    world.show(&[flat(0, 0), flat(1, 0), flat(2, 0)]);
    let mut planner = planner();
    let end = act(&mut world, &mut planner);
    assert_eq!((end.motion, end.info.as_str(), end.wake), (Motion::Keep, "no frontiers left", NEVER));
    let mut world = in_room();
    world.observation.events = EventMask::MESSAGE;
    assert_eq!(world.ask(&mut planner), Command::keep(NEVER));
}

#[test]
fn last_destination_is_the_root_even_if_not_reached() {
    let mut world = in_room();
    let mut planner = planner();
    let first = act(&mut world, &mut planner);
    let (at, _) = planner.trees.as_ref().unwrap().destination.unwrap();
    assert_eq!(cell_of(at), destination(&world, &first));
    world.collide();
    world.ask(&mut planner);
    let trees = planner.trees.unwrap();
    assert_eq!(trees.local.at(trees.local.root()), at);
    assert_eq!(trees.global.at(trees.global.root()), centre(flat(4, 4)), "the global tree keeps its root");
}

#[test]
fn relocation_persists() {
    let map = drawn(&room());
    let mut trees = Trees::new(Point3::new(4.5, 4.5, 0.5));
    trees.grow(&mut rng(), Graph::new(&map, &moves()), &[]);
    let grown = trees.global.len();
    trees.destination = Some((trees.local.at(3), 3));
    trees.begin_stage();
    trees.global.add(Point3::new(7.5, 7.5, 0.5), 0);
    assert_ne!(trees.local.len(), trees.global.len());

    trees.relocate_to(Point3::new(8.5, 8.5, 0.5));
    let (at, _) = trees.destination.unwrap();
    assert!((0..grown as u32).any(|node| trees.global.at(node) == at), "the nearest node, not the frontier itself");
    for _ in 0..3 {
        trees.begin_stage();
        assert_eq!(
            trees.local.len(),
            trees.global.len(),
            "a copy of the global tree, of which nothing is out of the cube"
        );
        assert_eq!(trees.local.at(trees.local.root()), at);
        let node = trees.local.best_branch(|_| 1.0).unwrap();
        trees.destination = Some((trees.local.at(node), node));
        trees.begin_stage();
        assert_eq!(
            trees.local.at(trees.local.root()),
            trees.destination.unwrap().0,
            "of a destination of exploration, too"
        );
        trees.relocate_to(at);
    }
}

#[test]
fn global_tree_grows_with_every_stage() {
    let mut world = in_room();
    let mut planner = planner();
    let mut nodes = 1;
    for _ in 0..5 {
        let go = act(&mut world, &mut planner);
        let trees = planner.trees.as_ref().unwrap();
        assert!(trees.global.len() > nodes);
        nodes = trees.global.len();
        world.arrive(&go.motion);
    }
}

#[test]
fn without_destination_it_retries_and_lists_frontiers_once() {
    // No cell around is free, so no sample can be added; seven frontiers are in view.
    let mut world = World::known("?????????\n#.......#\n####?####\n####.####\n", flat(4, 0));
    world.show(&(1..8).map(|x| flat(x, 2)).collect::<Vec<_>>());
    let mut planner = planner();
    let first = act(&mut world, &mut planner);
    assert_eq!((&first.motion, first.info.as_str()), (&Motion::Keep, "exploration: no destination"));
    // Retrying is useless until the map changes.
    let wait = WakeCondition { at: world.observation.tick.after(10), events: EventMask::MESSAGE };
    assert_eq!(first.wake, wait);
    let listed = planner.frontiers.list.len();
    assert_eq!(listed, 7 + 2);
    world.wait(10);
    world.ask(&mut planner);
    assert_eq!(planner.frontiers.list.len(), listed);
    // A neighbouring cell, which the next stage finds.
    world.map.note_free(&[9 + 4]);
    let go = world.ask(&mut planner);
    assert!(matches!(go.motion, Motion::Path(_)), "{go:?}");
    assert!(!planner.is_trying_again);
}

#[test]
fn stages_that_lead_nowhere_follow_less_and_less_often() {
    let mut world = World::known(&format!("{}?\n", ".".repeat(40)), flat(2, 0));
    let mut planner = planner();
    let mut wait = |world: &mut World| planner.wake_after_stall(&world.ctx()).map(|wake| wake.at.0);
    // The first ones follow at once, as in the reference; the map has just become known.
    let waits: Vec<_> = (0..100).map(|_| wait(&mut world)).collect();
    let at_once = STALLS_MIN as usize;
    assert!(waits[..at_once].iter().all(Option::is_none), "{waits:?}");
    assert_eq!(waits[at_once..at_once + 4], [Some(1), Some(2), Some(4), Some(8)]);
    assert!(waits[70..].iter().all(|&wait| (1024..=STALL_TICKS_MAX).contains(&wait.unwrap_or_default())), "{waits:?}");
    world.map.note_wall(&[40]);
    assert!(wait(&mut world).is_some(), "that is beyond the horizon");
    world.map.note_covered(flat(3, 0));
    assert_eq!(wait(&mut world), None);
}

/// It set out for the frontier again and again from as near as it came to it.
#[test]
fn wide_body_approaches_a_frontier_once() {
    let body = BodyModel { kind: BodyKind::Aerial, radius_m: 1.2, ..BodyModel::SUBMARINE };
    let mut world = World::empty().with_body(body);
    let extent = world.map.extent();
    // A room with a hole in a wall, of whose end nothing is seen.
    for (index, cell) in (0..).zip(extent.cells()).filter(|&(_, cell)| cell != Cell::new(9, 4, 4)) {
        let is_inside =
            [cell.x, cell.y, cell.z].iter().all(|along| (1..8).contains(along)) || cell == Cell::new(8, 4, 4);
        if is_inside { world.map.note_free(&[index]) } else { world.map.note_wall(&[index]) }
    }
    world.show(&extent.cells().filter(|&cell| world.map.is_free(cell)).collect::<Vec<Cell>>());
    let mut planner = planner();
    for _ in 0..2000 {
        world.wait(1);
        let command = world.ask(&mut planner);
        if let Motion::Path(_) = command.motion {
            world.arrive(&command.motion);
        }
    }
    assert_eq!(world.said.last().map(String::as_str), Some(NOTHING_TO_SEE), "{} texts", world.said.len());
}
