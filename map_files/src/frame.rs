//! Conversion from positions in a file, in its axes and units, to cells of a map around them.
//!
//! Cells lie on multiples of the cell length in the file's coordinates, so that a file and a part
//! of it have the same cells. The map extends beyond the content of the file by the margin of the
//! options and one more layer of cells on every side.

use voxels::{Cell, Extent, ExtentError, Grid, Terrain};

use super::options::Up;
use super::{FormatError, ImportSpec, Note, new_grid};

/// Distance from a whole number, in lengths of cells, within which the end of a solid is that
/// number: files with numbers of 32 and of 64 bits get the same cells.
const WHOLE: f64 = 1e-3;

/// Length from which that of a map is probably in millimetres, metres.
const LONG_M: f64 = 5000.0;

/// Cells along the longest side up to which cells are probably too long.
const FEW_CELLS: f64 = 3.0;

/// Length from which it is shown as a power of ten, metres.
const HUGE_M: f64 = 1e9;

/// Axes, units and cells.
#[derive(Clone, Copy)]
pub(super) struct Units {
    up: Up,
    metres: f64,
    cell_m: f64,
    margin: f64,
}

impl Units {
    /// The axes and units of the options, with cells of the requested length, that of the file, or
    /// 1 m.
    ///
    /// # Errors
    /// If the cell length is illegal.
    pub(super) fn new(spec: &ImportSpec) -> Result<Self, FormatError> {
        let cell_m = spec.length_m();
        Extent::new([1; 3], cell_m).map_err(FormatError::Extent)?;
        let options = &spec.options;
        let margin = f64::from(options.margin_cells.unwrap_or(0));
        Ok(Self { up: options.up.unwrap_or(Up::Z), metres: options.scale.unwrap_or(1.0), cell_m, margin })
    }

    /// A frame of equal units with another axis that points upwards.
    pub(super) fn with_up(self, up: Up) -> Self {
        Self { up, ..self }
    }

    /// The length of a cell, metres.
    pub(super) fn length_m(&self) -> f64 {
        self.cell_m
    }

    /// The position in map axes, in lengths of cells.
    pub(super) fn cells(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let ours = match self.up {
            Up::Z => [x, y, z],
            Up::Y => [x, -z, y],
        };
        ours.map(|along| along * self.metres / self.cell_m)
    }
}

impl Units {
    /// The box of the option `crop`, in lengths of cells.
    pub(super) fn crop(&self, spec: &ImportSpec) -> Option<Bounds> {
        let [x, y, z, to_x, to_y, to_z] = spec.options.crop?.map(|along| along / self.cell_m);
        Some(Bounds { low: [x, y, z], high: [to_x, to_y, to_z] })
    }

    /// What makes a map of bounds that are too long for one.
    fn advice(&self, bounds: Bounds) -> String {
        let longest = (0..3).map(|axis| bounds.high[axis] - bounds.low[axis]).fold(0.0, f64::max);
        let longest_m = longest * self.cell_m;
        let around = 2.0 * (self.margin + 2.0);
        let least_m = longest_m / (f64::from(Extent::AXIS_MAX) - around);
        // Two digits, rounded up.
        let digit_m = libm::pow(10.0, libm::floor(libm::log10(least_m)) - 1.0);
        let rounded_m = libm::ceil(least_m / digit_m) * digit_m;
        let digits = libm::ceil(-libm::log10(digit_m)).clamp(0.0, 9.0) as usize;
        let rounded = if rounded_m < HUGE_M { format!("{rounded_m:.digits$}") } else { format!("{rounded_m:.2e}") };
        let longer = format!("choose cells of {rounded} m or longer (--cell-m)");
        let span = self.span(bounds);
        // Few places are longer than this, and many files are in millimetres.
        if longest_m >= LONG_M {
            let scale = self.metres / 1000.0;
            format!("it spans {span}: millimetres? --scale {scale}; else {longer}")
        } else {
            format!("it spans {span}; {longer}")
        }
    }

    /// Refuses bounds that lie in one cell.
    ///
    /// # Errors
    /// [`FormatError::TooSmall`].
    pub(super) fn check_span(&self, spec: &ImportSpec, bounds: Bounds) -> Result<(), FormatError> {
        if bounds.spans_more_than(1.0) || self.is_of_file(spec) {
            return Ok(());
        }
        Err(self.too_small(bounds, format!("no more than a cell of {} m", self.cell_m)))
    }

