//! Map files of other programs: readers, which make a terrain of the content of a file, and
//! writers.
//!
//! A format is one module, and a line in [`READERS`] or [`WRITERS`]. Formats are recognised by the
//! extension of the file name; docs/maps.md has the rules. [`mapgen::repair`] gives what is read a
//! solid shell and connected free space. The readers are our own instead of crates because their
//! input is untrusted: they are bounded and fuzzed, each error names the position of the fault, and
//! memory is proportional to the size of the file. Crates decode only what is compressed, PNG and
//! LAZ, behind checks of sizes, XML, with a bound on its elements, and YAML.
//!
//! USD has no reader. Looked at: the crate openusd, whose releases since 0.7 need Rust 1.96; 0.6.0
//! opens files of usd-core 26.11, text, binary and packed, but makes room for as many paths and
//! tokens as a file says, so that one of a kilobyte aborts the process; the crate usd (0.0.9) binds
//! the library in C++.
//!
//! No file is opened here: bytes are arguments and results.

mod bytes;
mod cell_length;
mod cloud;
mod dae;
mod e57;
pub mod export;
mod formats;
mod frame;
mod free_space;
mod gltf;
mod las;
mod laz;
mod m3dm;
mod mesh;
mod obj;
mod octomap;
mod pcd;
mod picture;
mod pieces;
mod placing;
mod plan;
mod ply;
mod sdf;
mod stack;
mod stl;
mod text;
mod vox;
mod work_budget;
mod xml;
mod xyz;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use thiserror::Error;
use voxels::{Cell, Extent, Grid, Terrain, is_wall_at};

use mapgen::check_memory;
use mapgen::import_options::{self as options, ImportOptions};

pub use export::{MapWriter, WRITERS};
pub use formats::{FormatError, MapReader, Place, READERS, Search};
pub use pieces::{PieceReader, Pieces};

/// Largest number of cells of a map from a file, whatever its length, unless an option says
/// otherwise: a gibibyte where a reader takes 8 bytes for each cell.
const CELLS_MAX: usize = 1 << 27;

/// Largest number of cells for each byte of a file: a few bytes of a tree or of run lengths can
/// describe a cube of 1024 cells along each edge.
const CELLS_PER_BYTE_MAX: usize = 1 << 10;

/// Number of cells that any file may have, however short it is.
const CELLS_ALLOWED: usize = 1 << 24;

/// A map file to start from.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportSpec {
    /// Name of the file as the user wrote it; its extension decides how `bytes` are read.
    pub file: String,
    /// The content of the file, or its beginning.
    pub bytes: Vec<u8>,
    /// The whole file, if `bytes` are its beginning; see [`ImportSpec::is_read_in_pieces`].
    pub pieces: Option<Pieces>,
    /// The files that it [needs](ImportSpec::missing), by these names; `None` for those that were
    /// not found.
    pub companions: BTreeMap<PathBuf, Option<Companion>>,
    /// The content of the file of the option `trajectory`, if it has been read.
    pub trajectory: Option<Vec<u8>>,
    /// Names and contents of the pictures of a folder; empty for a file.
    pub layers: Vec<(String, Vec<u8>)>,
    /// The import options.
    pub options: ImportOptions,
    /// The requested length of a cell's edge, metres. `None`: that of the file, or 1 m if it has
    /// none.
    pub cell_m: Option<f64>,
    /// Largest number of cells allowed, unless the options say otherwise.
    pub cells_max: usize,
}

/// A file that a map file needs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Companion {
    /// Where it was found.
    pub path: PathBuf,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// The content of a map file, unrepaired.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The terrain, with the length of its cells.
    pub terrain: Grid<Terrain>,
    /// Notes on what was dropped, closed or chosen.
    pub notes: Vec<Note>,
    /// Whether the length of the cells is that of the file.
    pub stores_cell_m: bool,
    /// The lowest corner of the map in the coordinates of the file, after its axes and units have
    /// become ours, metres; `None` if the file has no coordinates.
    pub origin_m: Option<[f64; 3]>,
    /// The turn of the map about this corner in the file, radians; 0 but for floor plans.
    pub yaw_rad: f64,
}

/// A note of an import.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// Its subject, in a word.
    pub name: &'static str,
    /// Its text.
    pub text: String,
    /// Whether the map is probably not what its user wants.
    pub is_warning: bool,
}

