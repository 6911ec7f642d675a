use super::super::super::gain::WHOLE;
use super::*;
use crate::exploration_map::drawing::drawn;
use crate::path::{Graph, Moves, Neighbours};

/// Two caves in one block of the task grid: a gallery that is open at its end, and a dead end.
const CAVES: &str = "
#########################
#......................??
#########################
#....???#################
#########################";

fn survey(text: &str, ignored: &[Cell], beside_wall: f64) -> (TaskGrid, Survey) {
    let map = drawn(text.trim_start());
    let mut graph = AbstractGraph::new(map.extent(), 0.4);
    graph.update(Graph::new(&map, &Moves::new(0.4, 1.0, Neighbours::TwentySix)));
    let grid = TaskGrid::new(map.extent());
    let ignored = ignored.iter().copied().collect();
    (grid, Survey::new(&map, &graph, &grid, &ignored, Likelihood::new(beside_wall)))
}

#[test]
fn rock_separates_tasks() {
    let (_, Survey { tasks, task_of }) = survey(CAVES, &[], 1.0);
    assert_eq!(tasks.len(), 2);
    assert_eq!(task_of.len(), 2);
    assert!(!tasks[0].id.overlaps(tasks[1].id));
    let (_, ignoring) = survey(CAVES, &[Cell::new(22, 3, 0), Cell::new(4, 1, 0)], 1.0);
    assert_eq!(ignoring, Survey::default());
}

#[test]
fn value_is_that_of_the_unexplored_cells_beside() {
    // At both ends the unexplored cell has a wall on two sides.
    let (_, alike) = survey(CAVES, &[], 1.0);
    assert!(alike.tasks.iter().all(|task| task.value == WHOLE), "{alike:?}");
    let (_, likely) = survey(CAVES, &[], 0.5);
    assert!(likely.tasks.iter().all(|task| task.value <= WHOLE / 4), "{likely:?}");
}

#[test]
fn names_overlap_if_they_share_an_octant() {
    let grid = TaskGrid::new(Extent::new([50, 50, 50], 0.5).unwrap());
    assert_eq!(grid.blocks(), 27);
    let id = |x, y, z| grid.octant_of(Cell::new(x, y, z));
    assert_eq!(id(3, 4, 5), TaskId { block: 0, octants: 1 });
    assert_eq!(id(13, 4, 15), TaskId { block: 0, octants: 1 << 5 });
    assert_eq!(id(23, 44, 5), TaskId { block: 7, octants: 1 });
    assert!(id(0, 0, 0).overlaps(id(9, 9, 9)) && !id(0, 0, 0).overlaps(id(10, 9, 9)));
    assert!(!id(0, 0, 0).overlaps(id(20, 0, 0)));
    assert_eq!(grid.centre(id(23, 44, 5)), Point3::new(12.5, 22.5, 2.5));
    let both = TaskId { block: 0, octants: 0b11 };
    assert_eq!(grid.centre(both), Point3::new(5.0, 2.5, 2.5));
}
