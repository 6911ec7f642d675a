use std::collections::BTreeSet;
use std::task::Poll;

use msgs::ids::Tick;
use nalgebra::Point3;
use proptest::prelude::*;
use protocol::limits::PATH_POINTS_MAX;
use voxels::{BodyLattice, Cell, Extent};

use super::sweep::{clearance, place, touched};
use super::*;
use crate::exploration_map::{CellState, ExplorationMap};
use crate::testing::drawn;

mod ground;
mod room;
mod straight;

fn search(map: &ExplorationMap, neighbours: Neighbours, radius_m: f64, start: Cell, goal: Cell) -> Option<Path> {
    let moves = Moves::new(radius_m, map.extent().cell_m(), neighbours);
    find(Graph::new(map, &moves), start, Goal::Cell(goal))
}

fn flat(x: i32, y: i32) -> Cell {
    Cell::new(x, y, 0)
}

/// Centres of cells.
fn points(cells: &[Cell]) -> Vec<Point3<f64>> {
    cells.iter().map(|&cell| Point3::from(place(BodyLattice::Centres, cell))).collect()
}

/// Where a body of this radius is in a cell; all in cells.
fn at(radius: f64) -> impl Fn(Cell) -> [f64; 3] {
    move |cell| place(BodyLattice::of(radius, 1.0), cell)
}

#[test]
fn corridor_is_one_leg() {
    let map = drawn("#######\n#.....#\n#######\n");
    for neighbours in [Neighbours::Six, Neighbours::TwentySix] {
        let path = search(&map, neighbours, 0.5, flat(1, 1), flat(5, 1)).unwrap();
        assert_eq!(path.cells, (1..=5).map(|x| flat(x, 1)).collect::<Vec<_>>());
        assert_eq!(path.cost, 4 * EDGE_COST);
        assert_eq!(path.length_m(map.extent()), 4.0);
        assert_eq!(straighten(&path, &map, 0.5), points(&[flat(5, 1)]));
    }
}

#[test]
fn out_of_a_dead_end() {
    let map = drawn("..........\n.#######..\n.......#..\n.#######..\n..........\n");
    let path = search(&map, Neighbours::Six, 0.4, flat(6, 2), flat(8, 2)).unwrap();
    assert_eq!(path.cost, 18 * EDGE_COST);
    let legs = straighten(&path, &map, 0.4);
    assert_eq!(legs, points(&[flat(0, 2), flat(0, 0), flat(8, 0), flat(8, 2)]));
    let shut = drawn("..........\n########..\n.......#..\n########..\n..........\n");
    assert_eq!(search(&shut, Neighbours::TwentySix, 0.4, flat(6, 2), flat(8, 2)), None);
}

#[test]
fn t_junction_turns_once() {
    let map = drawn(".......\n###.###\n###.###\n");
    let path = search(&map, Neighbours::TwentySix, 0.4, flat(3, 0), flat(6, 2)).unwrap();
    assert_eq!(path.cost, 5 * EDGE_COST);
    assert_eq!(straighten(&path, &map, 0.4), points(&[flat(3, 2), flat(6, 2)]));
}

#[test]
fn two_rooms_and_a_door() {
    let rooms = "....#....\n....#....\n.........\n....#....\n....#....\n";
    let map = drawn(rooms);
    let path = search(&map, Neighbours::TwentySix, 0.4, flat(0, 0), flat(8, 4)).unwrap();
    assert!(path.cells.contains(&flat(4, 2)));
    assert_eq!(path.cost, 8 * EDGE_COST + 4 * 414_214);
    // A body wider than the door does not get through; neither does any body while the door is
    // unexplored.
    assert_eq!(search(&map, Neighbours::TwentySix, 0.6, flat(1, 1), flat(7, 3)), None);
    let door = drawn(&rooms.replace(".........", "....?...."));
    assert_eq!(search(&door, Neighbours::TwentySix, 0.4, flat(0, 0), flat(8, 4)), None);
    assert!(search(&door, Neighbours::TwentySix, 0.4, flat(0, 0), flat(3, 4)).is_some());
}

#[test]
fn wide_body_fits_through_a_wide_door() {
    let (wall, door) = ("........#........\n", ".................\n");
    let slab = [wall, wall, door, door, door, wall].concat();
    let map = drawn(&[slab.as_str(); 3].join("\n"));
    for (radius_m, fits) in [(1.0, true), (1.5, true), (1.6, false)] {
        let (start, goal) = (Cell::new(2, 3, 1), Cell::new(14, 2, 1));
        let path = search(&map, Neighbours::TwentySix, radius_m, start, goal);
        assert_eq!(path.is_some(), fits, "{radius_m}");
    }
}

