//! [`Terrain`]: the material of a cell of the true world, and maps drawn as text.
//!
//! The world outside the map counts as wall.

use thiserror::Error;

use crate::{Cell, Extent, ExtentError, Grid};

/// The material of a cell of the true world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Terrain {
    /// A body may be here and a ray may pass.
    Free = 0,
    /// Solid.
    Wall = 1,
}

/// Whether `cell` is wall; a cell outside the map is.
#[inline]
pub fn is_wall_at(terrain: &Grid<Terrain>, cell: Cell) -> bool {
    terrain.get(cell) != Some(&Terrain::Free)
}

/// The reason why a text is not a map; lines and columns count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum TextError {
    /// There is no row at all.
    #[error("the text holds no rows of cells")]
    Empty,
    /// A character is none of the three allowed.
    #[error("line {line}, column {column}: {found:?} is no cell, allowed are '#' (wall), '.' and ' ' (free)")]
    Character {
        /// Line of the character.
        line: usize,
        /// Column of the character.
        column: usize,
        /// The refused character.
        found: char,
    },
    /// A row is longer or shorter than the first row.
    #[error("line {line}, column {column}: the row ends after {got} cells, the first row has {expected}")]
    RowLength {
        /// Line of the row.
        line: usize,
        /// First column that is missing or too many.
        column: usize,
        /// Cells in the first row.
        expected: usize,
        /// Cells in this row.
        got: usize,
    },
    /// A layer has more or fewer rows than the first layer.
    #[error("line {line}, column 1: the layer ends here with {got} rows, the first layer has {expected}")]
    LayerRows {
        /// Last line of the layer.
        line: usize,
        /// Rows in the first layer.
        expected: usize,
        /// Rows in this layer.
        got: usize,
    },
    /// The text is well formed and its size is not a legal extent.
    #[error(transparent)]
    Extent(#[from] ExtentError),
}

/// Rows of cells with the number of the line that each stands in.
type Layer<'a> = Vec<(usize, &'a str)>;

impl Grid<Terrain> {
    /// Reads a world of 1 m cells that is drawn as text.
    ///
    /// Layers go from the bottom (z = 0) to the top and are separated by empty lines. A layer reads
    /// like a map seen from above: its first line is the row with the highest y, x grows to the
    /// right. `#` is wall, `.` or a space is free.
    ///
    /// ```
    /// use voxels::{Cell, Grid, Terrain};
    /// let world = Grid::from_text("#.\n..\n\n##\n##\n")?;
    /// assert_eq!(world.extent().size(), [2, 2, 2]);
    /// assert_eq!(world.get(Cell::new(0, 1, 0)), Some(&Terrain::Wall));
    /// assert_eq!(world.get(Cell::new(0, 0, 0)), Some(&Terrain::Free));
    /// # Ok::<(), voxels::TextError>(())
    /// ```
    ///
    /// # Errors
    /// If a character is not allowed, rows or layers differ in size, or there is nothing; the error
    /// names line and column.
    pub fn from_text(text: &str) -> Result<Self, TextError> {
        let layers = layers(text);
        let columns = layers.first().ok_or(TextError::Empty)?[0].1.chars().count();
        let rows = layers[0].len();
        let size = [columns, rows, layers.len()].map(|cells| u32::try_from(cells).unwrap_or(u32::MAX));
        let extent = Extent::new(size, 1.0)?;
        // Checked before cells are allocated: a few long rows must not allocate cells that the text
        // does not have.
        for layer in &layers {
            check_shape(layer, rows, columns)?;
        }

        let mut terrain = Grid::new(extent, Terrain::Wall);
        let mut slots = terrain.as_mut_slice().chunks_mut(columns);
        for layer in &layers {
            for (&(line, row), slots) in layer.iter().rev().zip(&mut slots) {
                read_row(slots, line, row)?;
            }
        }
        Ok(terrain)
    }

    /// Draws the world as text that [`Grid::from_text`] reads; free cells become `.`.
    pub fn to_text(&self) -> String {
        let mut text = String::with_capacity(self.text_bytes());
        self.append_text(&mut text);
        text
    }

    /// The length of [`Grid::to_text`], bytes: a character for each cell, the ends of rows, and
    /// empty lines between layers.
    pub fn text_bytes(&self) -> usize {
        let [_, size_y, size_z] = self.extent().size().map(|cells| cells as usize);
        self.as_slice().len() + size_y * size_z + size_z - 1
    }

