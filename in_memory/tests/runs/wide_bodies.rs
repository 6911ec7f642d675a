//! Complete runs of bodies wider than a cell: they move, see all that can be seen from where they
//! can be, say so, and rest.

use crate::support::{fill, result, solid};
use msgs::counters::CounterName;
use msgs::maes_msgs::Result as RunResult;
use proptest::prelude::*;
use voxels::{Cell, CellSet, Clearance, Grid, Terrain};
use world::body::Pose;
use world::lidar::{Pattern, Scanner, SensorMemory};

/// Controllers that see all that can be seen, if no other agent is in the way.
const PLANNERS: [&str; 12] = [
    "nearest-frontier",
    "dsvp",
    "dsvp-auction",
    "dsvp-team",
    "hungarian",
    "rendezvous",
    "racer",
    "c2-explorer",
    "dsvp-maes3d",
    "lvd",
    "lvd-maes3d",
    "boustrophedon",
];

/// Controllers whose teams see all that can be seen, and then rest.
const TEAMS: [&str; 9] = [
    "nearest-frontier",
    "dsvp",
    "dsvp-auction",
    "dsvp-team",
    "hungarian",
    "rendezvous",
    "racer",
    "c2-explorer",
    "boustrophedon",
];

/// The share of the free cells that scans from the places of all cells that a body reaches see.
fn visible_share(terrain: &Grid<Terrain>, radius_m: f64, start: Cell, range_m: f64) -> f64 {
    let extent = terrain.extent();
    let clearance = Clearance::for_body(radius_m, terrain);
    let (room, lattice) = (clearance.room(radius_m / extent.cell_m()), clearance.lattice());
    let scanner = Scanner::new(Pattern::Lattice { rays: 5124 }, range_m, std::f64::consts::TAU);
    let mut memory = SensorMemory::new(terrain);
    let (mut free, mut walls) = (Vec::new(), Vec::new());
    let mut reached = CellSet::new(extent.volume());
    let mut next = vec![start];
    while let Some(cell) = next.pop() {
        let Some(index) = extent.index(cell).filter(|&index| room[index] == Terrain::Free && !reached.contains(index))
        else {
            continue;
        };
        reached.insert(index);
        scanner.scan(&mut memory, &Pose { position: lattice.place(extent, cell), yaw_rad: 0.0 }, &mut free, &mut walls);
        next.extend(cell.neighbours6());
    }
    free.len() as f64 / terrain.as_slice().iter().filter(|&&cell| cell == Terrain::Free).count() as f64
}

/// Rooms of a storey with doors, a low passage, and a table; 0.2 m cells.
fn office() -> Grid<Terrain> {
    let mut office = solid([40, 30, 12], 0.2);
    fill(&mut office, [1..39, 1..29, 1..11], Terrain::Free);
    fill(&mut office, [18..20, 1..29, 1..11], Terrain::Wall);
    fill(&mut office, [18..20, 12..17, 1..9], Terrain::Free);
    fill(&mut office, [20..39, 14..15, 1..11], Terrain::Wall);
    fill(&mut office, [30..34, 14..15, 1..9], Terrain::Free);
    fill(&mut office, [5..12, 20..26, 4..5], Terrain::Wall);
    fill(&mut office, [1..10, 9..10, 1..11], Terrain::Wall);
    office
}

const OFFICE: &str = "body = { kind = \"aerial\", radius_m = 0.3 }\nlidar = { range_m = 4.5 }\nduration_s = 600.0\n";

#[test]
fn all_of_an_office_that_can_be_seen_is_seen() {
    let office = office();
    let visible = visible_share(&office, 0.3, Cell::new(3, 3, 3), 4.5);
    for controller in TEAMS.into_iter().chain(["lvd"]) {
        let keys = format!("{OFFICE}agents = {{ count = 2, controller = \"{controller}\" }}\n");
        let result = result(&office, &keys);
        assert!(result.distance_m.iter().all(|&metres| metres > 1.0), "{controller}: {:?}", result.distance_m);
        // From elsewhere than the centres of cells a scan sees a little more or less.
        assert!(result.explored > visible - 0.001, "{controller}: {} of {visible}", result.explored);
        let failed = result.counter(CounterName::FailedSearches).unwrap_or(0);
        assert!(failed < 200, "{controller}: {failed} failed searches");
    }
}

/// The office with a room behind a passage of one cell that turns twice.
fn office_with_a_hidden_room() -> Grid<Terrain> {
    let mut office = office();
    fill(&mut office, [1..10, 1..7, 1..11], Terrain::Wall);
    fill(&mut office, [3..7, 2..5, 3..7], Terrain::Free);
    // Along x, up, and out along y.
    fill(&mut office, [7..8, 3..4, 4..8], Terrain::Free);
    fill(&mut office, [7..8, 3..7, 7..8], Terrain::Free);
    office
}

