//! Imported maps: a file's bytes become a terrain, and a terrain becomes sound: its shell solid, its free cells connected.
//!
//! The reference claims this repair and does not do it (maes3d.md 1.12 d). Files are recognised by the extension of their name.
//! There is one file for each format; docs/maps.md has the rules. The readers are small and of this
//! project, because they take hostile bytes: each says where a fault is, and takes no memory that the file does not account for.
//!
//! Nothing here opens a file: the bytes come from the caller and go back to it.

mod bytes;
mod cloud;
mod formats;
mod frame;
mod mesh;
mod obj;
mod octomap;
mod options;
mod pcd;
mod pgm;
mod ply;
mod stl;
mod vox;

use std::path::Path;

use voxels::{Cell, Extent, Grid, Terrain, close_shell, is_wall_at, keep_largest_component};

use super::{GeneratedMap, MapError, check_memory, described};

pub use formats::{FormatError, MapFormat, Place};
pub use options::{Fill, ImportOptions, Kind, Up};

/// Layers of wall that an imported map gets on every side.
const SHELL_LAYERS: u32 = 1;

/// Cells of the largest map.
const CELLS_MAX: usize = (Extent::AXIS_MAX as usize).pow(3);

/// A map file to start from.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportSpec {
    /// Name of the file as the user wrote it; its extension decides how `bytes` are read.
    pub file: String,
    /// The content of the file.
    pub bytes: Vec<u8>,
    /// How it is read.
    pub options: ImportOptions,
    /// The length of a cell's edge that is asked for, metres. `None`: that of the file, or 1 m if it has none.
    pub cell_m: Option<f64>,
    /// Cells that the map may have at the most.
    pub cells_max: usize,
}

/// A map as it stands in its file.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The terrain, with the length of its cells.
    pub terrain: Grid<Terrain>,
    /// What was dropped, closed or chosen on the way.
    pub notes: Vec<Note>,
    /// Whether the length of the cells is that of the file.
    pub stores_cell_m: bool,
}

/// Something to say about an import.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// What it is about, in a word.
    pub name: &'static str,
    /// What there is to say.
    pub text: String,
}

impl Note {
    fn new(name: &'static str, text: impl Into<String>) -> Self {
        Self { name, text: text.into() }
    }
}

impl ImportSpec {
    /// A file that is read with the defaults of its format.
    #[must_use]
    pub fn new(file: impl Into<String>, bytes: Vec<u8>) -> Self {
        Self { file: file.into(), bytes, options: ImportOptions::default(), cell_m: None, cells_max: CELLS_MAX }
    }

    /// The terrain as it stands in the file.
    ///
    /// # Errors
    /// [`MapError::Import`] with the name of the file, and where in it the fault lies; so if it has cells of another length than
    /// is asked for.
    pub fn read(&self) -> Result<Imported, MapError> {
        self.try_read().map_err(|reason| MapError::Import { file: self.file.clone(), reason })
    }

    fn try_read(&self) -> Result<Imported, FormatError> {
        let format = MapFormat::of(Path::new(&self.file))?;
        self.options.check()?;
        if let Some(name) = self.options.given().find(|name| !format.options().contains(name)) {
            return Err(FormatError::NoOption { name, extension: format.extension(), has: format.options() });
        }
        let imported = format.read(self)?;
        let stored = imported.terrain.extent().cell_m();
        match self.cell_m {
            Some(asked) if stored != asked => Err(FormatError::CellLength { stored, asked }),
            _ => Ok(imported),
        }
    }

    /// The length of the cells that the file itself has, without its cells being read; `None` if it has none or is faulty.
    #[must_use]
    pub fn stored_cell_m(&self) -> Option<f64> {
        MapFormat::of(Path::new(&self.file)).ok()?.stored_cell_m(&self.bytes)
    }
}

/// Makes a map sound: closes its shell and keeps its largest cave. `file` is the name for the error, `seed` for the report.
///
/// # Errors
/// [`MapError::Memory`]; [`MapError::ImportEmpty`] if nothing free is left.
pub fn repair(file: &str, mut terrain: Grid<Terrain>, seed: u64) -> Result<GeneratedMap, MapError> {
    check_memory(terrain.extent(), super::GENERATION_CELL_BYTES)?;
    let shell_cells_closed = close_shell(&mut terrain, SHELL_LAYERS);
    let pockets = keep_largest_component(&mut terrain);
    if pockets.kept_cells == 0 {
        return Err(MapError::ImportEmpty { file: file.to_owned() });
    }
    Ok(described(terrain, seed, pockets, (None, None), shell_cells_closed))
}

/// One value for each cell, all the same.
fn new_grid<T: Clone>(extent: Extent, fill: T, cells_max: usize) -> Result<Grid<T>, FormatError> {
    let cells = extent.volume();
    if cells > cells_max {
        return Err(FormatError::TooManyCells { cells, cells_max });
    }
    check_memory(extent, size_of::<T>()).map_err(|_| FormatError::Memory(cells))?;
    Ok(Grid::new(extent, fill))
}

/// The map with a layer of wall around it, if its outermost layer has a free cell and there is room for one.
fn surrounded(terrain: Grid<Terrain>, cells_max: usize) -> Result<(Grid<Terrain>, Option<Note>), FormatError> {
    let extent = terrain.extent();
    let size = extent.size().map(|cells| cells + 2);
    let Ok(larger) = Extent::new(size, extent.cell_m()) else { return Ok((terrain, None)) };
    let last = extent.size().map(|cells| cells as i32 - 1);
    let is_open = terrain.iter().any(|(cell, &here)| {
        let is_outermost = [cell.x, cell.y, cell.z].into_iter().zip(last).any(|(at, last)| at == 0 || at == last);
        is_outermost && here == Terrain::Free
    });
    if !is_open {
        return Ok((terrain, None));
    }
    let mut around = new_grid(larger, Terrain::Wall, cells_max)?;
    for (cell, slot) in larger.cells().zip(around.as_mut_slice()) {
        let one_less = Cell::new(cell.x - 1, cell.y - 1, cell.z - 1);
        if !is_wall_at(&terrain, one_less) {
            *slot = Terrain::Free;
        }
    }
    Ok((around, Some(Note::new("shell", "a layer of wall was put around the map, which was open"))))
}

#[cfg(test)]
mod tests;
