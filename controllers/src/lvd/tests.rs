use msgs::ids::AgentId;
use nalgebra::Point3;

use super::*;
use crate::testing::World;
use agent::observation::{Cells, Contact};

const CORRIDOR: &str =
    "##############################\n#............................#\n##############################\n";

const TEE: &str = "\
###################
#.................#
#########.#########
#########.#########
#########.#########
#########.#########
###################
";

const ROOMS: &str = "\
#####################
#.........#.........#
#.........#.........#
#.........#.........#
#...................#
#.........#.........#
#.........#.........#
#.........#.........#
#####################
";

/// A maze of lanes one cell wide.
const MAZE: &str = "\
###############################
#.....#.........#...#.......#.#
#####.###.###.###.#.#.###.#.#.#
#...#...#...#.#...#...#.#.#.#.#
###.###.#.#.###.#######.#.#.#.#
#...#...#.#.........#...#.#...#
#.#.#.###.#########.#.###.#####
#.#.#.#.......#...#...#...#...#
#.###.#######.#.#.###.#.###.#.#
#.....#...#...#.#...#.#.....#.#
#.#####.#.#####.###.#####.###.#
#.#.....#.......#.#.#...#.#...#
#.###.###########.#.#.#.###.#.#
#...#.#.#...#.....#...#.#...#.#
###.#.#.#.#.#.#.#######.#.###.#
#.....#...#...#...........#...#
###############################
";

/// A floor with a shaft of nine cells in its middle.
fn pit() -> String {
    let rock = "#########\n".repeat(9);
    let shaft = format!("{}####.####\n{}", "#########\n".repeat(4), "#########\n".repeat(4));
    let hall = format!("#########\n{}#########\n", "#.......#\n".repeat(7));
    [rock.clone(), vec![shaft; 9].join("\n"), vec![hall; 2].join("\n"), rock].join("\n")
}

fn lvd(settings: &[&str]) -> Lvd {
    let texts: Vec<String> = settings.iter().map(ToString::to_string).collect();
    Lvd::new(&mut Settings::parse(&texts).unwrap(), 1.0, voxels::random_streams::stream(1, 0, "test")).unwrap()
}

/// Asserts that it visits everything, and then waits.
fn visits_all(drawing: &str, start: Cell, settings: &[&str]) -> World {
    let mut world = World::new(drawing, start);
    world.run(&mut lvd(settings), 3000);
    assert_eq!(world.left(&[CellState::Covered]), [], "{settings:?}");
    assert_eq!(world.said.last().unwrap(), "nothing left to do, waiting for news", "{settings:?}");
    world
}

#[test]
fn visits_small_worlds_completely() {
    for settings in [
        &[][..],
        &["leg_max_m=0", "near_m=0"],
        &["search_time=budgeted", "search_cells_per_tick=3"],
        &["search_time=background", "search_ticks=7", "visit_radius_m=1"],
    ] {
        visits_all(CORRIDOR, Cell::new(3, 1, 0), settings);
        visits_all(TEE, Cell::new(9, 1, 0), settings);
        visits_all(ROOMS, Cell::new(2, 2, 0), settings);
        visits_all(&pit(), Cell::new(2, 2, 11), settings);
    }
}

#[test]
fn maze_of_narrow_lanes_is_visited_completely() {
    visits_all(MAZE, Cell::new(1, 1, 0), &[]);
    visits_all(MAZE, Cell::new(15, 9, 0), &["visits_max=1"]);
}

#[test]
fn dead_end_behind_a_corner_is_explored() {
    let drawing = "##########\n#........#\n########.#\n########.#\n########.#\n########.#\n##########\n";
    let world = visits_all(drawing, Cell::new(1, 5, 0), &["visit_radius_m=2"]);
    assert!(world.said.iter().any(|said| said.contains("exploring")), "{:?}", world.said);
}

#[test]
fn decides_only_when_necessary() {
    let world = visits_all(CORRIDOR, Cell::new(1, 1, 0), &[]);
    // One decision for each new cell, some to choose, and one every five seconds at the end.
    assert!(world.decisions < 27 + 20 + 3000 / 250, "{}", world.decisions);
}

