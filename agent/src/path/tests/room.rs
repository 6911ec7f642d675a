use super::super::graph::is_free;
use super::*;

/// A map of free cells with some walls and some unexplored cells.
fn map_of(extent: Extent, others: &[(usize, bool)]) -> ExplorationMap {
    let mut map = ExplorationMap::new(extent);
    let (walls, unexplored): (Vec<_>, Vec<_>) = others.iter().partition(|(_, is_wall)| *is_wall);
    let of = |cells: &[(usize, bool)]| cells.iter().map(|&(cell, _)| cell as u32).collect::<BTreeSet<u32>>();
    let (walls, unexplored) = (of(&walls), of(&unexplored));
    map.note_wall(&walls.iter().copied().collect::<Vec<u32>>());
    let free = (0..extent.volume() as u32).filter(|cell| !walls.contains(cell) && !unexplored.contains(cell));
    map.note_free(&free.collect::<Vec<u32>>());
    map
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn steps_by_blocks_are_those_cell_by_cell(
        radius in 0.51..3.5,
        others in prop::collection::vec((0usize..21 * 19 * 11, any::<bool>()), 0..60),
    ) {
        let extent = Extent::new([21, 19, 11], 1.0).unwrap();
        let map = map_of(extent, &others);
        let radius_cells = clearance(radius, 1.0).unwrap();
        for neighbours in [Neighbours::Six, Neighbours::TwentySix] {
            let moves = Moves::new(radius, 1.0, neighbours);
            let graph = Graph::new(&map, &moves);
            let mut steps = graph.steps();
            let home = Cell::default();
            let at = |cell| place(moves.lattice(), cell);
            let of_step = |by: Cell| touched(at(home), at(by), radius_cells);
            let swept: Vec<Vec<Cell>> = moves.steps.iter().map(|step| of_step(step.by)).collect();
            for cell in extent.cells() {
                let is_possible = |swept: &Vec<Cell>| swept.iter().all(|&by| is_free(&map, cell + by));
                let possible = (0..).zip(&swept).map(|(number, swept)| u32::from(is_possible(swept)) << number);
                let expected = possible.fold(0, |steps, step: u32| steps | step);
                prop_assert_eq!(steps.bits(cell, false), expected, "{:?}", cell);
            }
            for corner in [Cell::new(0, 0, 0), Cell::new(5, 10, 5), Cell::new(20, 15, 10)] {
                let bits = graph.usable_in(corner, 5);
                for place in 0..125 {
                    let cell = corner + Cell::new(place % 5, place / 5 % 5, place / 25);
                    prop_assert_eq!(bits >> place & 1 != 0, graph.is_usable(cell), "{:?}", cell);
                }
            }
        }
    }

    #[test]
    fn leg_is_clear_if_all_cells_touched_are_free(
        from in prop::array::uniform3(0.0..9.0_f64), to in prop::array::uniform3(0i32..9), radius in 0.1..2.5,
        others in prop::collection::vec((0usize..9 * 9 * 9, any::<bool>()), 0..12),
    ) {
        let extent = Extent::new([9; 3], 1.0).unwrap();
        let map = map_of(extent, &others);
        let to = Cell::new(to[0], to[1], to[2]);
        let end = place(BodyLattice::of(radius, 1.0), to);
        let swept = touched(from, end, clearance(radius, 1.0).unwrap());
        let expected = swept.into_iter().all(|cell| is_free(&map, cell));
        prop_assert_eq!(direct(&map, &Point3::from(from), to, radius), expected);
    }
}
