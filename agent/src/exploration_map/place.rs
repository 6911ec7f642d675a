//! Where a cell lies: its index, and which of its neighbours are inside the map.

/// The location of a cell.
pub(super) struct Place {
    pub(super) index: usize,
    pub(super) at: [i32; 3],
    size: [i32; 3],
    pub(super) strides: [isize; 3],
    /// Number of face neighbours outside the map.
    pub(super) outside: u8,
}

impl Place {
    /// The location of the cell with this index, which is inside the map.
    pub(super) fn of(cell: u32, [size_x, size_y, size_z]: [u32; 3]) -> Self {
        let row = cell / size_x;
        let at = [cell % size_x, row % size_y, row / size_y].map(u32::cast_signed);
        Self::new(at, [size_x, size_y, size_z])
    }

    /// The location of a cell inside the map.
    pub(super) fn new(at: [i32; 3], size: [u32; 3]) -> Self {
        let [size_x, size_y, _] = size.map(|cells| cells as usize);
        let strides = [1, size_x, size_x * size_y];
        let index = (0..3).map(|axis| at[axis] as usize * strides[axis]).sum();
        let size = size.map(u32::cast_signed);
        let outside = (0..3).map(|axis| outside_along(at[axis], size[axis])).sum();
        Self { index, at, size, strides: strides.map(usize::cast_signed), outside }
    }

    /// Whether all neighbours of all neighbours are inside the map.
    pub(super) fn is_deep_inside(&self) -> bool {
        (0..3).all(|axis| self.at[axis] >= 2 && self.at[axis] + 2 < self.size[axis])
    }

    /// The index of the neighbour one step along an axis, and its number of face neighbours outside
    /// the map.
    pub(super) fn beside(&self, axis: usize, step: i32) -> Option<(usize, u8)> {
        let at = self.at[axis] + step;
        let index = self.index.checked_add_signed(self.strides[axis] * step as isize)?;
        let size = self.size[axis];
        let outside = self.outside - outside_along(self.at[axis], size);
        (0..size).contains(&at).then(|| (index, outside + outside_along(at, size)))
    }
}

/// How many of the two neighbours along an axis are outside the map, for this coordinate and size.
fn outside_along(at: i32, size: i32) -> u8 {
    u8::from(at == 0) + u8::from(at + 1 == size)
}
