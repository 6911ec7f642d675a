//! [`Grid`]: one value per cell of an [`Extent`], stored densely in index order.
//!
//! Invariant: a grid always holds exactly `extent.volume()` values.

use std::ops::{Index, IndexMut};

use thiserror::Error;

use crate::{Cell, Extent};

/// One value per cell, x fastest.
///
/// ```
/// use voxels::{Cell, Extent, Grid};
/// let mut heights = Grid::new(Extent::new([2, 2, 1], 1.0)?, 0u8);
/// heights.set(Cell::new(1, 0, 0), 7);
/// assert_eq!(heights.get(Cell::new(1, 0, 0)), Some(&7));
/// assert_eq!(heights.get(Cell::new(2, 0, 0)), None);
/// assert_eq!(heights[1], 7);
/// # Ok::<(), voxels::ExtentError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T> {
    extent: Extent,
    values: Vec<T>,
}

/// The reason why a [`Grid`] cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum GridError {
    /// The number of values does not match the extent.
    #[error("a grid of {expected} cells was given {got} values")]
    Length {
        /// The volume of the extent.
        expected: usize,
        /// The number of values given.
        got: usize,
    },
}

impl<T> Grid<T> {
    /// A grid that holds `fill` in every cell.
    pub fn new(extent: Extent, fill: T) -> Self
    where
        T: Clone,
    {
        Self { extent, values: vec![fill; extent.volume()] }
    }

    /// A grid of values given in index order.
    ///
    /// # Errors
    /// If the number of values is not the extent's volume.
    pub fn from_vec(extent: Extent, values: Vec<T>) -> Result<Self, GridError> {
        if values.len() != extent.volume() {
            return Err(GridError::Length { expected: extent.volume(), got: values.len() });
        }
        Ok(Self { extent, values })
    }

    /// The extent that this grid covers.
    #[inline]
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// The value in `cell`, or `None` outside the map.
    #[inline]
    pub fn get(&self, cell: Cell) -> Option<&T> {
        self.extent.index(cell).map(|index| &self.values[index])
    }

    /// The value in `cell` for writing, or `None` outside the map.
    #[inline]
    pub fn get_mut(&mut self, cell: Cell) -> Option<&mut T> {
        self.extent.index(cell).map(|index| &mut self.values[index])
    }

    /// Puts a value into `cell` and returns the value that was there; outside the map nothing
    /// happens and the answer is `None`.
    #[inline]
    pub fn set(&mut self, cell: Cell, value: T) -> Option<T> {
        self.get_mut(cell).map(|slot| std::mem::replace(slot, value))
    }

    /// All values in index order.
    #[inline]
    pub fn as_slice(&self) -> &[T] {
        &self.values
    }

    /// All values in index order, for writing.
    #[inline]
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// The values in index order, without a copy.
    pub fn into_vec(self) -> Vec<T> {
        self.values
    }

    /// All cells with their values, in index order.
    pub fn iter(&self) -> impl Iterator<Item = (Cell, &T)> {
        self.extent.cells().zip(&self.values)
    }
}

/// The value with this cell index; panics like a slice if the index is not below the volume.
impl<T> Index<usize> for Grid<T> {
    type Output = T;

    fn index(&self, index: usize) -> &T {
        &self.values[index]
    }
}

impl<T> IndexMut<usize> for Grid<T> {
    fn index_mut(&mut self, index: usize) -> &mut T {
        &mut self.values[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent() -> Extent {
        Extent::new([3, 2, 2], 1.0).unwrap()
    }

    #[test]
    fn from_vec_counts_the_values() {
        let error = Grid::from_vec(extent(), vec![0; 11]).unwrap_err();
        assert_eq!(error.to_string(), "a grid of 12 cells was given 11 values");
        assert!(Grid::from_vec(extent(), vec![0; 12]).is_ok());
    }

    #[test]
    fn iterates_in_index_order() {
        let grid = Grid::from_vec(extent(), (0..12).collect()).unwrap();
        for (index, (cell, &value)) in grid.iter().enumerate() {
            assert_eq!(value, index);
            assert_eq!(grid.get(cell), Some(&index));
            assert_eq!(grid[index], index);
        }
        assert_eq!(grid.iter().count(), 12);
    }

    #[test]
    fn writing_outside_changes_nothing() {
        let mut grid = Grid::new(extent(), 1);
        assert_eq!(grid.set(Cell::new(0, 0, 2), 5), None);
        assert_eq!(grid.set(Cell::new(0, 0, 1), 5), Some(1));
        assert_eq!(grid.as_slice().iter().sum::<i32>(), 16);
    }
}
