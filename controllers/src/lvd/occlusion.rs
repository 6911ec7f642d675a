//! Occlusion points: places beside the edge of a wall that give a view behind it.
//!
//! The rule is that of the reference as coded. From the agent's cell P to a wall W, s is the sign
//! of P - W along each axis; a wall is at an edge if a neighbour of it, on a side visible from P,
//! was not seen as a wall. Then the cell beside that neighbour, on another side visible from P, is
//! a candidate.

use voxels::Cell;

/// Passes the candidates of one wall, seen from the cell `own`, to `found`; `is_wall` says whether
/// a cell was seen as a wall. Candidates may repeat.
///
/// # Errors
/// Any error of `is_wall` or `found`, which ends the enumeration.
pub(crate) fn candidates<E>(
    own: Cell,
    wall: Cell,
    is_wall: impl Fn(Cell) -> Result<bool, E>,
    mut found: impl FnMut(Cell) -> Result<(), E>,
) -> Result<(), E> {
    let sign = [own.x - wall.x, own.y - wall.y, own.z - wall.z].map(i32::signum);
    let facing = [0, 1, 2].into_iter().filter(|&axis| sign[axis] != 0);
    let across = [0, 1, 2].into_iter().filter(|&axis| sign[axis] == 0);
    let is_facing_two_or_more = facing.clone().count() >= 2;
    for axis in across {
        for side in [1, -1] {
            let beside = moved(wall, axis, side);
            if !is_wall(beside)? {
                for facing_axis in facing.clone() {
                    found(moved(beside, facing_axis, sign[facing_axis]))?;
                }
            }
        }
    }
    if is_facing_two_or_more {
        for axis in facing.clone() {
            let behind = moved(wall, axis, -sign[axis]);
            if !is_wall(behind)? {
                for other in facing.clone().filter(|&other| other != axis) {
                    found(moved(behind, other, sign[other]))?;
                }
            }
        }
    }
    Ok(())
}

fn moved(cell: Cell, axis: usize, by: i32) -> Cell {
    let mut to = [cell.x, cell.y, cell.z];
    to[axis] += by;
    Cell::new(to[0], to[1], to[2])
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    fn of(own: Cell, wall: Cell, walls: &[Cell]) -> Vec<Cell> {
        let mut cells = Vec::new();
        let ended = candidates::<Infallible>(
            own,
            wall,
            |cell| Ok(walls.contains(&cell)),
            |cell| {
                cells.push(cell);
                Ok(())
            },
        );
        assert!(ended.is_ok());
        cells.sort_unstable();
        cells
    }

    #[test]
    fn wall_straight_ahead_has_edges_on_four_sides() {
        let (own, wall) = (Cell::new(0, 5, 5), Cell::new(5, 5, 5));
        let beside = [Cell::new(4, 5, 4), Cell::new(4, 4, 5), Cell::new(4, 6, 5), Cell::new(4, 5, 6)];
        assert_eq!(of(own, wall, &[wall]), beside);
        let walls = [wall, Cell::new(5, 5, 4), Cell::new(5, 4, 5), Cell::new(5, 6, 5), Cell::new(5, 5, 6)];
        assert_eq!(of(own, wall, &walls), []);
    }

    #[test]
    fn planar_diagonal_wall_has_edges_above_below_and_behind() {
        let (own, wall) = (Cell::new(0, 0, 5), Cell::new(5, 5, 5));
        let (above, below) = (Cell::new(5, 5, 6), Cell::new(5, 5, 4));
        let behind = [Cell::new(6, 4, 5), Cell::new(4, 6, 5)];
        assert_eq!(of(own, wall, &[above, below]), behind);
        assert_eq!(of(own, wall, &[above, below, Cell::new(6, 5, 5)]), [Cell::new(4, 6, 5)]);
        let flat = [Cell::new(6, 5, 5), Cell::new(5, 6, 5)];
        assert_eq!(
            of(own, wall, &flat),
            [Cell::new(5, 4, 4), Cell::new(4, 5, 4), Cell::new(5, 4, 6), Cell::new(4, 5, 6)]
        );
    }

    #[test]
    fn diagonal_wall_has_two_candidates_behind_each_face() {
        let (own, wall) = (Cell::new(0, 0, 0), Cell::new(5, 5, 5));
        let walls = [Cell::new(5, 6, 5), Cell::new(5, 5, 6)];
        assert_eq!(of(own, wall, &walls), [Cell::new(6, 5, 4), Cell::new(6, 4, 5)]);
        assert_eq!(of(own, wall, &[]).len(), 6);
        assert_eq!(of(wall, wall, &[]), []);
    }

    #[test]
    fn error_ends_the_enumeration() {
        let (own, wall) = (Cell::new(0, 0, 0), Cell::new(5, 5, 5));
        assert_eq!(candidates(own, wall, |_| Err("outside"), |_| Ok(())), Err("outside"));
        assert_eq!(candidates(own, wall, |_| Ok(false), |_| Err("enough")), Err("enough"));
    }
}