    /// Appends [`Grid::to_text`]. Takes no further memory if the text has room for
    /// [`Grid::text_bytes`].
    pub fn append_text(&self, text: &mut String) {
        let [size_x, size_y, _] = self.extent().size().map(|cells| cells as usize);
        for (z, layer) in self.as_slice().chunks(size_x * size_y).enumerate() {
            if z > 0 {
                text.push('\n');
            }
            for row in layer.chunks(size_x).rev() {
                text.extend(row.iter().map(|terrain| match terrain {
                    Terrain::Free => '.',
                    Terrain::Wall => '#',
                }));
                text.push('\n');
            }
        }
    }
}

fn layers(text: &str) -> Vec<Layer<'_>> {
    let mut layers: Vec<Layer<'_>> = Vec::new();
    let mut after_gap = true;
    for (index, row) in text.lines().enumerate() {
        if row.is_empty() {
            after_gap = true;
            continue;
        }
        if after_gap {
            layers.push(Vec::new());
            after_gap = false;
        }
        layers.last_mut().expect("the first row opened a layer").push((index + 1, row));
    }
    layers
}

fn check_shape(layer: &Layer<'_>, rows: usize, columns: usize) -> Result<(), TextError> {
    if layer.len() != rows {
        let line = layer[layer.len() - 1].0;
        return Err(TextError::LayerRows { line, expected: rows, got: layer.len() });
    }
    for &(line, row) in layer {
        let got = row.chars().count();
        if got != columns {
            return Err(TextError::RowLength { line, column: got.min(columns) + 1, expected: columns, got });
        }
    }
    Ok(())
}

fn read_row(slots: &mut [Terrain], line: usize, row: &str) -> Result<(), TextError> {
    for (column, (slot, found)) in slots.iter_mut().zip(row.chars()).enumerate() {
        *slot = match found {
            '#' => Terrain::Wall,
            '.' | ' ' => Terrain::Free,
            _ => {
                return Err(TextError::Character { line, column: column + 1, found });
            }
        };
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_layer_reads_like_a_map_from_above() {
        let world = Grid::from_text("#..\n...\n\n...\n..#\n").unwrap();
        assert_eq!(world.extent().size(), [3, 2, 2]);
        let walls: Vec<Cell> = world.iter().filter(|&(_, &t)| t == Terrain::Wall).map(|(cell, _)| cell).collect();
        assert_eq!(walls, [Cell::new(0, 1, 0), Cell::new(2, 0, 1)]);
    }

    #[test]
    fn outside_is_wall() {
        let world = Grid::from_text(".").unwrap();
        assert!(!is_wall_at(&world, Cell::new(0, 0, 0)));
        assert!(is_wall_at(&world, Cell::new(0, 0, 1)));
        assert!(is_wall_at(&world, Cell::new(-1, 0, 0)));
    }

    #[test]
    fn errors_name_line_and_column() {
        let message = |text: &str| Grid::from_text(text).unwrap_err().to_string();
        assert_eq!(message("\n\n"), "the text holds no rows of cells");
        assert_eq!(
            message("\n..\n.x\n"),
            "line 3, column 2: 'x' is no cell, allowed are '#' (wall), '.' and ' ' (free)"
        );
        assert_eq!(message("..\n...\n"), "line 2, column 3: the row ends after 3 cells, the first row has 2");
        assert_eq!(message("..\n.\n"), "line 2, column 2: the row ends after 1 cells, the first row has 2");
        assert_eq!(
            message("..\n..\n\n..\n"),
            "line 4, column 1: the layer ends here with 1 rows, the first layer has 2"
        );
        assert!(message(&".".repeat(1025)).contains("along x is 1025"));
    }

    proptest! {
        #[test]
        fn text_round_trip(
            size in prop::array::uniform3(1u32..6),
            bits in prop::collection::vec(any::<bool>(), 125),
        ) {
            let extent = Extent::new(size, 1.0).unwrap();
            let terrain = bits[..extent.volume()].iter().map(|&wall| if wall { Terrain::Wall } else { Terrain::Free });
            let world = Grid::from_vec(extent, terrain.collect()).unwrap();
            let text = world.to_text();
            prop_assert_eq!(text.len(), world.text_bytes());
            prop_assert_eq!(Grid::from_text(&text), Ok(world));
        }
    }
}