    /// Refuses a small map with one free cell or none, of a file within bounds.
    ///
    /// # Errors
    /// [`FormatError::TooSmall`].
    pub(super) fn check_free(&self, spec: &ImportSpec, bounds: Bounds, free: u64) -> Result<(), FormatError> {
        if free > 1 || bounds.spans_more_than(FEW_CELLS) || self.is_of_file(spec) {
            return Ok(());
        }
        Err(self.too_small(bounds, format!("{free} free cell(s) of {} m", self.cell_m)))
    }

    /// Whether the length of cells is that of the file, which knows what it holds.
    fn is_of_file(&self, spec: &ImportSpec) -> bool {
        spec.stored_cell_m() == Some(self.cell_m)
    }

    fn too_small(&self, bounds: Bounds, lack: String) -> FormatError {
        FormatError::TooSmall { span: self.span(bounds), lack }
    }

    /// The size of what lies within bounds, in metres.
    pub(super) fn span(&self, bounds: Bounds) -> String {
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let metres = (bounds.high[axis] - bounds.low[axis]) * self.cell_m;
            if metres >= HUGE_M {
                return format!("{metres:.3e}");
            }
            // Four digits tell metres from millimetres.
            let digits = if metres > 0.0 { libm::ceil(libm::log10(metres)).clamp(-9.0, 4.0) } else { 4.0 };
            format!("{metres:.*}", (4.0 - digits) as usize)
        });
        format!("{x} m x {y} m x {z} m, with scale = {}", self.metres)
    }
}

/// A box between two corners, in lengths of cells.
#[derive(Clone, Copy)]
pub(super) struct Bounds {
    /// The lowest coordinates.
    pub(super) low: [f64; 3],
    /// The highest ones.
    pub(super) high: [f64; 3],
}

impl Bounds {
    /// The bounds of positions; `None` without positions.
    pub(super) fn of(places: impl Iterator<Item = [f64; 3]>) -> Option<Self> {
        places.fold(None, |bounds: Option<Self>, place| {
            let Self { low, high } = bounds.unwrap_or(Self { low: place, high: place });
            let along = |axis: usize| (low[axis].min(place[axis]), high[axis].max(place[axis]));
            let [x, y, z] = [0, 1, 2].map(along);
            Some(Self { low: [x.0, y.0, z.0], high: [x.1, y.1, z.1] })
        })
    }
}

impl Bounds {
    /// Whether a position lies between them; the upper ones do not belong to it.
    pub(super) fn holds(&self, place: [f64; 3]) -> bool {
        (0..3).all(|axis| self.low[axis] <= place[axis] && place[axis] < self.high[axis])
    }

    /// The part of them in a box, at whose upper end no cell begins.
    pub(super) fn within(self, other: Self) -> Self {
        let [low, high] = [0, 1].map(|end| {
            [0, 1, 2].map(|axis| {
                let at = if end == 0 { self.low[axis] } else { self.high[axis] };
                at.clamp(other.low[axis], other.high[axis].next_down().max(other.low[axis]))
            })
        });
        Self { low, high }
    }

    /// The cells that hold a part of them: the first ones, and those after the last.
    pub(super) fn cells(&self) -> [[i32; 3]; 2] {
        // The casts saturate beyond any map.
        let first = self.low.map(|along| libm::floor(along + WHOLE) as i32);
        [first, self.high.map(|along| libm::ceil(along - WHOLE) as i32)]
    }

    /// Whether one side is longer than so many cells.
    fn spans_more_than(self, cells: f64) -> bool {
        (0..3).any(|axis| self.high[axis] - self.low[axis] > cells)
    }
}

/// The position of the cells of a map in the file.
pub(super) struct Frame {
    units: Units,
    /// The lowest corner of the map in lengths of cells, whole numbers.
    low: [f64; 3],
    extent: Extent,
}

impl Frame {
    /// The cells that hold `bounds`, the upper ends of which are cells of their own if `is_closed`,
    /// the margin, and a layer around it.
    ///
    /// # Errors
    /// If there are too many cells.
    pub(super) fn around(units: Units, bounds: Bounds, is_closed: bool) -> Result<Self, FormatError> {
        let rounding = if is_closed { 0.0 } else { WHOLE };
        let first = bounds.low.map(|along| libm::floor(along + rounding));
        let low = first.map(|along| along - units.margin - 1.0);
        let mut size = [0; 3];
        for axis in 0..3 {
            let high = bounds.high[axis];
            let end = if is_closed { libm::floor(high) + 1.0 } else { libm::ceil(high - rounding) };
            // The cast saturates at a size larger than any map.
            size[axis] = (end.max(first[axis] + 1.0) + units.margin + 1.0 - low[axis]) as u32;
        }
        let in_cells = |reason: ExtentError| {
            let advice = units.advice(bounds);
            FormatError::Box { reason, cell_m: units.cell_m, advice }
        };
        Ok(Self { units, low, extent: Extent::new(size, units.cell_m).map_err(in_cells)? })
    }

