use proptest::prelude::*;
use protocol::body_model::BodyModel;
use voxels::Extent;

use super::*;
use crate::exploration_map::CellState;
use crate::path::straighten_from;

/// What is known of hills of these heights, where `hidden` cells are not.
fn known(heights: &[u8], hidden: &[usize]) -> ExplorationMap {
    let extent = Extent::new([8, 8, 8], 1.0).unwrap();
    let mut map = ExplorationMap::new(extent);
    for (index, cell) in extent.cells().enumerate().filter(|(index, _)| !hidden.contains(index)) {
        let is_border = [cell.x, cell.y, cell.z].iter().any(|along| [0, 7].contains(along));
        let height = heights[(cell.y * 8 + cell.x) as usize];
        if is_border || cell.z <= i32::from(height) {
            map.note_wall(&[index as u32])
        } else {
            map.note_free(&[index as u32])
        }
    }
    map
}

fn is_wall(map: &ExplorationMap, cell: Cell) -> bool {
    map.state(cell) == CellState::Wall
}

/// Depth of the known floor below a cell.
fn depth(map: &ExplorationMap, cell: Cell) -> Option<i32> {
    (0..8).find(|&depth| is_wall(map, cell + Cell::new(0, 0, -depth - 1)))
}

proptest! {
    #[test]
    fn ways_of_ground_bodies_have_a_known_floor(
        heights in prop::collection::vec(0_u8..3, 64),
        hidden in prop::collection::vec(0_usize..512, 0..60),
        step_cells in 0_i32..3,
        [from, to] in [any::<prop::sample::Index>(), any::<prop::sample::Index>()],
    ) {
        let map = known(&heights, &hidden);
        let body = BodyModel { step_max_m: f64::from(step_cells), slope_max_rad: 0.0, ..BodyModel::GROUND };
        for neighbours in [Neighbours::Six, Neighbours::TwentySix] {
            let moves = Moves::of(&body, 1.0, neighbours);
            let graph = Graph::new(&map, &moves);
            let usable: Vec<Cell> = map.extent().cells().filter(|&cell| graph.is_usable(cell)).collect();
            for cell in map.extent().cells() {
                let stands = map.is_free(cell) && is_wall(&map, cell + Cell::new(0, 0, -1));
                prop_assert_eq!(graph.is_usable(cell), stands, "{:?}", cell);
            }
            prop_assume!(!usable.is_empty());
            let (from, to) = (usable[from.index(usable.len())], usable[to.index(usable.len())]);
            let Some(path) = find(graph, from, Goal::Cell(to)) else { continue };
            for pair in path.cells.windows(2) {
                let by = pair[1] - pair[0];
                prop_assert!(by.z == 0 || (by.x, by.y) == (0, 0), "{:?}", by);
                prop_assert!(map.is_free(pair[1]) && depth(&map, pair[1]).is_some_and(|depth| depth <= step_cells));
            }
            let start = map.extent().centre(from);
            let waypoints = straighten_from(&start, &path, &map, &moves);
            let ends = std::iter::once(&start).chain(&waypoints);
            for (from, to) in ends.zip(&waypoints) {
                let by = to - from;
                prop_assert!(by.z == 0.0 || (by.x, by.y, by.z.abs()) == (0.0, 0.0, 1.0), "{}", by);
                for part in 0..=49 {
                    let at = map.extent().cell_of(&(from + by * (f64::from(part) / 49.0)));
                    prop_assert!(depth(&map, at).is_some_and(|depth| depth <= step_cells), "{:?}", at);
                }
            }
        }
    }
}
