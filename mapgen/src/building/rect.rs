//! Rectangles of a floor plan, and blocks of the building that is carved from it.

use voxels::{Cell, Grid, Terrain};

/// A side of a rectangle: across which axis it looks (0 is x), and at which end of it (0 is the low
/// one).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Side {
    pub(super) axis: usize,
    pub(super) end: usize,
}

impl Side {
    pub(super) const ALL: [Self; 4] =
        [Self { axis: 0, end: 0 }, Self { axis: 0, end: 1 }, Self { axis: 1, end: 0 }, Self { axis: 1, end: 1 }];

    /// The unit step out of a rectangle through this side.
    pub(super) fn outward(self) -> [i32; 2] {
        let mut step = [0; 2];
        step[self.axis] = if self.end == 0 { -1 } else { 1 };
        step
    }
}

/// The cells from `low` up to `high`, which is not part of it; x, y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub(super) low: [i32; 2],
    pub(super) high: [i32; 2],
}

impl Rect {
    /// Cells along an axis.
    pub(super) fn along(&self, axis: usize) -> i32 {
        self.high[axis] - self.low[axis]
    }

    pub(super) fn area(&self) -> i64 {
        i64::from(self.along(0)) * i64::from(self.along(1))
    }

    pub(super) fn shortest_side(&self) -> i32 {
        self.along(0).min(self.along(1))
    }

    /// The part of it from `low` up to `high` along an axis.
    pub(super) fn between(mut self, axis: usize, low: i32, high: i32) -> Self {
        (self.low[axis], self.high[axis]) = (low, high);
        self
    }

    /// The `cells` layers of it that lie nearest to a side.
    pub(super) fn nearest(self, side: Side, cells: i32) -> Self {
        let Side { axis, end } = side;
        if end == 0 {
            self.between(axis, self.low[axis], self.low[axis] + cells)
        } else {
            self.between(axis, self.high[axis] - cells, self.high[axis])
        }
    }

    /// The rectangle without the `cells` layers nearest to a side; `None` if nothing is left.
    pub(super) fn without(self, side: Side, cells: i32) -> Option<Self> {
        let opposite = Side { end: 1 - side.end, ..side };
        let left = self.along(side.axis) - cells;
        (left > 0).then(|| self.nearest(opposite, left))
    }

    /// The layer of cells just outside a side.
    pub(super) fn beyond(self, side: Side) -> Self {
        let Side { axis, end } = side;
        if end == 0 {
            self.between(axis, self.low[axis] - 1, self.low[axis])
        } else {
            self.between(axis, self.high[axis], self.high[axis] + 1)
        }
    }

    /// The block above this rectangle, `height` layers from `base` up.
    pub(super) fn raised(self, base: i32, height: i32) -> Block {
        let ([low_x, low_y], [high_x, high_y]) = (self.low, self.high);
        Block { low: Cell::new(low_x, low_y, base), high: Cell::new(high_x, high_y, base + height) }
    }
}

/// The cells from `low` up to `high`, which is not part of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Block {
    low: Cell,
    high: Cell,
}

impl Block {
    /// Its cells, in cell order.
    pub(super) fn cells(self) -> impl Iterator<Item = Cell> {
        let Self { low, high } = self;
        (low.z..high.z)
            .flat_map(move |z| (low.y..high.y).flat_map(move |y| (low.x..high.x).map(move |x| Cell::new(x, y, z))))
    }

    /// Frees its cells, which lie in the map.
    pub(super) fn carve(self, terrain: &mut Grid<Terrain>) {
        let Self { low, high } = self;
        let extent = terrain.extent();
        for (z, y) in (low.z..high.z).flat_map(|z| (low.y..high.y).map(move |y| (z, y))) {
            let row = extent.index(Cell::new(low.x, y, z)).expect("what is planned lies in the map");
            terrain.as_mut_slice()[row..row + (high.x - low.x) as usize].fill(Terrain::Free);
        }
    }
}