#[test]
fn into_a_pit_and_out() {
    let map = drawn("#####\n##.##\n#####\n\n#####\n##.##\n#####\n\n.....\n.....\n.....\n");
    let (bottom, edge) = (Cell::new(2, 1, 0), Cell::new(0, 1, 2));
    let path = search(&map, Neighbours::TwentySix, 0.4, bottom, edge).unwrap();
    assert_eq!(path.cost, 4 * EDGE_COST);
    assert_eq!(straighten(&path, &map, 0.4), points(&[Cell::new(2, 1, 2), edge]));
    let down = search(&map, Neighbours::Six, 0.4, edge, bottom).unwrap();
    assert_eq!(down.cost, path.cost);
}

#[test]
fn corners_are_not_cut() {
    for other in ["#", "?"] {
        let map = drawn(&".o\n..\n".replace('o', other));
        let path = search(&map, Neighbours::TwentySix, 0.0, flat(0, 1), flat(1, 0)).unwrap();
        assert_eq!(path.cells, [flat(0, 1), flat(0, 0), flat(1, 0)]);
        assert_eq!(straighten(&path, &map, 0.0).len(), 2);
    }
    let open = drawn("..\n..\n");
    let path = search(&open, Neighbours::TwentySix, 0.4, flat(0, 1), flat(1, 0)).unwrap();
    assert_eq!(path.cost, 1_414_214);
}

#[test]
fn covered_cells_are_free() {
    let mut map = drawn("...\n");
    map.note_covered(flat(1, 0));
    assert!(search(&map, Neighbours::Six, 0.4, flat(0, 0), flat(2, 0)).is_some());
}

#[test]
fn start_need_not_be_usable_and_goals_must() {
    let map = drawn("#..?\n");
    for neighbours in [Neighbours::Six, Neighbours::TwentySix] {
        for (start, goal) in [(0, 2), (3, 1)] {
            let path = search(&map, neighbours, 0.4, flat(start, 0), flat(goal, 0)).unwrap();
            assert_eq!(path.cost, 2 * EDGE_COST);
        }
        for goal in [-1, 0, 3, 4] {
            assert_eq!(search(&map, neighbours, 0.4, flat(1, 0), flat(goal, 0)), None);
        }
        assert_eq!(search(&map, neighbours, 0.4, flat(-1, 0), flat(1, 0)), None);
        let stay = search(&map, neighbours, 0.4, flat(0, 0), flat(0, 0)).unwrap();
        assert_eq!((stay.cells, stay.cost), (vec![flat(0, 0)], 0));
        assert_eq!(search(&map, neighbours, f64::NAN, flat(1, 0), flat(2, 0)), None);
    }
}

#[test]
fn unusable_goal_costs_no_expansions() {
    let map = drawn("..#\n");
    let moves = Moves::new(0.4, 1.0, Neighbours::Six);
    let mut search = Search::new(Graph::new(&map, &moves), flat(0, 0), Goal::Cell(flat(2, 0)));
    assert_eq!(search.step(0), Progress::NoPath);
    assert_eq!(search.expansions(), 0);
}

#[test]
fn nearest_of_several_goals() {
    let map = drawn("...#...\n.......\n...#...\n");
    let moves = Moves::new(0.4, 1.0, Neighbours::Six);
    let graph = Graph::new(&map, &moves);
    let start = flat(2, 1);
    let goals = [flat(6, 1), flat(0, 0), flat(3, 0), flat(0, 0), flat(0, 2)];
    let costs = [Some(4), Some(3), None, Some(3), Some(3)].map(|cost| cost.map(|cost: u64| cost * EDGE_COST));
    assert_eq!(distances(graph, start, &goals), costs);
    let nearest = find(graph, start, Goal::AnyOf(&goals)).unwrap();
    assert_eq!(nearest.cells.last(), Some(&flat(0, 0)));
    assert_eq!(find(graph, start, Goal::Where(&|cell| goals.contains(&cell))), Some(nearest));
    assert_eq!(find(graph, start, Goal::AnyOf(&[])), None);
    assert_eq!(find(graph, start, Goal::Where(&|_| false)), None);
    assert_eq!(distances(graph, flat(9, 9), &goals), [None; 5]);
    assert_eq!(distances(graph, start, &[]), []);
}

