use std::collections::BTreeMap;

use proptest::prelude::*;
use voxels::{Grid, Terrain};

use super::*;
use crate::path::{Goal, Moves, Neighbours, Search};

const RADIUS_M: f64 = 0.4;

fn moves() -> Moves {
    Moves::new(RADIUS_M, 1.0, Neighbours::TwentySix)
}

/// Reveals a world to a map, except the cells that `is_hidden`.
fn reveal(map: &mut ExplorationMap, world: &Grid<Terrain>, is_hidden: impl Fn(Cell) -> bool) {
    let extent = world.extent();
    for cell in extent.cells().filter(|&cell| !is_hidden(cell)) {
        let index = [extent.index(cell).unwrap() as u32];
        match world.get(cell) {
            Some(Terrain::Free) => map.note_free(&index),
            _ => map.note_wall(&index),
        }
    }
}

/// Runs Dijkstra's algorithm from a cell: the path length to every reachable region, cells.
fn lengths(paths: &mut ShortestPaths, graph: &AbstractGraph, from: Cell) -> BTreeMap<RegionId, f64> {
    paths.begin(graph, from);
    std::iter::from_fn(|| paths.next(graph)).map(|(id, _, length)| (id, length)).collect()
}

/// Two rooms, joined by a door at the far side.
const ROOMS: &str = "
#############
#.....#.....#
#.....#.....#
#...........#
#.....#.....#
#.....#.....#
#.....#.....#
#.....#.....#
#############";

fn rooms() -> Grid<Terrain> {
    Grid::from_text(ROOMS.trim_start()).unwrap()
}

#[test]
fn path_to_the_next_room_leads_through_the_door() {
    let world = rooms();
    let mut map = ExplorationMap::new(world.extent());
    reveal(&mut map, &world, |_| false);
    let mut graph = AbstractGraph::new(map.extent(), RADIUS_M);
    graph.update(Graph::new(&map, &moves()));
    let (from, to) = (Cell::new(1, 1, 0), Cell::new(11, 1, 0));
    let mut paths = ShortestPaths::default();
    let length = lengths(&mut paths, &graph, from)[&graph.region_of(to).unwrap()];
    assert!((11.0..18.0).contains(&length), "{length}");
    let path = paths.path(&graph, Graph::new(&map, &moves()), (from, to), &|_| false).unwrap();
    assert!(path.cells.contains(&Cell::new(6, 5, 0)), "{path:?}");
    let shut = |cell| cell == Cell::new(6, 5, 0);
    assert_eq!(paths.path(&graph, Graph::new(&map, &moves()), (from, to), &shut), None);
}

#[test]
fn unreachable_regions_are_not_visited() {
    let world = rooms();
    let mut map = ExplorationMap::new(world.extent());
    reveal(&mut map, &world, |cell| cell.x == 6);
    let mut graph = AbstractGraph::new(map.extent(), RADIUS_M);
    graph.update(Graph::new(&map, &moves()));
    let reached = lengths(&mut ShortestPaths::default(), &graph, Cell::new(1, 1, 0));
    let frontiers: usize = reached.keys().map(|&region| graph.get(region).unwrap().frontiers.len()).sum();
    assert_eq!((frontiers, map.frontier_count()), (7, 14));
    assert!(graph.region_of(Cell::new(11, 1, 0)).is_some_and(|far| !reached.contains_key(&far)));
}

#[test]
fn repair_visits_what_is_near_the_change() {
    // A corridor of 100 blocks that grows at its end.
    let extent = Extent::new([500, 3, 3], 1.0).unwrap();
    let mut map = ExplorationMap::new(extent);
    let cell = |x: i32| extent.index(Cell::new(x, 1, 1)).unwrap() as u32;
    map.note_free(&(0..450).map(cell).collect::<Vec<u32>>());
    let mut graph = AbstractGraph::new(extent, RADIUS_M);
    let mut kept = PathLengths::default();
    let far = |graph: &AbstractGraph, x: i32| graph.region_of(Cell::new(x, 1, 1)).unwrap();
    let mut visited = |graph: &AbstractGraph, x: i32| {
        let before = kept.visited();
        kept.renew(graph);
        kept.begin(graph, Cell::new(2, 1, 1), [far(graph, x), far(graph, 449)]);
        assert_eq!(kept.to(graph, far(graph, x)), Some(f64::from(x - 2)));
        kept.visited() - before
    };
    graph.update(Graph::new(&map, &moves()));
    assert!((80..300).contains(&visited(&graph, 447)));
    for x in (452..500).step_by(5) {
        map.note_free(&(x - 2..x + 3).map(cell).collect::<Vec<u32>>());
        graph.update(Graph::new(&map, &moves()));
        let count = visited(&graph, x);
        assert!(count < 20, "{count} at {x}");
    }
}

fn noise() -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(0u8..4, 11 * 9 * 8)
}

fn apply(map: &mut ExplorationMap, cells: &[u8], part: std::ops::Range<usize>) {
    for at in part {
        match cells[at] {
            0 | 1 => map.note_free(&[at as u32]),
            2 => map.note_wall(&[at as u32]),
            _ => {}
        }
    }
}

