//! Straight legs: whether they are clear, and where those of a path end.

use super::*;
use crate::bodies::BodyModel;

#[test]
fn direct_is_exact() {
    let map = drawn("......\n......\n..#...\n......\n");
    let from = |x: f64, y: f64| Point3::new(x, y, 0.5);
    assert!(direct(&map, &from(0.5, 0.5), flat(5, 0), 0.4));
    assert!(direct(&map, &from(0.5, 2.5), flat(5, 2), 0.5));
    assert!(!direct(&map, &from(0.5, 2.39), flat(5, 2), 0.5));
    assert!(direct(&map, &from(0.5, 2.41), flat(5, 2), 0.4));
    assert!(!direct(&map, &from(0.5, 0.5), flat(3, 2), 0.4));
    assert!(!direct(&map, &from(0.5, 0.5), flat(2, 1), 0.4));
    assert!(!direct(&map, &from(0.5, 0.5), flat(6, 0), 0.4));
    for outside in [-0.1, 1e300, f64::NAN] {
        assert!(!direct(&map, &from(outside, 0.5), flat(0, 0), 0.4));
    }
}

#[test]
fn off_centre_start_goes_to_the_centre_if_needed() {
    let map = drawn("...\n#.#\n#.#\n");
    let path = search(&map, Neighbours::Six, 0.4, flat(1, 0), flat(1, 2)).unwrap();
    let straight = straighten_from(&Point3::new(1.55, 0.45, 0.5), &path, &map, 0.4);
    assert_eq!(straight, points(&[flat(1, 2)]));
    let aside = straighten_from(&Point3::new(1.7, 0.5, 0.5), &path, &map, 0.4);
    assert_eq!(aside, points(&[flat(1, 0), flat(1, 2)]));
    let outside = straighten_from(&Point3::new(f64::NAN, -1e9, 0.5), &path, &map, 0.4);
    assert_eq!(outside, aside);
}

#[test]
fn long_paths_are_cut() {
    let map = comb(400);
    let path = search(&map, Neighbours::TwentySix, 0.4, flat(0, 2), flat(0, 6)).unwrap();
    let legs = straighten(&path, &map, 0.4);
    assert_eq!(legs.len(), PATH_POINTS_MAX);
    let end = map.extent().cell_of(&legs[PATH_POINTS_MAX - 1]);
    let rest = search(&map, Neighbours::TwentySix, 0.4, end, flat(0, 6)).unwrap();
    let rest = straighten(&rest, &map, 0.4);
    assert!(rest.len() < PATH_POINTS_MAX);
    assert_eq!(rest.last(), points(&[flat(0, 6)]).last());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn straight_legs_keep_clear(
        (map, start, goal, radius, neighbours) in any_question(), aside in prop::array::uniform3(-0.1f64..0.1),
    ) {
        let cell_m = map.extent().cell_m();
        let moves = Moves::new(radius * cell_m, cell_m, neighbours);
        let graph = Graph::new(&map, &moves);
        let Some(path) = find(graph, start, Goal::Cell(goal)) else {
            return Ok(());
        };
        let home = at(radius)(start);
        let from = [0, 1, 2].map(|axis| home[axis] + aside[axis]);
        let legs = straighten(&path, &map, radius * cell_m);
        let from_m = Point3::from(from.map(|at| at * cell_m));
        let legs_from = straighten_from(&from_m, &path, &map, radius * cell_m);
        let body = BodyModel { radius_m: radius * cell_m, ..BodyModel::AERIAL };
        let quicker = quicker(&path, &legs_from, &map, &body, (&from_m, 0.0)).unwrap_or_default();
        prop_assert!(legs.len() < path.cells.len() && legs_from.len() <= path.cells.len());
        let longest_m = path.length_m(map.extent()) + 0.4 * cell_m;
        for (first, legs, longest_m) in
            [(home, legs, longest_m), (from, legs_from, longest_m), (from, quicker, f64::INFINITY)]
        {
            let mut here = first;
            let mut length_m = 0.0;
            for (place, point) in legs.iter().enumerate() {
                let to = [point.x, point.y, point.z].map(|metres| metres / cell_m);
                let is_excepted = place < 2 && is_excepted(graph, radius, &path, to);
                prop_assert!(is_excepted || keeps_clear(&map, here, to, radius));
                length_m += (Point3::from(to) - Point3::from(here)).norm() * cell_m;
                here = to;
            }
            prop_assert!(length_m <= longest_m);
            if let Some(last) = legs.last() {
                prop_assert_eq!(*last, moves.lattice().place(map.extent(), goal));
            }
        }
    }
}

/// Whether a waypoint, in cells, is exempt because of what the body touches at the start: the
/// place of its first cell, and of the next one if the first is not usable.
fn is_excepted(graph: Graph<'_>, radius: f64, path: &Path, point: [f64; 3]) -> bool {
    let is_here = |&cell: &Cell| (Point3::from(at(radius)(cell)) - Point3::from(point)).norm() < 1e-9;
    path.cells.iter().take(if graph.is_usable(path.cells[0]) { 1 } else { 2 }).any(is_here)
}
