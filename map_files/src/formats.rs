//! The registry of the file formats that are read, and the errors of all formats.

use std::fmt::{self, Display};
use std::path::{Path, PathBuf};

use thiserror::Error;
use voxels::{ExtentError, M3dmError, PackedError, TextError};

use mapgen::import_options::OptionError;

use super::export::WRITERS;
use super::{ImportSpec, Imported, dae, e57, gltf, las, m3dm, obj, octomap, pcd, plan, ply, sdf, stl, text, vox, xyz};

/// The cell length in the bytes of a file, metres.
pub(super) type CellLength = fn(&[u8]) -> Option<f64>;

/// The files that a file needs and that have not been looked for, relative to its folder.
pub(super) type Companions = fn(&ImportSpec) -> Vec<PathBuf>;

/// Where the files that a map file needs are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Search {
    /// Where their names, relative to the folder of the file, lead.
    Anywhere,
    /// Below the folder of the file, and models also below the folders of the option `model_path`.
    Models,
}

/// A reader of a file format. A new format is a module with one, and its line in [`READERS`].
#[derive(Debug)]
pub struct MapReader {
    /// What its files are, in a few words.
    pub name: &'static str,
    /// The extensions of its files, without the dot.
    pub extensions: &'static [&'static str],
    /// The import options that its files have.
    pub options: &'static [&'static str],
    /// The terrain that a file describes, unrepaired.
    pub(super) read: fn(&ImportSpec) -> Result<Imported, FormatError>,
    /// The cell length of a file, metres, without its cells being read; `None` where files of the
    /// format contain none.
    pub(super) stored_cell_m: Option<CellLength>,
    /// The files that a file needs, relative to its folder.
    pub(super) companions: Option<Companions>,
    /// Where these are looked for.
    pub(super) search: Search,
    /// Whether a file is read a piece at a time, of which the beginning is at hand.
    pub(super) in_pieces: Option<fn(&ImportSpec) -> bool>,
}

/// All formats of single files that are read.
pub const READERS: &[MapReader] = &[
    m3dm::READER,
    text::READER,
    octomap::READER,
    pcd::READER,
    ply::READER,
    obj::READER,
    stl::READER,
    gltf::READER,
    dae::READER,
    sdf::READER,
    vox::READER,
    plan::READER,
    plan::YAML_READER,
    xyz::READER,
    las::READER,
    e57::READER,
];

/// A position in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A byte offset, from 0.
    Byte(usize),
    /// A line number, from 1.
    Line(usize),
}

impl Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(at) => write!(f, "byte {at}"),
            Self::Line(number) => write!(f, "line {number}"),
        }
    }
}