#[test]
fn runs_end_once_nothing_more_can_be_seen() {
    let office = office_with_a_hidden_room();
    for controller in TEAMS {
        let keys = format!("{OFFICE}agents = {{ count = 2, controller = \"{controller}\" }}\n");
        let result = result(&office, &keys);
        assert_eq!(result.reason, "nothing more can be seen", "{controller}: {}", result.explored);
        let attainable = result.counter(CounterName::AttainablePpm).unwrap_or(0) as f64 / 1e6;
        assert!((0.9..0.999).contains(&attainable), "{attainable}");
        assert!(result.explored > attainable - 1e-6, "{controller}: {} of {attainable}", result.explored);
    }
    // Whoever does not rest goes on: the others of the team may see what it finds.
    let keys = format!("{OFFICE}agents = {{ count = 2, controller = \"rbw\" }}\n").replace("600.0", "60.0");
    assert_eq!(result(&office, &keys).reason, "duration");
    let keys = format!("{OFFICE}stop_when_explored = false\nagents = {{ count = 2, controller = \"dsvp\" }}\n");
    assert_eq!(result(&office, &keys.replace("600.0", "120.0")).reason, "duration");
}

#[test]
fn coverage_and_walks_move_wide_bodies() {
    for controller in ["boustrophedon", "rbw", "rbw-maes3d"] {
        let keys = format!("{OFFICE}agents = {{ count = 2, controller = \"{controller}\" }}\n");
        let result = result(&office(), &keys.replace("600.0", "60.0"));
        assert!(result.distance_m.iter().all(|&metres| metres > 5.0), "{controller}: {:?}", result.distance_m);
    }
}

/// A hall in three parts with rows of columns between them, through which rays pass and bodies of
/// 0.8 m do not; cells of 0.5 m.
fn columns() -> Grid<Terrain> {
    let mut hall = solid([48, 25, 8], 0.5);
    fill(&mut hall, [1..47, 1..24, 1..7], Terrain::Free);
    for y in (1..24).step_by(2) {
        fill(&mut hall, [16..18, y..y + 1, 1..7], Terrain::Wall);
        fill(&mut hall, [30..32, y..y + 1, 1..7], Terrain::Wall);
    }
    hall
}

#[test]
fn what_is_behind_columns_is_seen_through_them() {
    let hall = columns();
    let visible = visible_share(&hall, 0.4, Cell::new(6, 6, 4), f64::INFINITY);
    for controller in ["nearest-frontier", "dsvp", "dsvp-auction", "dsvp-team", "lvd", "lvd-maes3d", "dsvp-maes3d"] {
        let keys = format!(
            "duration_s = 300.0\nbody = {{ radius_m = 0.4 }}\nagents = {{ count = 3, controller = \"{controller}\" }}\n\
             spawn = {{ kind = \"list\", poses = [[3.25, 3.25, 2.25], [3.25, 6.25, 2.25], [3.25, 9.25, 2.25]] }}\n"
        );
        let result = result(&hall, &keys);
        assert!(result.explored > (visible - 0.001).max(0.99), "{controller}: {} of {visible}", result.explored);
        let attainable = result.counter(CounterName::AttainablePpm).unwrap_or(0) as f64 / 1e6;
        assert!(result.explored < attainable + 1e-6, "{controller}: {} of {attainable}", result.explored);
        let failed = result.counter(CounterName::FailedSearches).unwrap_or(0);
        assert!(failed < 200, "{controller}: {failed} failed searches");
    }
}

#[test]
fn passages_into_the_border_are_explored() {
    // A cross of two passages that run into the border on all four sides.
    let mut cross = solid([46, 36, 6], 1.0);
    fill(&mut cross, [0..46, 15..21, 1..5], Terrain::Free);
    fill(&mut cross, [20..26, 0..36, 1..5], Terrain::Free);
    for controller in ["nearest-frontier", "dsvp-auction", "dsvp-team", "lvd"] {
        let keys = format!(
            "duration_s = 600.0\nlidar = {{ range_m = 6.0 }}\nagents = {{ count = 2, controller = \"{controller}\" }}\n"
        );
        let result = result(&cross, &keys);
        assert_eq!((result.explored, result.reason.as_str()), (1.0, "explored"), "{controller}");
    }
}

/// A room, a lane as wide as one body, and a hall behind it; cells of 1 m.
fn lane() -> Grid<Terrain> {
    let mut cave = solid([61, 30, 8], 1.0);
    fill(&mut cave, [1..14, 1..14, 1..7], Terrain::Free);
    fill(&mut cave, [14..33, 7..8, 3..4], Terrain::Free);
    fill(&mut cave, [33..60, 1..29, 1..7], Terrain::Free);
    cave
}