/// Two bands of narrow columns, joined at alternate ends.
fn comb(columns: i32) -> ExplorationMap {
    let extent = Extent::new([2 * columns as u32 - 1, 7, 1], 1.0).unwrap();
    let mut map = ExplorationMap::new(extent);
    let mut free = |cell| map.note_free(&[extent.index(cell).unwrap() as u32]);
    for low in [0, 4] {
        for column in 0..columns {
            (low..low + 3).for_each(|y| free(flat(2 * column, y)));
            if column + 1 < columns {
                free(flat(2 * column + 1, if column % 2 == 0 { low } else { low + 2 }));
            }
        }
    }
    free(flat(2 * columns - 2, 3));
    map
}

#[test]
fn search_is_limited_in_cells_and_expansions() {
    let map = drawn(".......\n.#####.\n.......\n");
    let moves = Moves::new(0.4, 1.0, Neighbours::Six);
    let search = |is_open: &dyn Fn(Cell) -> bool, expansions_max| {
        let search = Search::new(Graph::new(&map, &moves), flat(0, 0), Goal::Cell(flat(6, 0)));
        search.within(is_open).at_most(expansions_max).run().map(|path| path.cost / EDGE_COST)
    };
    assert_eq!(search(&|_| true, 7), Some(6));
    assert_eq!(search(&|_| true, 6), None, "the goal is the seventh cell");
    assert_eq!(search(&|cell| cell != flat(3, 0), 99), Some(10), "the other way round");
    assert_eq!(search(&|cell| cell.x != 3, 99), None);
    assert_eq!(search(&|cell| cell != flat(0, 0), 99), Some(6), "it starts there, whatever is said of it");
}

#[test]
fn budget_sets_the_tick_of_the_result() {
    let map = comb(50);
    let moves = Moves::new(0.4, 1.0, Neighbours::Six);
    let graph = Graph::new(&map, &moves);
    let instant = find(graph, flat(0, 2), Goal::Cell(flat(0, 6)));
    let ask = |per_tick| {
        let search = Search::new(graph, flat(0, 2), Goal::Cell(flat(0, 6)));
        Budgeted::new(search, Tick(1000), per_tick)
    };
    // Every cell is expanded, as the goal is the farthest one: 2 bands of 50 columns and 49 joints,
    // and the joint of the bands.
    let slow = ask(std::num::NonZeroU64::MIN);
    assert_eq!(slow.usable_at(), Tick(1399));
    assert_eq!(slow.poll(Tick(1398)), Poll::Pending);
    assert_eq!(slow.poll(Tick(1399)), Poll::Ready(instant.as_ref()));
    assert_eq!(ask(Budgeted::PER_TICK).usable_at(), Tick(1004));
    let unusable = Search::new(graph, flat(0, 2), Goal::Cell(flat(1, 1)));
    assert_eq!(Budgeted::new(unusable, Tick(7), Budgeted::PER_TICK).poll(Tick(7)), Poll::Ready(None));
}

#[test]
fn background_search_uses_the_map_at_the_request() {
    let mut map = comb(100);
    let moves = Moves::new(0.4, 1.0, Neighbours::TwentySix);
    let instant = find(Graph::new(&map, &moves), flat(0, 2), Goal::Cell(flat(0, 6)));
    let ask = |map: &ExplorationMap, goals| Background::start(map, &moves, flat(0, 2), goals, u64::MAX, Tick(10));
    let mut search = ask(&map, vec![flat(0, 6)]);
    let mut none = ask(&map, vec![flat(1, 1)]);
    let dropped = ask(&map, vec![flat(0, 6)]);
    // A short cut that is revealed later.
    map.note_free(&[map.extent().index(flat(0, 3)).unwrap() as u32]);
    assert_eq!(search.usable_at(), Tick(10));
    assert_eq!(search.poll(Tick(9)), Poll::Pending);
    assert_eq!(search.poll(Tick(10)), Poll::Ready(instant.as_ref()));
    assert_eq!(search.poll(Tick(12)), Poll::Ready(instant.as_ref()));
    assert_eq!(none.poll(Tick(11)), Poll::Ready(None));
    drop(dropped);
}