/// The reason why bytes are not a map, or why a map cannot be written.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FormatError {
    /// The extension of the file's name is missing or unknown.
    #[error(
        "the file's extension is {}, known are {}{}",
        if_any(.0), listed(READERS.iter().flat_map(|reader| reader.extensions).copied()), remedy(.0)
    )]
    Extension(String),
    /// A file that another one names cannot be used.
    #[error("image {file}: {reason}")]
    Companion {
        /// The file, quoted.
        file: String,
        /// The reason.
        reason: String,
    },
    /// A floor plan has a file of its own for its picture.
    #[error("a map.yaml is written with its picture, in two files")]
    TwoFiles,
    /// The extension of a file to be written is missing, unknown, or that of a format that is only
    /// read.
    #[error(
        "the file's extension is {}, written are {}",
        if_any(.0), listed(WRITERS.iter().map(|writer| writer.extension))
    )]
    NotWritten(String),
    /// Malformed M3DM, or a map too large for it.
    #[error(transparent)]
    M3dm(#[from] M3dmError),
    /// Malformed packed M3DM.
    #[error(transparent)]
    Packed(#[from] PackedError),
    /// Not UTF-8.
    #[error("byte {0}: not UTF-8 text")]
    Utf8(usize),
    /// Malformed text map.
    #[error(transparent)]
    Text(#[from] TextError),
    /// Malformed content of another format.
    #[error("{place}: {reason}")]
    Content {
        /// The position of the fault.
        place: Place,
        /// The fault, and what is allowed.
        reason: String,
    },
    /// Malformed content of a document.
    #[error("{place}: {reason}")]
    Entry {
        /// The entry of the document.
        place: String,
        /// The fault, and what is allowed.
        reason: String,
    },
    /// The file is well formed and contains nothing to make a map of.
    #[error("the file has no {0}")]
    Nothing(&'static str),
    /// The size in the file is not a legal extent.
    #[error(transparent)]
    Extent(ExtentError),
    /// The content of the file does not fit into a map.
    #[error("{reason}, with cells of {cell_m} m; {advice}")]
    Box {
        /// The axis that is too long.
        reason: ExtentError,
        /// Length of a cell, metres.
        cell_m: f64,
        /// With what it fits.
        advice: String,
    },
    /// The content of the file lies in one cell, or leaves no more than one free.
    #[error("the file spans {span}: {lack}; choose shorter cells (--cell-m), or give the unit of the file (--scale)")]
    TooSmall {
        /// The size of its content.
        span: String,
        /// What is wrong with the map.
        lack: String,
    },
    /// The map has more cells than its reader allows.
    #[error(
        "the map has {cells} cells, allowed are {cells_max}; choose longer cells, or raise map.import.cells_max \
         (--cells-max)"
    )]
    TooManyCells {
        /// Cells of the map.
        cells: usize,
        /// Largest number of cells allowed.
        cells_max: usize,
    },
    /// A mesh has more triangles than any may have.
    #[error("the mesh has more than {triangles_max} triangles; simplify it, or take a part of it")]
    TooManyTriangles {
        /// Largest number of triangles allowed.
        triangles_max: usize,
    },
    /// The import takes more work than allowed.
    #[error(
        "the file takes more than {steps_max} steps of work; choose longer cells, or raise map.import.steps_max \
         (--steps-max)"
    )]
    TooMuchWork {
        /// Largest number of steps allowed.
        steps_max: u64,
    },
    /// The system has not enough memory.
    #[error("a map of {0} cells takes more memory than can be had")]
    Memory(usize),
    /// The cells of the file have another length than the requested one.
    #[error("the file has cells of {stored} m, asked for are cells of {asked} m; leave cell_m out, or let them agree")]
    CellLength {
        /// Cell length of the file, metres.
        stored: f64,
        /// Requested cell length, metres.
        asked: f64,
    },
    /// The requested cells do not consist of whole cells of the file.
    #[error("the file has cells of {stored} m, asked for are cells of {asked} m; allowed are multiples")]
    NoMultiple {
        /// Cell length of the file, metres.
        stored: f64,
        /// Requested cell length, metres.
        asked: f64,
    },
    /// An option has an illegal value.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// An option that the format does not have.
    #[error("{name} is not an option for .{extension} files, which have {}", some(.has))]
    NoOption {
        /// The option.
        name: &'static str,
        /// Extension of the format.
        extension: &'static str,
        /// Its options.
        has: &'static [&'static str],
    },
    /// An option for meshes, with a file of points.
    #[error("{name} is an option for meshes, and the file has no faces, only points")]
    NoFaces {
        /// The option.
        name: &'static str,
    },
    /// An option for points, with a file of a mesh.
    #[error("{name} is an option for point clouds, and the file has faces; leave it out, or remove the faces")]
    HasFaces {
        /// The option.
        name: &'static str,
    },
    /// A picture of a folder cannot be used.
    #[error("{file}: {reason}")]
    Layer {
        /// The picture, quoted.
        file: String,
        /// The reason.
        reason: String,
    },
    /// The space around the position given as free is narrower than the openings to close.
    #[error(
        "free_from = {},{},{} lies where a cube of {} cells has no room; choose another place, or a smaller gap_cells",
        .place[0], .place[1], .place[2], .gap + 1
    )]
    Narrow {
        /// In coordinates of the file, in its units.
        place: [f64; 3],
        /// The widest opening that is closed, cells.
        gap: u32,
    },
    /// The position given as free is wall or outside.
    #[error(
        "free_from = {},{},{} lies {}, expected a place in a free cell",
        .place[0], .place[1], .place[2], if *.is_outside { "outside the map" } else { "in wall" }
    )]
    FreeFrom {
        /// In coordinates of the file, in its units.
        place: [f64; 3],
        /// Whether it is outside the map.
        is_outside: bool,
    },
}

