//! [`Extent`]: the size of a map, and conversions between points, cells and indices.
//!
//! Invariants: every axis has 1 to [`Extent::AXIS_MAX`] cells and `cell_m` is finite and positive,
//! so the volume fits `u32` and no other code tests for an empty map.

use nalgebra::Point3;
use thiserror::Error;

use crate::Cell;

/// The size of a map in cells and the length of a cell's edge; the map's lowest corner is the
/// origin of the map frame.
///
/// ```
/// use voxels::{Cell, Extent};
/// let extent = Extent::new([4, 3, 2], 0.5)?;
/// assert_eq!(extent.volume(), 24);
/// assert_eq!(extent.index(Cell::new(1, 0, 1)), Some(13));
/// assert_eq!(extent.index(Cell::new(4, 0, 0)), None);
/// # Ok::<(), voxels::ExtentError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    size: [u32; 3],
    cell_m: f64,
}

/// The reason why an [`Extent`] is illegal.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ExtentError {
    /// An axis is empty or too long.
    #[error("map size along {axis} is {cells} cells, allowed are 1 to {}", Extent::AXIS_MAX)]
    Size {
        /// `x`, `y` or `z`.
        axis: char,
        /// The refused number of cells.
        cells: u32,
    },
    /// The cell length is not a usable number.
    #[error("cell_m is {0}, allowed are finite lengths in metres above 0")]
    CellLength(f64),
}

impl Extent {
    /// The largest number of cells along one axis; keeps every cell index within 30 bits.
    pub const AXIS_MAX: u32 = 1024;

    /// An extent of `size` = (x, y, z) cells with edges of `cell_m` metres.
    ///
    /// # Errors
    /// If an axis is outside 1 to [`Extent::AXIS_MAX`], or `cell_m` is not a finite positive
    /// number.
    pub fn new(size: [u32; 3], cell_m: f64) -> Result<Self, ExtentError> {
        for (axis, cells) in ['x', 'y', 'z'].into_iter().zip(size) {
            if !(1..=Self::AXIS_MAX).contains(&cells) {
                return Err(ExtentError::Size { axis, cells });
            }
        }
        if !(cell_m.is_finite() && cell_m > 0.0) {
            return Err(ExtentError::CellLength(cell_m));
        }
        Ok(Self { size, cell_m })
    }

    /// The number of cells along x, y and z.
    #[inline]
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// The length of a cell's edge in metres.
    #[inline]
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// The number of cells in the map.
    #[inline]
    pub fn volume(&self) -> usize {
        self.size.iter().map(|&cells| cells as usize).product()
    }

    /// Whether `cell` lies in the map.
    #[inline]
    pub fn contains(&self, cell: Cell) -> bool {
        let [x, y, z] = self.size;
        // A negative coordinate becomes a number beyond every size.
        (cell.x as u32) < x && (cell.y as u32) < y && (cell.z as u32) < z
    }

    /// The index of `cell`, x fastest, or `None` outside the map.
    #[inline]
    pub fn index(&self, cell: Cell) -> Option<usize> {
        self.contains(cell).then(|| {
            let [size_x, size_y, _] = self.size.map(|cells| cells as usize);
            (cell.z as usize * size_y + cell.y as usize) * size_x + cell.x as usize
        })
    }

    /// The cell with this index; for an index of [`Extent::volume`] or more, a cell above the map.
    #[inline]
    pub fn cell_at(&self, index: usize) -> Cell {
        let [size_x, size_y, _] = self.size.map(|cells| cells as usize);
        let (row, x) = (index / size_x, index % size_x);
        Cell::new(x as i32, (row % size_y) as i32, (row / size_y) as i32)
    }

    /// All cells in index order.
    pub fn cells(&self) -> impl Iterator<Item = Cell> + use<> {
        let [x, y, z] = self.size.map(|cells| cells as i32);
        (0..z).flat_map(move |k| (0..y).flat_map(move |j| (0..x).map(move |i| Cell::new(i, j, k))))
    }