#[test]
fn leg_continues_through_unvisited_cells() {
    let mut world = World::new(CORRIDOR, Cell::new(1, 1, 0));
    let mut near = lvd(&["leg_max_m=0"]);
    world.run(&mut near, 2);
    assert_eq!(world.said, ["destination (5.50, 1.50, 0.50), exploring"]);
    let mut world = World::new(CORRIDOR, Cell::new(1, 1, 0));
    world.run(&mut lvd(&["leg_max_m=10"]), 2);
    assert_eq!(world.said, ["destination (11.50, 1.50, 0.50), exploring"]);
}

#[test]
fn compass_breaks_ties_by_order() {
    let mut world = World::new(CORRIDOR, Cell::new(14, 1, 0));
    world.run(&mut lvd(&["leg_max_m=0", "near_m=0"]), 2);
    // West comes before east.
    assert_eq!(world.said, ["destination (10.50, 1.50, 0.50), exploring"]);
}

#[test]
fn cells_nearer_to_another_agent_are_left_to_it() {
    let mut world = World::new(CORRIDOR, Cell::new(14, 1, 0));
    world.observation.contacts = vec![Contact { agent: AgentId(0), position: Point3::new(10.5, 1.5, 0.5) }];
    world.run(&mut lvd(&["leg_max_m=0", "near_m=0"]), 2);
    assert_eq!(world.said, ["destination (18.50, 1.50, 0.50), exploring"]);
}

#[test]
fn goes_to_the_boundary_when_its_region_is_done() {
    let mut world = World::new(CORRIDOR, Cell::new(1, 1, 0));
    world.observation.contacts = vec![Contact { agent: AgentId(0), position: Point3::new(9.5, 1.5, 0.5) }];
    world.run(&mut lvd(&["visit_radius_m=5"]), 2);
    assert_eq!(world.said, ["destination (4.50, 1.50, 0.50), search mode: to the boundary of the region"]);
}

#[test]
fn unvisited_cell_in_sight_ends_search_mode() {
    let mut world = World::new(ROOMS, Cell::new(2, 2, 0));
    let mut lvd = lvd(&["visit_radius_m=24"]);
    world.run(&mut lvd, 3000);
    let searched = world.said.iter().position(|said| said.contains("search mode"));
    let explored = world.said.iter().rposition(|said| said.contains("exploring"));
    assert!(searched.is_some() && searched < explored, "{:?}", world.said);
    assert_eq!(world.left(&[CellState::Covered]), []);
}

#[test]
fn mutual_blockage_is_resolved() {
    let wide = "##############\n#............#\n#............#\n##############\n";
    let mut world = World::new(wide, Cell::new(1, 1, 0));
    // It blocks the corridor without claiming a region: no cell is nearer to it.
    world.observation.contacts = vec![Contact { agent: AgentId(2), position: Point3::new(6.5, 1.5, 0.5) }];
    let mut lvd = lvd(&["leg_max_m=0"]);
    world.run(&mut lvd, 20_000);
    assert!(world.been.iter().any(|cell| cell.x > 8), "{:?}", world.been);
    assert!(world.collisions < 50, "{}", world.collisions);
}

#[test]
fn settings_are_checked() {
    for text in ["visit_radius_m=-1", "visits_max=0", "search_time=soon", "search_ticks=0", "merge_m=x"] {
        let mut settings = Settings::parse(&[text.to_owned()]).unwrap();
        assert!(Lvd::new(&mut settings, 1.0, voxels::random_streams::stream(1, 0, "test")).is_err(), "{text}");
    }
}

#[test]
fn distant_destination_is_reached_in_stages() {
    let wide = 150;
    let drawing = format!("{0}\n#{1}#\n{0}\n", "#".repeat(wide + 2), ".".repeat(wide));
    let mut world = World::known(&drawing, Cell::new(1, 1, 0));
    for cell in world.left(&[]).into_iter().filter(|cell| cell.x != 150) {
        world.map.note_covered(cell);
    }
    world.observation.scan_tick = Some(Tick::ZERO);
    world.observation.view = Some(Cells::default());
    let mut lvd = lvd(&[]);
    world.ask(&mut lvd);
    assert_eq!(world.said, ["destination (49.50, 1.50, 0.50), search mode: back to what is unvisited"]);
    world.run(&mut lvd, 1000);
    assert_eq!(world.left(&[CellState::Covered]), []);
}