proptest! {
    #[test]
    fn incremental_updates_equal_one_update(
        cells in noise(), cut in 0usize..792, radius in prop::sample::select(vec![0.4, 0.9]),
    ) {
        let extent = Extent::new([11, 9, 8], 1.0).unwrap();
        let moves = Moves::new(radius, 1.0, Neighbours::TwentySix);
        let mut map = ExplorationMap::new(extent);
        let mut by_bits = AbstractGraph::new(extent, radius);
        apply(&mut map, &cells, 0..cut);
        by_bits.update(Graph::new(&map, &moves));
        apply(&mut map, &cells, cut..cells.len());
        by_bits.update(Graph::new(&map, &moves));
        let mut at_once = AbstractGraph::new(extent, radius);
        at_once.update(Graph::new(&map, &moves));
        for cell in extent.cells() {
            prop_assert_eq!(by_bits.region_of(cell), at_once.region_of(cell));
            prop_assert_eq!(by_bits.region_of(cell).is_some(), Graph::new(&map, &moves).is_usable(cell));
        }
        for (a, b) in by_bits.near(Cell::default(), 20).zip(at_once.near(Cell::default(), 20)) {
            prop_assert_eq!(a.0, b.0);
            let edges =
                |region: &Region| -> Vec<_> { region.edges.iter().map(|edge| (edge.to, edge.length)).collect() };
            prop_assert_eq!(edges(a.1), edges(b.1));
            prop_assert_eq!((&a.1.frontiers, a.1.centre), (&b.1.frontiers, b.1.centre));
        }
        let listed: usize = at_once.near(Cell::default(), 20).map(|(_, region)| region.frontiers.len()).sum();
        let has_frontiers = |(_, region): &(RegionId, &Region)| !region.frontiers.is_empty();
        let with_frontiers = at_once.near(Cell::default(), 20).filter(has_frontiers).count();
        prop_assert_eq!(at_once.regions_with_frontiers(), with_frontiers);
        prop_assert_eq!(by_bits.regions_with_frontiers(), with_frontiers);
        if radius < 0.5 {
            prop_assert_eq!(listed, map.frontier_count());
        }
    }

    #[test]
    fn path_lengths_are_those_of_the_shortest_paths(cells in noise(), radius in prop::sample::select(vec![0.4, 0.9])) {
        let extent = Extent::new([11, 9, 8], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        apply(&mut map, &cells, 0..cells.len());
        let mut graph = AbstractGraph::new(extent, radius);
        graph.update(Graph::new(&map, &Moves::new(radius, 1.0, Neighbours::TwentySix)));
        let mut by_buckets = PathLengths::default();
        by_buckets.renew(&graph);
        let regions: Vec<RegionId> = graph.near(Cell::default(), 20).map(|(id, _)| id).collect();
        for from in extent.cells().step_by(17) {
            let by_heap = lengths(&mut ShortestPaths::default(), &graph, from);
            for some in [1, 2, 30].map(|step| regions.iter().copied().step_by(step)) {
                by_buckets.begin(&graph, from, some.clone());
                for to in some {
                    prop_assert_eq!(by_buckets.to(&graph, to), by_heap.get(&to).copied());
                }
            }
        }
    }

    #[test]
    fn lengths_are_repaired_after_changes(
        cells in noise(), cuts in prop::collection::vec(0usize..60, 12..20), to in prop::collection::vec(0usize..792, 3),
    ) {
        let extent = Extent::new([11, 9, 8], 1.0).unwrap();
        let moves = Moves::new(RADIUS_M, 1.0, Neighbours::TwentySix);
        let mut map = ExplorationMap::new(extent);
        let mut graph = AbstractGraph::new(extent, RADIUS_M);
        let (mut kept, mut done) = (PathLengths::default(), 0);
        for cut in cuts {
            let next = (done + cut).min(cells.len());
            apply(&mut map, &cells, done..next);
            done = next;
            graph.update(Graph::new(&map, &moves));
            kept.renew(&graph);
            // The whole graph, and as much of it as is needed.
            for (count, from) in [(usize::MAX, 0), (2, 5), (1, 27), (usize::MAX, 400)] {
                let from = extent.cell_at(from);
                let regions = to.iter().filter_map(|&to| graph.region_of(extent.cell_at(to)));
                let regions: Vec<RegionId> = match count {
                    usize::MAX => graph.near(Cell::default(), 20).map(|(id, _)| id).collect(),
                    count => regions.take(count).collect(),
                };
                let by_heap = lengths(&mut ShortestPaths::default(), &graph, from);
                kept.begin(&graph, from, regions.iter().copied());
                for to in regions {
                    prop_assert_eq!(kept.to(&graph, to), by_heap.get(&to).copied());
                }
            }
        }
    }

    #[test]
    fn regions_are_connected_iff_a_path_exists(cells in noise()) {
        let extent = Extent::new([11, 9, 8], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        apply(&mut map, &cells, 0..cells.len());
        let six = Moves::new(RADIUS_M, 1.0, Neighbours::Six);
        let mut graph = AbstractGraph::new(extent, RADIUS_M);
        graph.update(Graph::new(&map, &six));
        let Some(from) = extent.cells().find(|&cell| graph.region_of(cell).is_some()) else { return Ok(()) };
        let mut paths = ShortestPaths::default();
        let reached = lengths(&mut paths, &graph, from);
        for to in extent.cells().step_by(7) {
            let path = Search::new(Graph::new(&map, &six), from, Goal::Cell(to)).run();
            let is_reached = graph.region_of(to).is_some_and(|region| reached.contains_key(&region));
            prop_assert_eq!(is_reached, path.is_some());
            if path.is_some() {
                prop_assert!(paths.path(&graph, Graph::new(&map, &six), (from, to), &|_| false).is_some());
            }
        }
    }
}