/// A small random map: free, wall or unexplored, with a smaller or a larger share of free cells.
fn any_map() -> impl Strategy<Value = ExplorationMap> {
    let size = (1u32..=6, 1u32..=6, 1u32..=5);
    (size, prop::sample::select(vec![0.1, 1.0, 2.5]), prop::sample::select(vec![6, 60])).prop_flat_map(
        |((x, y, z), cell_m, free)| {
            let cell = prop_oneof![
                free => Just(CellState::Free),
                1 => Just(CellState::Wall),
                1 => Just(CellState::Unexplored),
            ];
            let extent = Extent::new([x, y, z], cell_m).unwrap();
            prop::collection::vec(cell, extent.volume()).prop_map(move |states| {
                let mut map = ExplorationMap::new(extent);
                for (index, state) in (0..).zip(states) {
                    match state {
                        CellState::Free | CellState::Covered => map.note_free(&[index]),
                        CellState::Wall => map.note_wall(&[index]),
                        CellState::Unexplored => {}
                    }
                }
                map
            })
        },
    )
}

/// A map, two of its cells, the radius of a body in cells, and its connectivity.
fn any_question() -> impl Strategy<Value = (ExplorationMap, Cell, Cell, f64, Neighbours)> {
    let radius = prop::sample::select(vec![0.0, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5]);
    let neighbours = prop::sample::select(vec![Neighbours::Six, Neighbours::TwentySix]);
    (any_map(), any::<prop::sample::Index>(), any::<prop::sample::Index>(), radius, neighbours).prop_map(
        |(map, start, goal, radius, neighbours)| {
            let cell = |index: prop::sample::Index| map.extent().cell_at(index.index(map.extent().volume()));
            let (start, goal) = (cell(start), cell(goal));
            (map, start, goal, radius, neighbours)
        },
    )
}

fn is_known_free(map: &ExplorationMap, cell: Cell) -> bool {
    map.state(cell).is_free()
}

/// Costs from a start to all cells by relaxing every pair of cells until nothing changes.
fn relaxed(map: &ExplorationMap, start: Cell, radius: f64, neighbours: Neighbours) -> Vec<Option<u64>> {
    let cells: Vec<Cell> = map.extent().cells().collect();
    let (at, radius) = (at(radius), clearance(radius, 1.0).unwrap());
    let sphere = |cell| touched(at(cell), at(cell), radius);
    let usable = |cell| sphere(cell).into_iter().all(|near| is_known_free(map, near));
    let at_start: BTreeSet<Cell> = sphere(start).into_iter().collect();
    let mut edges = Vec::new();
    for (a, &from) in cells.iter().enumerate() {
        for (b, &to) in cells.iter().enumerate() {
            let mut apart = [from.x - to.x, from.y - to.y, from.z - to.z].map(i32::abs);
            apart.sort_unstable();
            let cost = match (apart, neighbours) {
                ([0, 0, 1], _) => EDGE_COST,
                ([0, 1, 1], Neighbours::TwentySix) => 1_414_214,
                ([1, 1, 1], Neighbours::TwentySix) => 1_732_051,
                _ => continue,
            };
            let is_clear = touched(at(from), at(to), radius)
                .into_iter()
                .all(|near| is_known_free(map, near) || (from == start && at_start.contains(&near)));
            if is_clear && usable(to) && (from == start || usable(from)) {
                edges.push((a, b, cost));
            }
        }
    }
    let mut costs = vec![None; cells.len()];
    costs[map.extent().index(start).unwrap()] = Some(0);
    loop {
        let mut is_done = true;
        for &(a, b, cost) in &edges {
            if let Some(so_far) = costs[a]
                && costs[b].is_none_or(|known| so_far + cost < known)
            {
                costs[b] = Some(so_far + cost);
                is_done = false;
            }
        }
        if is_done {
            return costs;
        }
    }
}

