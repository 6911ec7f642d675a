use proptest::prelude::*;

use super::*;

const A: AgentId = AgentId(4);

#[test]
fn last_own_finding_holds() {
    let extent = Extent::new([3, 2, 1], 1.0).unwrap();
    let mut map = ExplorationMap::new(extent);
    map.note_free(&[0, 1]);
    map.note_wall(&[1, 2]);
    map.note_free(&[2, 2]);
    assert_eq!(map.state(Cell::new(0, 0, 0)), CellState::Free);
    assert_eq!(map.state(Cell::new(1, 0, 0)), CellState::Wall);
    assert_eq!(map.state(Cell::new(2, 0, 0)), CellState::Free);
    assert_eq!(map.state(Cell::new(0, 1, 0)), CellState::Unexplored);
    assert_eq!(map.state(Cell::new(0, 2, 0)), CellState::Wall);
    assert_eq!((map.free(), map.wall(), map.covered()), (2, 1, 0));
    assert_eq!((map.contradictions(), map.corrections()), (0, 2));
    assert_eq!(map.frontiers().collect::<Vec<_>>(), [0, 2]);
    // What others report of it is ignored as before.
    map.merge(&report(extent, &[1], Finding::Free), A);
    assert_eq!((map.state(Cell::new(1, 0, 0)), map.contradictions()), (CellState::Wall, 1));
}

#[test]
fn visit_does_not_make_a_scan_a_second_one() {
    // With noise a body may be in a cell before its sensor reports it as wall.
    let mut map = ExplorationMap::new(Extent::new([2, 1, 1], 1.0).unwrap());
    map.note_covered(Cell::new(0, 0, 0));
    map.note_wall(&[0]);
    assert_eq!((states(&map)[0], map.contradictions()), (CellState::Covered, 1));
}

#[test]
fn covered_cells_stay_covered_and_free() {
    let mut map = ExplorationMap::new(Extent::new([2, 2, 1], 1.0).unwrap());
    map.note_covered(Cell::new(1, 1, 0));
    map.note_covered(Cell::new(1, 1, 0));
    map.note_free(&[3]);
    map.merge(&report(map.extent(), &[3], Finding::Free), A);
    assert_eq!(map.state(Cell::new(1, 1, 0)), CellState::Covered);
    map.note_wall(&[0]);
    map.note_covered(Cell::new(0, 0, 0));
    map.note_covered(Cell::new(-1, 0, 0));
    assert_eq!((map.free(), map.wall(), map.covered(), map.contradictions()), (1, 1, 1, 1));
}

#[test]
fn journal_holds_changes_in_order() {
    let mut map = ExplorationMap::new(Extent::new([3, 1, 1], 1.0).unwrap());
    map.note_free(&[1, 1]);
    let position = map.journal_len();
    let findings = [(0, Finding::Free), (2, Finding::Wall), (1, Finding::Covered)];
    map.merge(&Delta::of(map.extent(), findings.map(|(cell, finding)| Change { cell, finding, from: None })), A);
    map.note_covered(Cell::new(1, 0, 0));
    let change = |cell, finding, from| Change { cell, finding, from };
    let expected =
        [change(0, Finding::Free, Some(A)), change(1, Finding::Covered, Some(A)), change(2, Finding::Wall, Some(A))];
    assert!(map.changes_since(position).eq(expected));
    assert!(map.changes(0..1).eq([change(1, Finding::Free, None)]));
    assert_eq!(map.changes_since(99).count() + map.changes(9..12).count(), 0);
    assert_eq!(size_of::<Entry>(), 8);
}

#[test]
fn cells_outside_the_map_are_ignored() {
    let mut map = ExplorationMap::new(Extent::new([2, 2, 2], 1.0).unwrap());
    map.note_free(&[8, u32::MAX]);
    map.note_wall(&[8, u32::MAX]);
    let last = Block { index: 0, known: u64::MAX << 7, wall: u64::MAX, covered: 0 };
    map.merge(&Delta { blocks: vec![last, Block { index: 1, ..last }, Block { index: u32::MAX, ..last }] }, A);
    assert_eq!((map.free(), map.wall(), map.covered(), map.journal_len()), (0, 1, 0, 1));
}