    /// A map of these cells.
    ///
    /// # Errors
    /// If there is no memory for them, or they are more than allowed.
    pub(super) fn grid(&self, fill: Terrain, spec: &ImportSpec) -> Result<Grid<Terrain>, FormatError> {
        new_grid(self.extent, fill, spec)
    }

    /// The part of a map in the box of the option `crop`, with a layer of wall around it; moves the
    /// frame with it.
    ///
    /// # Errors
    /// If nothing of the map lies in the box.
    pub(super) fn cropped(
        &mut self,
        terrain: Grid<Terrain>,
        spec: &ImportSpec,
    ) -> Result<(Grid<Terrain>, Option<Note>), FormatError> {
        let Some(crop) = self.units.crop(spec) else { return Ok((terrain, None)) };
        let [first, end] = crop.cells();
        let (mut low, mut size) = ([0; 3], [0; 3]);
        for axis in 0..3 {
            let begin = self.low[axis] as i32;
            let cells = self.extent.size()[axis] as i32;
            low[axis] = first[axis].saturating_sub(begin).clamp(0, cells);
            let last = end[axis].saturating_sub(begin).clamp(0, cells);
            if last <= low[axis] {
                return Err(FormatError::Nothing("cell inside the box of crop"));
            }
            size[axis] = (last - low[axis]) as u32 + 2;
        }
        let extent = Extent::new(size, self.units.cell_m).map_err(FormatError::Extent)?;
        let mut part = new_grid(extent, Terrain::Wall, spec)?;
        let outermost = size.map(|cells| cells as i32 - 1);
        for (cell, slot) in extent.cells().zip(part.as_mut_slice()) {
            let at = [cell.x, cell.y, cell.z];
            let is_inner = (0..3).all(|axis| (1..outermost[axis]).contains(&at[axis]));
            let [x, y, z] = [0, 1, 2].map(|axis| at[axis] + low[axis] - 1);
            if is_inner && let Some(&here) = terrain.get(Cell::new(x, y, z)) {
                *slot = here;
            }
        }
        self.low = [0, 1, 2].map(|axis| self.low[axis] + f64::from(low[axis] - 1));
        self.extent = extent;
        let text =
            format!("{} of {} cells kept, which lie inside the box", part.as_slice().len(), terrain.as_slice().len());
        Ok((part, Some(Note::new("crop", text))))
    }

    /// A position in lengths of cells, relative to the corner of the map.
    pub(super) fn in_map(&self, place: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| place[axis] - self.low[axis])
    }

    /// The cell of a position in lengths of cells.
    pub(super) fn cell(&self, place: [f64; 3]) -> Cell {
        let [x, y, z] = self.in_map(place).map(|along| libm::floor(along) as i32);
        Cell::new(x, y, z)
    }

    /// The cell of a position in the file.
    pub(super) fn cell_of_place(&self, place: [f64; 3]) -> Cell {
        self.cell(self.units.cells(place))
    }

    /// The lowest corner of the map in the file, after its axes and units have become ours, metres.
    pub(super) fn origin_m(&self) -> [f64; 3] {
        self.low.map(|along| along * self.units.cell_m)
    }

    /// An opening of a mesh around a position in the map and of an area, both in lengths of cells.
    pub(super) fn opening(&self, centre: [f64; 3], area: f64) -> String {
        let [x, y, z] = [0, 1, 2].map(|axis| (centre[axis] + self.low[axis]) * self.units.cell_m);
        let area_m2 = area * self.units.cell_m * self.units.cell_m;
        format!("{area_m2:.3} m2 around ({x:.3}, {y:.3}, {z:.3}) m")
    }

    /// A note with the origin of the map.
    pub(super) fn note(&self) -> Note {
        let [x, y, z] = self.origin_m();
        let turned = if self.units.up == Up::Y { ", after its y has become our z" } else { "" };
        Note::new("origin", format!("the map begins at ({x}, {y}, {z}) m of the file{turned}"))
    }
}