    /// The cell that holds a point of the map frame, which may lie outside the map.
    ///
    /// Coordinates beyond the range of `i32` are clamped to it and NaN becomes `i32::MIN`: both lie
    /// outside every map.
    #[inline]
    pub fn cell_of(&self, point: &Point3<f64>) -> Cell {
        let [x, y, z] = self.in_cells(point).map(|cells| if cells.is_nan() { i32::MIN } else { floor(cells) });
        Cell::new(x, y, z)
    }

    /// The coordinates of a point of the map frame in lengths of a cell.
    #[inline]
    pub fn in_cells(&self, point: &Point3<f64>) -> [f64; 3] {
        [point.x, point.y, point.z].map(|metres| metres / self.cell_m)
    }

    /// The centre of a cell in the map frame, in metres.
    #[inline]
    pub fn centre(&self, cell: Cell) -> Point3<f64> {
        let along = |cells: i32| (f64::from(cells) + 0.5) * self.cell_m;
        Point3::new(along(cell.x), along(cell.y), along(cell.z))
    }
}

/// The greatest integer that is not above a number, clamped to the range of `i32`; 0 for NaN.
///
/// `f64::floor` is a call of the C library on processors without SSE 4.1, which is what we compile
/// for.
#[inline]
pub(crate) fn floor(number: f64) -> i32 {
    let towards_zero = number as i32;
    towards_zero.saturating_sub(i32::from(f64::from(towards_zero) > number))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn floor_is_that_of_the_standard_library() {
        let edges = [0.0, 0.5, 1.0, 2_147_483_646.5, 2_147_483_647.0, 2_147_483_648.5, 1e300, f64::INFINITY];
        for number in edges.into_iter().flat_map(|edge| [edge, -edge, edge.next_down(), -edge.next_up()]) {
            assert_eq!(floor(number), number.floor() as i32, "{number}");
        }
        assert_eq!(floor(f64::NAN), 0);
    }

    #[test]
    fn refuses_empty_long_and_unmeasured_maps() {
        assert_eq!(Extent::new([1, 0, 1], 1.0), Err(ExtentError::Size { axis: 'y', cells: 0 }));
        let long = Extent::new([1, 1, 1025], 1.0).unwrap_err();
        assert_eq!(long.to_string(), "map size along z is 1025 cells, allowed are 1 to 1024");
        for cell_m in [0.0, -1.0, f64::INFINITY] {
            assert_eq!(Extent::new([1, 1, 1], cell_m), Err(ExtentError::CellLength(cell_m)));
        }
        assert!(Extent::new([1, 1, 1], f64::NAN).is_err());
        assert_eq!(Extent::new([1024; 3], 1.0).unwrap().volume(), 1 << 30);
    }

    #[test]
    fn points_are_rounded_down() {
        let extent = Extent::new([4, 4, 4], 0.5).unwrap();
        assert_eq!(extent.cell_of(&Point3::new(0.5, 0.49, -0.01)), Cell::new(1, 0, -1));
        let strange = extent.cell_of(&Point3::new(f64::NAN, 1e300, f64::NEG_INFINITY));
        assert_eq!(strange, Cell::new(i32::MIN, i32::MAX, i32::MIN));
        assert!(!extent.contains(strange));
    }

    #[test]
    fn cells_come_in_index_order() {
        let extent = Extent::new([3, 2, 4], 1.0).unwrap();
        let cells: Vec<Cell> = extent.cells().collect();
        assert!(cells.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(cells.len(), extent.volume());
        for (index, &cell) in cells.iter().enumerate() {
            assert_eq!(extent.index(cell), Some(index));
            assert_eq!(extent.cell_at(index), cell);
        }
        assert!(!extent.contains(extent.cell_at(extent.volume())));
    }

    proptest! {
        #[test]
        fn centre_lies_in_its_cell(
            x in -2000i32..2000, y in -2000i32..2000, z in -2000i32..2000, cell_m in 0.001f64..100.0,
        ) {
            let extent = Extent::new([1, 1, 1], cell_m).unwrap();
            let cell = Cell::new(x, y, z);
            prop_assert_eq!(extent.cell_of(&extent.centre(cell)), cell);
        }
    }
}