#[test]
fn own_sensor_overrides_reports() {
    let extent = Extent::new([5, 1, 1], 1.0).unwrap();
    let mut map = ExplorationMap::new(extent);
    map.merge(&report(extent, &[0, 1], Finding::Wall), A);
    map.merge(&report(extent, &[2], Finding::Covered), A);
    assert_eq!(map.frontiers().collect::<Vec<_>>(), [2]);
    let position = map.journal_len();
    map.note_free(&[1]);
    map.note_wall(&[2]);
    map.note_wall(&[0]);
    assert_eq!(states(&map)[..3], [CellState::Wall, CellState::Free, CellState::Wall]);
    assert_eq!((map.free(), map.wall(), map.covered(), map.frontier_count()), (1, 2, 0, 0));
    assert_eq!((map.corrections(), map.contradictions()), (2, 0));
    let change = |cell, finding| Change { cell, finding, from: None };
    let corrections = [change(1, Finding::Free), change(2, Finding::Wall)];
    assert!(map.changes_since(position).eq(corrections), "a confirmation is no change");
    // From now on no report changes these cells.
    map.merge(&report(extent, &[1], Finding::Wall), A);
    map.merge(&report(extent, &[0], Finding::Free), A);
    map.merge(&report(extent, &[2], Finding::Covered), A);
    assert_eq!((map.corrections(), map.contradictions(), map.journal_len()), (2, 3, position + 2));
    map.merge(&report(extent, &[1], Finding::Covered), A);
    assert_eq!(states(&map)[1], CellState::Covered, "a visit is no contradiction to a free cell");
    map.note_wall(&[1]);
    assert_eq!((states(&map)[1], map.contradictions()), (CellState::Wall, 3), "unless the sensor finds otherwise");
}

#[test]
fn cells_are_seen_again_once_and_only_after_reports() {
    let extent = Extent::new([6, 1, 1], 1.0).unwrap();
    let mut map = ExplorationMap::new(extent);
    map.note_free(&[0]);
    map.merge(&report(extent, &[0, 1, 2], Finding::Free), A);
    map.merge(&report(extent, &[3, 4], Finding::Wall), A);
    assert_eq!(map.seen_again(), 0, "reports of others, and a cell without reports");
    for _ in 0..2 {
        map.note_free(&[0, 1, 3]);
        map.note_wall(&[4]);
        assert_eq!(map.seen_again(), 1, "3 was reported as a wall, 4 is one");
    }
    map.note_covered(extent.cell_at(2));
    assert_eq!(map.seen_again(), 2);
}

#[test]
fn free_overrides_wall_among_reports_in_any_order() {
    let extent = Extent::new([3, 1, 1], 1.0).unwrap();
    let (free, wall) = (report(extent, &[1], Finding::Free), report(extent, &[1], Finding::Wall));
    for findings in [[&free, &wall], [&wall, &free]] {
        let mut map = ExplorationMap::new(extent);
        findings.into_iter().for_each(|delta| map.merge(delta, A));
        assert_eq!(states(&map)[1], CellState::Free);
        assert_eq!((map.free(), map.wall(), map.frontier_count(), map.contradictions()), (1, 0, 1, 0));
    }
}

fn state_at(map: &ExplorationMap, index: u32) -> CellState {
    map.state(map.extent().cell_at(index as usize))
}

fn states(map: &ExplorationMap) -> Vec<CellState> {
    map.extent().cells().map(|cell| map.state(cell)).collect()
}

/// The frontiers by definition.
fn swept(map: &ExplorationMap) -> Vec<u32> {
    let extent = map.extent();
    let is_open = |cell| extent.contains(cell) && map.state(cell) == CellState::Unexplored;
    let is_frontier = |&cell: &Cell| map.state(cell).is_free() && cell.neighbours6().into_iter().any(is_open);
    extent.cells().filter(is_frontier).map(|cell| extent.index(cell).unwrap() as u32).collect()
}

