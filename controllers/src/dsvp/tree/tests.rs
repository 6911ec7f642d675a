use std::collections::BTreeSet;

use proptest::prelude::*;
use voxels::{Grid, Terrain};

use super::*;
use agent::bodies::Bodies;
use agent::exploration_map::CellState;
use agent::path::{Moves, Neighbours};

const CORRIDOR: &str = "\
    ####################\n\
    #..................#\n\
    ####################\n";

const GROWTH: Growth = Growth { horizon: 6, extension: 3.0, samples: 150, bias: 0.3, jitter: 1 };

fn no_bodies() -> Bodies {
    Bodies::new(Vec::new(), Vec::new()).unwrap()
}

/// The cells of the nodes, root first.
fn cells_of(tree: &Tree) -> Vec<Cell> {
    tree.nodes.iter().map(|node| node.cell).collect()
}

/// The cells at both ends of each edge, the one nearer to the root first.
fn edges_of(tree: &Tree) -> impl Iterator<Item = (Cell, Cell)> {
    tree.nodes.iter().skip(1).map(|node| (tree.nodes[node.parent].cell, node.cell))
}

fn check(tree: &Tree, map: &ExplorationMap, root: Cell) -> Result<(), TestCaseError> {
    let cells = cells_of(tree);
    prop_assert_eq!(cells[0], root);
    prop_assert_eq!(cells.iter().collect::<BTreeSet<_>>().len(), tree.nodes.len(), "no cell is two nodes");
    for &cell in &cells {
        let by = cell - root;
        prop_assert!([by.x, by.y, by.z].iter().all(|by| by.abs() <= GROWTH.horizon));
    }
    for (from, to) in edges_of(tree) {
        prop_assert!(direct(map, &map.extent().centre(from), to, 0.4), "{from:?} {to:?}");
    }
    Ok(())
}

proptest! {
    #[test]
    fn tree_stays_in_known_free_cells_within_its_horizon(
        cells in prop::collection::vec(0u8..8, 12 * 12 * 4),
        seed: u64,
        steps in prop::collection::vec((0usize..100, prop::collection::vec(0u32..12 * 12 * 4, 0..6)), 1..4),
    ) {
        let extent = Extent::new([12, 12, 4], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        let mut rng = voxels::random_streams::stream(seed, 0, "tree");
        for (index, kind) in (0..).zip(&cells) {
            match kind {
                0 => map.note_wall(&[index]),
                1 => {}
                _ => map.note_free(&[index]),
            }
        }
        let root = Cell::new(6, 6, 2);
        map.note_covered(root);
        prop_assume!(map.state(root) == CellState::Covered);
        let obstacles = Obstacles::near(&[], &extent.centre(root), 0.4, &no_bodies(), extent);
        let moves = Moves::new(0.4, 1.0, Neighbours::TwentySix);
        let mut tree = Tree::new(root);
        tree.grow(Graph::new(&map, &moves), &GROWTH, &[Cell::new(1, 1, 1)], &obstacles, &mut rng);
        check(&tree, &map, root)?;
        for (step, turned_to_wall) in steps {
            map.note_wall(&turned_to_wall);
            let cells = cells_of(&tree);
            let root = cells[step % cells.len()];
            tree = tree.rerooted_at(root, Graph::new(&map, &moves), &GROWTH);
            check(&tree, &map, root)?;
            tree.grow(Graph::new(&map, &moves), &GROWTH, &[], &obstacles, &mut rng);
            check(&tree, &map, root)?;
        }
    }
}

#[test]
fn rerooted_tree_keeps_its_component() {
    let world = Grid::<Terrain>::from_text(CORRIDOR).unwrap();
    let mut map = ExplorationMap::new(world.extent());
    for (index, terrain) in (0..).zip(world.as_slice()) {
        if *terrain == Terrain::Free { map.note_free(&[index]) } else { map.note_wall(&[index]) }
    }
    let obstacles = Obstacles::near(&[], &Point3::origin(), 0.4, &no_bodies(), world.extent());
    let mut tree = Tree::new(Cell::new(5, 1, 0));
    let moves = Moves::new(0.4, 1.0, Neighbours::TwentySix);
    let growth = Growth { samples: 20_000, ..GROWTH };
    tree.grow(Graph::new(&map, &moves), &growth, &[], &obstacles, &mut voxels::random_streams::stream(1, 0, "tree"));
    assert_eq!(tree.nodes.len(), 11, "x from 1 to 11");
    let moved = tree.rerooted_at(Cell::new(8, 1, 0), Graph::new(&map, &moves), &GROWTH);
    assert_eq!(moved.nodes.len(), 10, "x from 2 to 11: {moved:?}");
    assert_eq!(cells_of(&moved).first().copied(), Some(Cell::new(8, 1, 0)));
}

#[test]
fn rerooted_tree_leaves_out_what_has_become_wall_and_what_is_behind() {
    let world = Grid::<Terrain>::from_text(CORRIDOR).unwrap();
    let mut map = ExplorationMap::new(world.extent());
    let index = |x| world.extent().index(Cell::new(x, 1, 0)).unwrap() as u32;
    map.note_free(&(1..19).map(index).collect::<Vec<u32>>());
    let mut tree = Tree::new(Cell::new(2, 1, 0));
    for (parent, x) in [4, 6, 8].into_iter().enumerate() {
        tree.add(Cell::new(x, 1, 0), parent);
    }
    let moves = Moves::new(0.4, 1.0, Neighbours::TwentySix);
    let rerooted = |tree: &Tree, map: &ExplorationMap, x| {
        let moved = tree.rerooted_at(Cell::new(x, 1, 0), Graph::new(map, &moves), &GROWTH);
        (cells_of(&moved).iter().map(|cell| cell.x).collect::<Vec<i32>>(), moved)
    };
    let (all, tree) = rerooted(&tree, &map, 2);
    assert_eq!(all, [2, 4, 6, 8]);
    // Neither end of the edge from 4 to 6 is wall.
    map.note_wall(&[index(5)]);
    let (left, moved) = rerooted(&tree, &map, 2);
    assert_eq!(left, [2, 4]);
    assert_eq!(rerooted(&tree, &map, 7).0, [7, 6, 8], "from beyond the wall");
    assert_eq!(rerooted(&moved, &map, 4).0, [4, 2], "no new correction");
}