/// Three agents, of which the first breaks down in the lane.
fn in_the_lane(controller: &str, duration_s: f64, more: &str) -> RunResult {
    let keys = format!(
        "duration_s = {duration_s:?}\nagents = {{ count = 3, controller = \"{controller}\" }}\n\
         spawn = {{ kind = \"list\", poses = [[20.5, 7.5, 3.5], [4.5, 4.5, 3.5], [4.5, 10.5, 3.5]] }}\n\
         [[event]]\nat_s = 1.0\nkind = \"break_down\"\nagent = 0\n{more}"
    );
    result(&lane(), &keys)
}

#[test]
fn teams_rest_before_a_lane_that_is_blocked() {
    for controller in ["nearest-frontier", "dsvp", "dsvp-auction", "dsvp-team", "lvd"] {
        let metres = |duration_s| in_the_lane(controller, duration_s, "").distance_m.iter().sum::<f64>();
        let (first, later) = (metres(900.0), metres(1800.0));
        assert!(later < first + 10.0, "{controller}: {first} m in 900 s, {later} m in 1800 s");
    }
}

#[test]
fn teams_do_not_push_a_body_that_stays() {
    for controller in ["nearest-frontier", "boustrophedon", "dsvp", "dsvp-team", "lvd", "lvd-maes3d", "dsvp-maes3d"] {
        let result = in_the_lane(controller, 900.0, "");
        let collisions = result.counter(CounterName::Collisions).unwrap_or(0);
        assert!(collisions < 150, "{controller}: {collisions} collisions");
    }
}

#[test]
fn agents_that_sweep_a_lane_from_both_ends_get_past_each_other() {
    let mut rooms = solid([30, 5, 3], 1.0);
    fill(&mut rooms, [1..4, 1..4, 1..2], Terrain::Free);
    fill(&mut rooms, [4..25, 2..3, 1..2], Terrain::Free);
    fill(&mut rooms, [25..29, 1..4, 1..2], Terrain::Free);
    let keys = "duration_s = 600.0\nstop_when_covered = true\nagents = { count = 2, controller = \"boustrophedon\" }\n\
                spawn = { kind = \"list\", poses = [[26.5, 3.5, 1.5], [17.5, 2.5, 1.5]] }\n";
    let result = result(&rooms, keys);
    assert_eq!((result.covered, result.reason.as_str()), (1.0, "covered"));
}

#[test]
fn run_without_a_destination_takes_few_decisions() {
    // A lane of one cell, behind the bend of which `lvd-maes3d` sees nothing.
    let mut lane = solid([20, 9, 3], 1.0);
    fill(&mut lane, [1..19, 1..2, 1..2], Terrain::Free);
    fill(&mut lane, [18..19, 1..8, 1..2], Terrain::Free);
    let keys = "duration_s = 900.0\nagents = { count = 1, controller = \"lvd-maes3d\" }\n\
                spawn = { kind = \"list\", poses = [[9.5, 1.5, 1.5]] }\n";
    let decisions = result(&lane, keys).counter(CounterName::Decisions).unwrap_or(0);
    assert!((5..1000).contains(&decisions), "{decisions} decisions");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// Bodies of 0.1 to 0.6 m in cells of 0.1 to 1 m. The world itself asserts that none overlaps
    /// anything.
    #[test]
    fn no_planner_rests_while_something_can_be_seen(
        cell_m in 0.1..1.0_f64,
        radius_m in 0.1..0.6_f64,
        boxes in prop::collection::vec((0..30_i32, 0..20_i32, 0..10_i32, 1..8_i32, 1..8_i32, 1..6_i32), 0..14),
        controller in 0..PLANNERS.len(),
    ) {
        // Not more than four cells of radius: the maps are small.
        let radius_m = radius_m.min(4.0 * cell_m);
        let mut terrain = solid([34, 24, 14], cell_m);
        fill(&mut terrain, [1..33, 1..23, 1..13], Terrain::Free);
        for (x, y, z, dx, dy, dz) in boxes {
            let clip = |from: i32, by: i32, end: i32| from.max(1)..(from + by).min(end).max(from.max(1));
            fill(&mut terrain, [clip(x, dx, 33), clip(y, dy, 23), clip(z, dz, 13)], Terrain::Wall);
        }
        voxels::keep_largest_component(&mut terrain);
        let room = Clearance::for_body(radius_m, &terrain).room(radius_m / cell_m + 1e-6);
        let parts = voxels::free_components(&room);
        prop_assume!(parts.sizes.len() == 1 && radius_m > cell_m / 2.0);
        let start = terrain.extent().cell_at(parts.firsts[0]);
        let range_m = 12.0 * cell_m;
        let visible = visible_share(&terrain, radius_m + 1e-6, start, range_m);
        let keys = format!(
            "duration_s = 900.0\nbody = {{ kind = \"aerial\", radius_m = {radius_m:?} }}\nlidar = {{ range_m = {range_m:?} }}\n\
             agents = {{ count = 1, controller = \"{}\" }}\n", PLANNERS[controller]
        );
        let result = result(&terrain, &keys);
        prop_assert!(result.explored > visible - 0.003, "{}: {} of {visible}", PLANNERS[controller], result.explored);
    }
}
