//! The places between which a body moves on its paths, one for each cell.
//!
//! A passage is a whole number of cells wide. From the centres of cells half of one that is an even
//! number of cells wide is never reached: a body of 0.8 m would not pass two cells of 0.55 m. So a
//! body whose diameter, rounded up to whole cells, is an even number of them moves between the
//! corners of cells, and all others move between centres. Then a body passes every straight
//! passage along an axis in which it fits.

use nalgebra::{Point3, Vector3};

use crate::{Cell, Extent};

/// A diameter this little beyond a whole number of cells is rounded down to it.
const SNAP_CELLS: f64 = 2e-9;

/// Where the place of each cell is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BodyLattice {
    /// At its centre.
    #[default]
    Centres,
    /// At its lowest corner.
    Corners,
}

impl BodyLattice {
    /// That of a body of `radius_m` metres in cells of `cell_m` metres.
    #[must_use]
    pub fn of(radius_m: f64, cell_m: f64) -> Self {
        let cells = (2.0 * radius_m / cell_m - SNAP_CELLS).ceil();
        if cells >= 2.0 && cells % 2.0 == 0.0 { Self::Corners } else { Self::Centres }
    }

    /// How far the place of a cell is from its lowest corner along each axis, cells.
    #[must_use]
    pub fn offset_cells(self) -> f64 {
        match self {
            Self::Centres => 0.5,
            Self::Corners => 0.0,
        }
    }

    /// The place of a cell, metres, frame `map`.
    #[must_use]
    pub fn place(self, extent: Extent, cell: Cell) -> Point3<f64> {
        match self {
            Self::Centres => extent.centre(cell),
            Self::Corners => Point3::from(Vector3::from([cell.x, cell.y, cell.z].map(f64::from)) * extent.cell_m()),
        }
    }

    /// The cell whose place is nearest to a point (metres, frame `map`) along each axis.
    #[must_use]
    pub fn cell_near(self, extent: Extent, point: &Point3<f64>) -> Cell {
        match self {
            Self::Centres => extent.cell_of(point),
            Self::Corners => extent.cell_of(&(point + Vector3::repeat(extent.cell_m() / 2.0))),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn diameters_of_an_even_number_of_cells_use_corners() {
        let of = |radius_m: f64| BodyLattice::of(radius_m, 0.2);
        for radius_m in [0.0, 0.02, 0.1, 0.201, 0.3, 0.401, 0.5, f64::NAN, -1.0] {
            assert_eq!(of(radius_m), BodyLattice::Centres, "{radius_m}");
        }
        for radius_m in [0.101, 0.15, 0.2, 0.301, 0.4] {
            assert_eq!(of(radius_m), BodyLattice::Corners, "{radius_m}");
        }
    }

    proptest! {
        #[test]
        fn place_of_a_cell_is_nearest_to_itself(
            cell_m in 0.05..2.0_f64, cell in [0..1000_i32, 0..1000, 0..1000], by in [-0.49..0.49_f64, -0.49..0.49, -0.49..0.49],
        ) {
            let extent = Extent::new([1000; 3], cell_m).unwrap();
            let cell = Cell::new(cell[0], cell[1], cell[2]);
            for lattice in [BodyLattice::Centres, BodyLattice::Corners] {
                let place = lattice.place(extent, cell);
                prop_assert_eq!(lattice.cell_near(extent, &place), cell);
                prop_assert_eq!(lattice.cell_near(extent, &(place + Vector3::from(by) * cell_m)), cell);
            }
        }

        #[test]
        fn half_of_a_passage_in_which_a_body_fits_is_at_a_place(cell_m in 0.1..1.0_f64, radius_m in 0.1..0.6_f64) {
            let lattice = BodyLattice::of(radius_m, cell_m);
            let narrowest = (2.0 * radius_m / cell_m).ceil();
            let place_beside_wall = (0..).map(|cells| f64::from(cells) + lattice.offset_cells()).find(|&at| at * cell_m >= radius_m);
            prop_assert_eq!(place_beside_wall, Some(narrowest / 2.0));
        }
    }
}