/// Whether a sphere on a leg keeps clear of all cells not known to be free, by testing many points
/// of it (in cells).
fn keeps_clear(map: &ExplorationMap, from: [f64; 3], to: [f64; 3], radius: f64) -> bool {
    let [x, y, z] = map.extent().size().map(|cells| cells as i32);
    let mut obstacles = Vec::new();
    for cell in (-1..=z).flat_map(|k| (-1..=y).flat_map(move |j| (-1..=x).map(move |i| Cell::new(i, j, k)))) {
        if !is_known_free(map, cell) {
            obstacles.push([cell.x, cell.y, cell.z].map(f64::from));
        }
    }
    (0..=200).map(|i| f64::from(i) / 200.0).all(|time| {
        let at = [0, 1, 2].map(|axis| from[axis] + (to[axis] - from[axis]) * time);
        obstacles.iter().all(|low| {
            let apart = |axis: usize| at[axis] - at[axis].clamp(low[axis], low[axis] + 1.0);
            let squared: f64 = (0..3).map(|axis| apart(axis) * apart(axis)).sum();
            squared.sqrt() >= radius - 1e-9
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn paths_are_cheapest((map, start, goal, radius, neighbours) in any_question()) {
        let extent = map.extent();
        let expected = relaxed(&map, start, radius, neighbours);
        let path = search(&map, neighbours, radius * extent.cell_m(), start, goal);
        prop_assert_eq!(path.map(|path| path.cost), expected[extent.index(goal).unwrap()]);

        let moves = Moves::new(radius * extent.cell_m(), extent.cell_m(), neighbours);
        let graph = Graph::new(&map, &moves);
        let all: Vec<Cell> = extent.cells().collect();
        prop_assert_eq!(&distances(graph, start, &all), &expected);
        let few: Vec<Cell> = all.iter().copied().filter(|cell| (cell.x + cell.y) % 3 == 2).collect();
        let nearest = few.iter().filter_map(|&cell| Some((expected[extent.index(cell)?]?, cell))).min();
        let found = find(graph, start, Goal::AnyOf(&few));
        prop_assert_eq!(found.map(|path| (path.cost, *path.cells.last().unwrap())), nearest);
    }

    #[test]
    fn paths_are_connected_and_clear((map, start, goal, radius, neighbours) in any_question()) {
        let Some(path) = search(&map, neighbours, radius * map.extent().cell_m(), start, goal) else {
            return Ok(());
        };
        prop_assert_eq!((path.cells[0], *path.cells.last().unwrap()), (start, goal));
        let mut cost = 0;
        for (place, pair) in path.cells.windows(2).enumerate() {
            let by = [pair[1].x - pair[0].x, pair[1].y - pair[0].y, pair[1].z - pair[0].z].map(i32::abs);
            prop_assert!(by.iter().all(|&along| along <= 1));
            cost += [0, EDGE_COST, 1_414_214, 1_732_051][by.iter().sum::<i32>() as usize];
            prop_assert!(neighbours == Neighbours::TwentySix || by.iter().sum::<i32>() == 1);
            prop_assert!(is_known_free(&map, pair[1]));
            prop_assert!(place == 0 || keeps_clear(&map, at(radius)(pair[0]), at(radius)(pair[1]), radius));
        }
        prop_assert_eq!(cost, path.cost);
    }

    #[test]
    fn slicing_does_not_change_the_result((map, start, goal, radius, neighbours) in any_question(), step in 1u64..20) {
        let cell_m = map.extent().cell_m();
        let moves = Moves::new(radius * cell_m, cell_m, neighbours);
        let graph = Graph::new(&map, &moves);
        // Other searches use the scratch memory of this thread before and meanwhile.
        let other = || find(graph, goal, Goal::Where(&|_| false));
        let _ = other();
        let whole = find(graph, start, Goal::Cell(goal));
        let mut search = Search::new(graph, start, Goal::Cell(goal));
        let mut pieces = 0;
        let found = loop {
            let before = search.expansions();
            pieces += 1;
            let _ = other();
            match search.step(step) {
                Progress::Searching => prop_assert_eq!(search.expansions(), before + step),
                Progress::Found(path) => break Some(path),
                Progress::NoPath => break None,
            }
        };
        prop_assert_eq!(&found, &whole);
        prop_assert!(pieces <= search.expansions() / step + 1);
        prop_assert_eq!(search.run(), whole);
    }

    #[test]
    fn heuristic_is_exact_in_free_space(
        size in prop::array::uniform3(1u32..7), index in any::<prop::sample::Index>(),
    ) {
        let extent = Extent::new(size, 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        map.note_free(&(0..extent.volume() as u32).collect::<Vec<_>>());
        let start = extent.cell_at(index.index(extent.volume()));
        for neighbours in [Neighbours::Six, Neighbours::TwentySix] {
            let moves = Moves::new(0.4, 1.0, neighbours);
            let costs = relaxed(&map, start, 0.4, neighbours);
            for (cell, cost) in extent.cells().zip(costs) {
                prop_assert_eq!(Some(u64::from(moves.estimate(start, cell))), cost);
            }
        }
    }
}