fn cells(volume: u32) -> impl Strategy<Value = Vec<u32>> {
    prop::collection::vec(0..volume, 0..40)
}

/// The same finding for several cells.
fn report(extent: Extent, cells: &[u32], finding: Finding) -> Delta {
    let cells = cells.iter().filter(|&&cell| (cell as usize) < extent.volume());
    Delta::of(extent, cells.map(|&cell| Change { cell, finding, from: None }))
}

/// Consistent findings, so that no two deltas contradict each other.
fn truthful(extent: Extent, cells: &[u32], visited: &[u32]) -> Delta {
    let finding = |cell: u32, free| if cell.is_multiple_of(3) { Finding::Wall } else { free };
    let seen = cells.iter().map(|&cell| (cell, finding(cell, Finding::Free)));
    let visited = visited.iter().map(|&cell| (cell, finding(cell, Finding::Covered)));
    let findings = seen.chain(visited).filter(|&(cell, _)| (cell as usize) < extent.volume());
    Delta::of(extent, findings.map(|(cell, finding)| Change { cell, finding, from: None }))
}

proptest! {
    #[test]
    fn frontiers_counts_and_journal_agree_with_the_cells(
        size in [1u32..6, 1u32..6, 1u32..6],
        updates in prop::collection::vec((0u8..6, prop::collection::vec(0u32..150, 0..12)), 0..30),
    ) {
        let extent = Extent::new(size, 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        let mut scans = 0;
        for (kind, cells) in updates {
            scans += if kind < 2 { cells.len() } else { 0 };
            match kind {
                0 => map.note_free(&cells),
                1 => map.note_wall(&cells),
                2 => cells.iter().for_each(|&cell| map.note_covered(extent.cell_at(cell as usize))),
                3 => map.merge(&truthful(extent, &cells, &cells[..cells.len() / 2]), A),
                4 => map.merge(&report(extent, &cells, Finding::Free), A),
                _ => map.merge(&report(extent, &cells, Finding::Wall), AgentId(5)),
            }
            prop_assert_eq!(map.frontiers().collect::<Vec<_>>(), swept(&map));
            prop_assert_eq!(map.frontier_count(), map.frontiers().count());
        }
        for cell in extent.cells() {
            let index = extent.index(cell).unwrap() as u32;
            prop_assert_eq!(map.is_frontier(cell), map.frontiers().any(|frontier| frontier == index));
        }
        let count = |wanted: &[CellState]| states(&map).iter().filter(|state| wanted.contains(state)).count();
        prop_assert_eq!(map.free(), count(&[CellState::Free, CellState::Covered]));
        prop_assert_eq!(map.wall(), count(&[CellState::Wall]));
        prop_assert_eq!(map.covered(), count(&[CellState::Covered]));
        prop_assert!(map.journal_len() <= CHANGES_MAX * extent.volume() + 2 * scans);
        let mut last_state = std::collections::BTreeMap::new();
        for change in map.changes_since(0) {
            let is_legal = match (last_state.insert(change.cell, change.finding), change.finding) {
                (None, _) | (Some(Finding::Wall), Finding::Free | Finding::Covered) => true,
                (Some(Finding::Free), finding) => finding == Finding::Covered || change.from.is_none(),
                (Some(Finding::Covered), Finding::Wall) => change.from.is_none(),
                _ => false,
            };
            prop_assert!(is_legal, "{change:?}");
        }
        for (cell, finding) in last_state {
            prop_assert_eq!(state_at(&map, cell) as u8, finding as u8);
        }
    }

    #[test]
    fn order_of_findings_and_reports_does_not_matter(
        mut findings in prop::collection::vec((0usize..4, 0u32..12), 0..40),
        seed in any::<prop::sample::Index>(),
    ) {
        let extent = Extent::new([3, 2, 2], 1.0).unwrap();
        // The own sensor never contradicts itself.
        let own = |cell: u32| if cell.is_multiple_of(3) { Finding::Wall } else { Finding::Free };
        let merged_map = |findings: &[(usize, u32)]| {
            let mut map = ExplorationMap::new(extent);
            for &(what, cell) in findings {
                match (what, own(cell)) {
                    (3, Finding::Wall) => map.note_wall(&[cell]),
                    (3, _) => map.note_free(&[cell]),
                    _ => map.merge(&report(extent, &[cell], [Finding::Free, Finding::Covered, Finding::Wall][what]), A),
                }
            }
            map
        };
        let there = merged_map(&findings);
        let again = merged_map(&[findings.as_slice(), findings.as_slice()].concat());
        findings.reverse();
        let half = seed.index(findings.len() + 1);
        findings.rotate_left(half);
        let back = merged_map(&findings);
        prop_assert_eq!(states(&there), states(&back));
        prop_assert_eq!(states(&there), states(&again));
        prop_assert_eq!(there.journal_len(), again.journal_len());
        prop_assert!(there.frontiers().eq(back.frontiers()));
        prop_assert_eq!((there.free(), there.wall(), there.covered()), (back.free(), back.wall(), back.covered()));
    }

    #[test]
    fn merging_is_commutative_and_idempotent(a in cells(60), b in cells(60), c in cells(60)) {
        let extent = Extent::new([5, 4, 3], 1.0).unwrap();
        let (one, other) = (truthful(extent, &a, &c), truthful(extent, &b, &a));
        let merged = |deltas: &[&Delta]| {
            let mut map = ExplorationMap::new(extent);
            deltas.iter().for_each(|delta| map.merge(delta, A));
            map
        };
        let there = merged(&[&one, &other]);
        let back = merged(&[&other, &one]);
        let again = merged(&[&one, &other, &one, &other, &other]);
        prop_assert_eq!(states(&there), states(&back));
        prop_assert_eq!(states(&there), states(&again));
        prop_assert_eq!(there.journal_len(), again.journal_len());
        prop_assert!(there.frontiers().eq(back.frontiers()));
        prop_assert_eq!(there.contradictions() + back.contradictions() + again.contradictions(), 0);
    }
}

proptest! {
    /// Looking at the news of each block alone leaves the map that looking at each cell leaves.
    #[test]
    fn merged_blocks_leave_what_merged_cells_leave(
        size in prop::array::uniform3(1u32..10),
        reports in prop::collection::vec(
            (0u32..3, prop::collection::vec((0u32..10, any::<u64>(), any::<u64>(), any::<u64>()), 0..6)),
            1..8,
        ),
        sparse in any::<u64>(),
    ) {
        let extent = Extent::new(size, 1.0).unwrap();
        let mut by_blocks = ExplorationMap::new(extent);
        let mut by_cells = by_blocks.clone();
        for (from, blocks) in reports {
            let block = |(index, known, wall, covered)| Block { index, known, wall: wall & sparse, covered };
            let delta = Delta { blocks: blocks.into_iter().map(block).collect() };
            if from == 0 {
                let (wall, free): (Vec<_>, Vec<_>) =
                    delta.findings(extent).partition(|&(_, finding)| finding == Finding::Wall);
                for map in [&mut by_blocks, &mut by_cells] {
                    map.note_free(&free.iter().map(|&(cell, _)| cell).collect::<Vec<_>>());
                    map.note_wall(&wall.iter().map(|&(cell, _)| cell).collect::<Vec<_>>());
                    map.note_covered(extent.cell_at(free.len() % extent.volume()));
                }
                continue;
            }
            by_blocks.merge(&delta, AgentId(from));
            for (cell, finding) in delta.findings(extent) {
                by_cells.learn(by_cells.layout.place_of(cell), cell as usize, finding, from);
            }
            by_cells.update_frontiers();
            prop_assert!(by_blocks.changes_since(0).eq(by_cells.changes_since(0)));
            prop_assert_eq!(states(&by_blocks), states(&by_cells));
            let words = |map: &ExplorationMap| (0..=map.layout.count()).map(|block| map.blocks.get(block)).collect();
            let [one, other]: [Vec<Option<Words>>; 2] = [words(&by_blocks), words(&by_cells)];
            prop_assert_eq!(one, other);
            let counts = |map: &ExplorationMap| (map.contradictions(), map.corrections(), map.free(), map.covered());
            prop_assert_eq!(counts(&by_blocks), counts(&by_cells));
            prop_assert!(by_blocks.frontiers().eq(by_cells.frontiers()));
        }
    }

    #[test]
    fn cubes_have_the_states_of_their_cells(
        size in [1u32..9, 1u32..9, 1u32..9],
        cells in prop::collection::vec((0u32..600, 0..3), 0..200),
        corner in prop::array::uniform3(0i32..9),
        side in 1i32..6,
    ) {
        let extent = Extent::new(size, 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        for (cell, finding) in cells {
            match finding {
                0 => map.note_free(&[cell]),
                1 => map.note_wall(&[cell]),
                _ => map.note_covered(extent.cell_at(cell as usize)),
            }
        }
        let [x, y, z] = [0, 1, 2].map(|axis| corner[axis] % size[axis].cast_signed());
        let corner = Cell::new(x, y, z);
        let (free, frontiers) = (map.free_in(corner, side), map.frontiers_in(corner, side));
        for place in 0..side * side * side {
            let cell = corner + Cell::new(place % side, place / side % side, place / side / side);
            let is_free = map.state(cell).is_free();
            prop_assert_eq!(free >> place & 1 != 0, is_free);
            prop_assert_eq!(frontiers >> place & 1 != 0, map.is_frontier(cell));
        }
        prop_assert_eq!((free | frontiers) >> (side * side * side - 1) >> 1, 0);
        let changed: Vec<_> = map.cells_changed_since(0).collect();
        let by_index = map.changes_since(0).map(|change| (extent.cell_at(change.cell as usize), change.finding));
        prop_assert!(by_index.eq(changed.iter().copied()));
        let boxes: Vec<(Cell, Cell)> = map.boxes_changed_since(0).collect();
        let is_within = |cell: Cell, (low, high): (Cell, Cell), by: i32| {
            let along = |at: i32, low: i32, high: i32| (low - by..=high + by).contains(&at);
            along(cell.x, low.x, high.x) && along(cell.y, low.y, high.y) && along(cell.z, low.z, high.z)
        };
        prop_assert!(changed.iter().all(|&(cell, _)| boxes.iter().any(|&ends| is_within(cell, ends, 0))));
        for &(low, high) in &boxes {
            for end in [low, high] {
                prop_assert!(changed.iter().any(|&(cell, _)| is_within(end, (cell, cell), 3)));
            }
        }
        let reports = with_delta(extent, map.reports(0..map.journal_len()), Delta::clone);
        prop_assert_eq!(reports, Delta::of(extent, map.changes_since(0)));
    }
}

proptest! {
    #[test]
    fn rows_of_cells_noted_at_once_are_the_cells_noted_one_by_one(
        size in [1u32..11, 1u32..6, 1u32..6],
        rows in prop::collection::vec((0u32..300, 1u32..14, any::<bool>()), 0..14),
    ) {
        let extent = Extent::new(size, 1.0).unwrap();
        let (mut at_once, mut one_by_one) = (ExplorationMap::new(extent), ExplorationMap::new(extent));
        for (start, count, is_wall) in rows {
            let note = if is_wall { ExplorationMap::note_wall } else { ExplorationMap::note_free };
            let cells: Vec<u32> = (start..start + count).collect();
            note(&mut at_once, &cells);
            cells.iter().for_each(|&cell| note(&mut one_by_one, &[cell]));
            prop_assert_eq!(at_once.frontiers().collect::<Vec<_>>(), swept(&at_once));
        }
        prop_assert!(at_once.changes_since(0).eq(one_by_one.changes_since(0)));
        prop_assert_eq!(states(&at_once), states(&one_by_one));
        let counts = |map: &ExplorationMap| (map.free(), map.wall(), map.corrections(), map.contradictions());
        prop_assert_eq!(counts(&at_once), counts(&one_by_one));
    }
}

proptest! {
    #[test]
    fn walls_and_free_cells_around_a_cell_are_those_of_its_states(
        kinds in prop::collection::vec(0..4, 5 * 4 * 6),
        at in (0..5_i32, 0..4_i32, 0..6_i32),
    ) {
        let extent = Extent::new([5, 4, 6], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        for (cell, kind) in extent.cells().zip(kinds) {
            let index = extent.index(cell).unwrap() as u32;
            match kind {
                0 => map.note_wall(&[index]),
                1 => map.note_free(&[index]),
                2 => map.note_covered(cell),
                _ => {}
            }
        }
        let cell = Cell::new(at.0, at.1, at.2);
        let around: Vec<CellState> =
            cell.neighbours26().into_iter().chain([cell]).map(|beside| map.state(beside)).collect();
        let count = |states: &[CellState]| around.iter().filter(|state| states.contains(state)).count() as u8;
        let expected = Around { walls: count(&[CellState::Wall]), free: count(&[CellState::Free, CellState::Covered]) };
        prop_assert_eq!(map.around(cell), expected);
        let cube = (-1..=1).flat_map(|z| (-1..=1).flat_map(move |y| (-1..=1).map(move |x| Cell::new(x, y, z))));
        let is_free = |by| map.state(cell + by).is_free();
        let free = (0..).zip(cube).filter(|&(_, by)| is_free(by)).fold(0, |free, (place, _): (u32, _)| free | 1 << place);
        prop_assert_eq!(map.free_around(cell), free);
    }
}

proptest! {
    #[test]
    fn frontiers_near_a_cell_are_those_within_reach_along_each_axis(
        size in [1u32..200, 1u32..7, 1u32..7],
        free in prop::collection::vec(any::<prop::sample::Index>(), 0..20),
        // Inside the map, beyond its edges, and as far as positions that no integer can hold.
        cell in prop_oneof![
            2 => (0i32..200, 0i32..7, 0i32..7),
            1 => (-50i32..250, -50i32..50, -50i32..50),
            1 => (any::<i32>(), any::<i32>(), any::<i32>()),
            1 => (any::<i32>(), 0i32..7, 0i32..7),
        ],
        reach in prop_oneof![0i32..12, 0i32..200],
    ) {
        let extent = Extent::new(size, 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        free.iter().for_each(|cell| map.note_free(&[cell.index(extent.volume()) as u32]));
        let cell = Cell::new(cell.0, cell.1, cell.2);
        let is_near = |frontier: &Cell| frontier.is_within(cell, reach);
        let frontiers = map.frontiers().map(|frontier| extent.cell_at(frontier as usize));
        prop_assert!(map.frontiers_near(cell, reach).eq(frontiers.filter(is_near)));
    }
}

#[test]
fn marks_of_coverage_reveal_nothing() {
    let mut map = ExplorationMap::new(Extent::new([40, 5, 5], 1.0).unwrap());
    let cell = |x: i32| Cell::new(x, 2, 2);
    let index = |map: &ExplorationMap, x: i32| map.extent().index(cell(x)).unwrap() as u32;
    let free: Vec<u32> = (0..30).map(|x| index(&map, x)).collect();
    map.note_free(&free);
    let read = map.journal_len();
    for x in [1, 9, 33] {
        map.note_covered(cell(x));
    }
    assert_eq!(map.boxes_changed_since(read).count(), 3);
    assert_eq!(map.boxes_revealed_since(read).collect::<Vec<_>>(), [(cell(33), cell(33))], "it was unexplored");
    map.note_wall(&[index(&map, 9), index(&map, 39)]);
    let revealed: Vec<_> = map.boxes_revealed_since(read).collect();
    assert_eq!(revealed, [9, 33, 9, 39].map(|x| (cell(x), cell(x))), "a scan overrides a visit");
}