/// The reason why a map file cannot be read.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{file}: {reason}")]
pub struct ImportError {
    /// The name of the file.
    pub file: String,
    /// The fault, with its position.
    pub reason: FormatError,
}

impl Note {
    fn new(name: &'static str, text: impl Into<String>) -> Self {
        Self { name, text: text.into(), is_warning: false }
    }

    fn warning(name: &'static str, text: impl Into<String>) -> Self {
        Self { is_warning: true, ..Self::new(name, text) }
    }
}

impl ImportSpec {
    /// A file with the default options of its format.
    #[must_use]
    pub fn new(file: impl Into<String>, bytes: Vec<u8>) -> Self {
        let cells_max = cells_max(bytes.len());
        let (companions, layers) = (BTreeMap::new(), Vec::new());
        Self {
            file: file.into(),
            bytes,
            pieces: None,
            companions,
            trajectory: None,
            layers,
            options: ImportOptions::default(),
            cell_m: None,
            cells_max,
        }
    }

    /// A file that is too large for memory, with its beginning, and otherwise as
    /// [`new`](Self::new).
    #[must_use]
    pub fn in_pieces(file: impl Into<String>, beginning: Vec<u8>, pieces: Pieces) -> Self {
        let cells_max = cells_max(usize::try_from(pieces.length()).unwrap_or(usize::MAX));
        Self { pieces: Some(pieces), cells_max, ..Self::new(file, beginning) }
    }

    /// Whether `bytes` need no more than the beginning of the file, because the rest is read in
    /// [`pieces`](Self::pieces): point clouds of plain binary records.
    #[must_use]
    pub fn is_read_in_pieces(&self) -> bool {
        self.format().ok().and_then(|format| format.in_pieces).is_some_and(|in_pieces| in_pieces(self))
    }

    /// Length of the whole file, bytes.
    fn length(&self) -> u64 {
        self.pieces.as_ref().map_or(self.bytes.len() as u64, Pieces::length)
    }

    /// A folder of pictures with the default options, of which each is a layer of cells.
    #[must_use]
    pub fn stack(folder: impl Into<String>, layers: Vec<(String, Vec<u8>)>) -> Self {
        let cells_max = cells_max(layers.iter().map(|(_, bytes)| bytes.len()).sum());
        Self { layers, cells_max, ..Self::new(folder, Vec::new()) }
    }

