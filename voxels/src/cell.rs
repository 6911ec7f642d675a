//! [`Cell`]: the integer coordinates of one voxel, and its neighbours in a fixed order.
//!
//! Whether a cell lies in a map is decided by [`Extent`](crate::Extent).

use std::cmp::Ordering;
use std::ops::{Add, Sub};

/// The coordinates of one voxel, in cells, in the map frame; may lie outside any map.
///
/// Ordered by z, then y, then x, which is the order of cell indices.
///
/// ```
/// use voxels::Cell;
/// assert!(Cell::new(9, 0, 0) < Cell::new(0, 1, 0));
/// assert_eq!(Cell::new(1, 2, 3) - Cell::new(1, 1, 1), Cell::new(0, 1, 2));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Cell {
    /// Forward, in cells.
    pub x: i32,
    /// Left, in cells.
    pub y: i32,
    /// Up, in cells.
    pub z: i32,
}

/// The offsets of the six cells that share a face with a cell: +x, -x, +y, -y, +z, -z.
pub const FACES: [Cell; 6] = [
    Cell::new(1, 0, 0),
    Cell::new(-1, 0, 0),
    Cell::new(0, 1, 0),
    Cell::new(0, -1, 0),
    Cell::new(0, 0, 1),
    Cell::new(0, 0, -1),
];

/// The offsets of the 26 cells around a cell, in cell order.
const AROUND: [Cell; 26] = around();

const fn around() -> [Cell; 26] {
    let mut offsets = [Cell::new(0, 0, 0); 26];
    let mut code = 0;
    let mut filled = 0;
    while code < 27 {
        if code != 13 {
            offsets[filled] = Cell::new(code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1);
            filled += 1;
        }
        code += 1;
    }
    offsets
}

impl Cell {
    /// The cell at `(x, y, z)`.
    #[inline]
    pub const fn new(x: i32, y: i32, z: i32) -> Self {
        Self { x, y, z }
    }

    /// The six cells that share a face with this one, in the order of [`FACES`].
    #[inline]
    pub fn neighbours6(self) -> [Cell; 6] {
        FACES.map(|offset| self + offset)
    }

    /// Squared distance between the centres of this cell and another one, cells.
    pub fn distance_squared(self, other: Self) -> i64 {
        let by = self - other;
        [by.x, by.y, by.z].into_iter().map(|by| i64::from(by) * i64::from(by)).sum()
    }

    /// Distance between the centres of this cell and another one, cells.
    pub fn distance(self, other: Self) -> f64 {
        (self.distance_squared(other) as f64).sqrt()
    }

    /// Whether this cell is at most so many cells from another one along each axis.
    pub fn is_within(self, about: Self, cells: i32) -> bool {
        let along = [(self.x, about.x), (self.y, about.y), (self.z, about.z)];
        along.into_iter().all(|(one, other)| i64::from(one.abs_diff(other)) <= i64::from(cells))
    }

    /// The 26 cells that share a face, an edge or a corner with this one, in cell order.
    #[inline]
    pub fn neighbours26(self) -> [Cell; 26] {
        AROUND.map(|offset| self + offset)
    }
}

impl Ord for Cell {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        (self.z, self.y, self.x).cmp(&(other.z, other.y, other.x))
    }
}

impl PartialOrd for Cell {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Add for Cell {
    type Output = Cell;

    #[inline]
    fn add(self, other: Cell) -> Cell {
        Cell::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl Sub for Cell {
    type Output = Cell;

    #[inline]
    fn sub(self, other: Cell) -> Cell {
        Cell::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_come_in_the_documented_order() {
        let c = Cell::new(5, 6, 7);
        assert_eq!(
            c.neighbours6(),
            [
                Cell::new(6, 6, 7),
                Cell::new(4, 6, 7),
                Cell::new(5, 7, 7),
                Cell::new(5, 5, 7),
                Cell::new(5, 6, 8),
                Cell::new(5, 6, 6),
            ]
        );
    }

    #[test]
    fn the_26_neighbours_are_all_different_sorted_and_adjacent() {
        let c = Cell::new(-2, 0, 3);
        let around = c.neighbours26();
        assert!(around.windows(2).all(|pair| pair[0] < pair[1]));
        for n in around {
            let d = n - c;
            assert_ne!(d, Cell::default());
            assert!(d.x.abs() <= 1 && d.y.abs() <= 1 && d.z.abs() <= 1);
        }
    }
}