impl FormatError {
    /// An error at a byte.
    pub(super) fn byte(at: usize, reason: impl Into<String>) -> Self {
        Self::Content { place: Place::Byte(at), reason: reason.into() }
    }

    /// An error in a line.
    pub(super) fn line(number: usize, reason: impl Into<String>) -> Self {
        Self::Content { place: Place::Line(number), reason: reason.into() }
    }
}

impl MapReader {
    /// A reader of files that need no others and contain no cell length.
    pub(super) const fn new(
        name: &'static str,
        extensions: &'static [&'static str],
        options: &'static [&'static str],
        read: fn(&ImportSpec) -> Result<Imported, FormatError>,
    ) -> Self {
        let search = Search::Anywhere;
        Self { name, extensions, options, read, stored_cell_m: None, companions: None, search, in_pieces: None }
    }

    /// The reader of a file by the extension of its name, ignoring case.
    ///
    /// # Errors
    /// [`FormatError::Extension`], which lists the known extensions.
    pub fn of(file: &Path) -> Result<&'static Self, FormatError> {
        let extension = file.extension().unwrap_or_default().to_string_lossy();
        let reads = |reader: &&Self| reader.extensions.iter().any(|known| extension.eq_ignore_ascii_case(known));
        READERS.iter().find(reads).ok_or_else(|| FormatError::Extension(extension.into_owned()))
    }

    /// Whether files of this format may contain a cell length.
    #[must_use]
    pub fn may_store_cell_m(&self) -> bool {
        self.stored_cell_m.is_some()
    }

    /// The extension that a file of this format has.
    pub(super) fn extension_of(&self, file: &Path) -> &'static str {
        let extension = file.extension().unwrap_or_default();
        let known = self.extensions.iter().find(|known| extension.eq_ignore_ascii_case(known));
        known.unwrap_or(&self.extensions[0])
    }
}

/// Lists of options, one behind the other. `N` is the sum of their lengths.
///
/// # Panics
/// If it is another number; since this is for constants, when it is compiled.
pub(super) const fn joined<const N: usize>(lists: &[&[&'static str]]) -> [&'static str; N] {
    let mut all = [""; N];
    let (mut list, mut count) = (0, 0);
    while list < lists.len() {
        let mut place = 0;
        while place < lists[list].len() {
            all[count] = lists[list][place];
            (place, count) = (place + 1, count + 1);
        }
        list += 1;
    }
    assert!(count == N, "N is the sum of the lengths");
    all
}

/// Extensions as a text.
fn listed(extensions: impl Iterator<Item = &'static str>) -> String {
    let mut known: Vec<String> = extensions.map(|extension| format!(".{extension}")).collect();
    let last = known.pop().unwrap_or_default();
    format!("{} and {last}", known.join(", "))
}

/// What to do about a file of a kind that other programs turn into one that is read.
fn remedy(extension: &str) -> &'static str {
    match extension.to_ascii_lowercase().as_str() {
        "usd" | "usda" | "usdc" | "usdz" => "; USD is not read: save the stage as .glb or .obj (Blender imports it)",
        "off" | "3mf" => "; save it as .stl, .ply or .obj (trimesh and MeshLab read it)",
        "fbx" | "blend" | "3ds" | "dxf" | "step" | "stp" | "ifc" | "wrl" | "x3d" => "; export it as .glb, .obj or .stl",
        "rcp" | "rcs" | "fls" | "ptx" => "; export it as .e57 or .las",
        "db3" | "mcap" | "bag" => "; save its map (nav2 map_saver_cli) or its cloud (.pcd) as a file",
        _ => "",
    }
}

fn if_any(extension: &str) -> String {
    if extension.is_empty() { "missing".to_owned() } else { format!("{extension:?}") }
}

fn some(options: &[&str]) -> String {
    if options.is_empty() { "none".to_owned() } else { options.join(", ") }
}