    /// The format by the extension of the name, or that of a folder.
    ///
    /// # Errors
    /// [`FormatError::Extension`].
    fn format(&self) -> Result<&'static MapReader, FormatError> {
        if self.layers.is_empty() { MapReader::of(Path::new(&self.file)) } else { Ok(&stack::READER) }
    }

    /// The names of the import options that files of this format have; none of an unknown one.
    #[must_use]
    pub fn options_of_format(&self) -> &'static [&'static str] {
        self.format().map_or(&[], |reader| reader.options)
    }

    /// Allows at least `cells`, the size of a map that is known from elsewhere.
    #[must_use]
    pub fn allowing(self, cells: usize) -> Self {
        Self { cells_max: self.cells_max.max(cells), ..self }
    }

    /// The names of files that this one needs and that have not been looked for, as the picture of
    /// a `map.yaml`, the data of a `.gltf` or the models of a world; none if it needs no more, or
    /// is faulty, which reading it reports. What is found may name others.
    #[must_use]
    pub fn missing(&self) -> Vec<PathBuf> {
        let companions = self.format().ok().and_then(|format| format.companions);
        let mut names = companions.map_or_else(Vec::new, |companions| companions(self));
        names.retain(|name| !self.companions.contains_key(name));
        names
    }

    /// How the files of this format are looked for.
    #[must_use]
    pub fn search(&self) -> Search {
        self.format().map_or(Search::Anywhere, |reader| reader.search)
    }

    /// The same map with a file that it needs, or the knowledge that there is none.
    #[must_use]
    pub fn with_companion(mut self, name: PathBuf, file: Option<Companion>) -> Self {
        self.companions.insert(name, file);
        let contents = self.companions.values().flatten().map(|file| file.bytes.len());
        let bytes = self.bytes.len() + contents.sum::<usize>();
        Self { cells_max: self.cells_max.max(cells_max(bytes)), ..self }
    }

    /// The same map with the contents of the files that it [needs](Self::missing), in this order.
    #[must_use]
    pub fn with_companions(self, contents: Vec<Vec<u8>>) -> Self {
        let found = self.missing().into_iter().zip(contents);
        found.fold(self, |spec, (name, bytes)| {
            let path = name.clone();
            spec.with_companion(name, Some(Companion { path, bytes }))
        })
    }

    /// The content of a file that this one needs, if it was found.
    fn companion(&self, name: &Path) -> Option<&[u8]> {
        self.companions.get(name)?.as_ref().map(|file| file.bytes.as_slice())
    }

    /// Reads the terrain, unrepaired.
    ///
    /// # Errors
    /// [`ImportError`] with the name of the file and the position of the fault; also if its cells
    /// have another length than the requested one.
    pub fn read(&self) -> Result<Imported, ImportError> {
        self.try_read().map_err(|reason| ImportError { file: self.file.clone(), reason })
    }

    fn try_read(&self) -> Result<Imported, FormatError> {
        let format = self.format()?;
        self.options.check()?;
        if let Some(name) = self.options.given().find(|name| !format.options.contains(name)) {
            let extension = format.extension_of(Path::new(&self.file));
            return Err(FormatError::NoOption { name, extension, has: format.options });
        }
        let mut imported = (format.read)(self)?;
        let stored = imported.terrain.extent().cell_m();
        imported.stores_cell_m |= self.stored_cell_m() == Some(stored);
        match self.cell_m {
            Some(asked) if stored != asked => Err(FormatError::CellLength { stored, asked }),
            _ => Ok(imported),
        }
    }

    /// The length of the cells that the file itself has, without its cells being read; `None` if it
    /// has none or is faulty.
    #[must_use]
    pub fn stored_cell_m(&self) -> Option<f64> {
        self.format().ok()?.stored_cell_m.and_then(|stored| stored(&self.bytes))
    }

    /// The length of the cells that the map gets, metres: the requested one, that of the file, or 1
    /// m.
    fn length_m(&self) -> f64 {
        self.cell_m.or_else(|| self.stored_cell_m()).unwrap_or(1.0)
    }

    /// Largest number of cells of the map.
    fn cells_allowed(&self) -> usize {
        self.options.cells_max.map_or(self.cells_max, |cells| usize::try_from(cells).unwrap_or(usize::MAX))
    }
}

/// Largest number of cells of a map from a file of `bytes` bytes.
fn cells_max(bytes: usize) -> usize {
    bytes.saturating_mul(CELLS_PER_BYTE_MAX).clamp(CELLS_ALLOWED, CELLS_MAX)
}

/// A map that was read with cells of 1 m, with the length that it gets.
fn with_cells_of(terrain: Grid<Terrain>, spec: &ImportSpec) -> Result<Imported, FormatError> {
    let extent = Extent::new(terrain.extent().size(), spec.length_m()).map_err(FormatError::Extent)?;
    let terrain = Grid::from_vec(extent, terrain.into_vec()).expect("the size is its own");
    Ok(Imported { terrain, notes: Vec::new(), stores_cell_m: false, origin_m: None, yaw_rad: 0.0 })
}

/// A grid with one value in every cell.
fn new_grid<T: Clone>(extent: Extent, fill: T, spec: &ImportSpec) -> Result<Grid<T>, FormatError> {
    let (cells, cells_max) = (extent.volume(), spec.cells_allowed());
    if cells > cells_max {
        return Err(FormatError::TooManyCells { cells, cells_max });
    }
    grid_in_memory(extent, fill)
}

/// The same of any number of cells for which there is memory.
fn grid_in_memory<T: Clone>(extent: Extent, fill: T) -> Result<Grid<T>, FormatError> {
    check_memory(extent, size_of::<T>()).map_err(|_| FormatError::Memory(extent.volume()))?;
    Ok(Grid::new(extent, fill))
}

/// The map with a layer of wall around it, if its outermost layer has a free cell and there is room
/// for one. The layer is none of the cells that a file may have.
fn surrounded(terrain: Grid<Terrain>) -> Result<(Grid<Terrain>, Option<Note>), FormatError> {
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
    let mut around = grid_in_memory(larger, Terrain::Wall)?;
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
