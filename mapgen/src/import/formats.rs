//! The file formats of maps, and their errors.

use std::fmt::{self, Display};
use std::path::Path;

use thiserror::Error;
use voxels::{Extent, ExtentError, Grid, M3dmError, PackedError, Terrain, TextError, m3dm, packed};

use super::super::export;
use super::{ImportSpec, Imported, cell_length, gltf, las, obj, octomap, pcd, plan, ply, stack, stl, vox, xyz};

/// A file format for maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapFormat {
    /// The bit format of MAES3D, up to 127 cells per axis, and our packed one, `.m3dm`.
    M3dm,
    /// A world drawn with `#` and `.`, `.txt`.
    Text,
    /// A binary tree of OctoMap, `.bt`.
    OctoMap,
    /// A point cloud of the Point Cloud Library, `.pcd`.
    Pcd,
    /// A mesh or a point cloud in the Polygon File Format, `.ply`.
    Ply,
    /// A mesh in Wavefront's format, `.obj`.
    Obj,
    /// A mesh of triangles, `.stl`.
    Stl,
    /// A scene of meshes as text, `.gltf`.
    Gltf,
    /// A scene of meshes, `.glb`.
    Glb,
    /// A model of MagicaVoxel, `.vox`.
    Vox,
    /// A floor plan as a portable grey map, `.pgm`.
    Pgm,
    /// A floor plan as a picture, `.png`.
    Png,
    /// A map of ROS 2's map server, `.yaml`, with its picture in another file.
    Yaml,
    /// A full tree of OctoMap, `.ot`.
    FullOctoMap,
    /// Points as text, `.xyz`.
    Xyz,
    /// Points of a laser scanner, `.las`.
    Las,
    /// The same compressed, `.laz`.
    Laz,
    /// A folder of pictures, `.png`, one for each layer of cells.
    Stack,
}

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
    #[error("the file's extension is {}, known are {}", if_any(.0), MapFormat::extensions(|_| true))]
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
    /// A format that is only read.
    #[error("files of extension {extension:?} are not written, only {}", MapFormat::extensions(MapFormat::is_written))]
    NotWritten {
        /// Its extension.
        extension: &'static str,
    },
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
    #[error("{reason}, with cells of {cell_m} m; choose longer ones")]
    Box {
        /// The axis that is too long.
        reason: ExtentError,
        /// Length of a cell, metres.
        cell_m: f64,
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
    /// An option has an illegal value.
    #[error("{name} = {value}, allowed is {allowed}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its value.
        value: String,
        /// The allowed values.
        allowed: &'static str,
    },
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

impl MapFormat {
    /// All formats of single files.
    pub const ALL: [Self; 17] = [
        Self::M3dm,
        Self::Text,
        Self::OctoMap,
        Self::Pcd,
        Self::Ply,
        Self::Obj,
        Self::Stl,
        Self::Gltf,
        Self::Glb,
        Self::Vox,
        Self::Pgm,
        Self::Png,
        Self::Yaml,
        Self::FullOctoMap,
        Self::Xyz,
        Self::Las,
        Self::Laz,
    ];

    /// The extension of this format's files, without the dot.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::M3dm => "m3dm",
            Self::Text => "txt",
            Self::OctoMap => "bt",
            Self::Pcd => "pcd",
            Self::Ply => "ply",
            Self::Obj => "obj",
            Self::Stl => "stl",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
            Self::Vox => "vox",
            Self::Pgm => "pgm",
            Self::Png => "png",
            Self::Yaml => "yaml",
            Self::FullOctoMap => "ot",
            Self::Xyz => "xyz",
            Self::Las => "las",
            Self::Laz => "laz",
            Self::Stack => "png layer",
        }
    }

    /// The format of a file by the extension of its name, ignoring case.
    ///
    /// # Errors
    /// [`FormatError::Extension`], which lists the known extensions.
    pub fn of(file: &Path) -> Result<Self, FormatError> {
        let extension = file.extension().unwrap_or_default().to_string_lossy();
        let known = Self::ALL.into_iter().find(|format| extension.eq_ignore_ascii_case(format.extension()));
        known.ok_or_else(|| FormatError::Extension(extension.into_owned()))
    }

    /// Whether maps can be written in this format.
    #[must_use]
    pub fn is_written(self) -> bool {
        matches!(self, Self::M3dm | Self::Text | Self::OctoMap | Self::Obj | Self::Stl | Self::Yaml)
    }

    /// The import options that files of this format have.
    #[must_use]
    pub fn options(self) -> &'static [&'static str] {
        match self {
            Self::M3dm | Self::Vox => &["cells_max"],
            Self::Text => &[],
            Self::OctoMap | Self::FullOctoMap => &["unknown", "free_from", "cells_max"],
            Self::Pcd | Self::Xyz | Self::Las | Self::Laz => {
                &["up", "scale", "margin_cells", "free_from", "sensor", "unknown", "cells_max", "steps_max"]
            }
            Self::Ply => &[
                "fill",
                "inside",
                "up",
                "scale",
                "margin_cells",
                "free_from",
                "sensor",
                "unknown",
                "cells_max",
                "steps_max",
            ],
            Self::Obj | Self::Stl | Self::Gltf | Self::Glb => {
                &["fill", "inside", "up", "scale", "margin_cells", "free_from", "cells_max", "steps_max"]
            }
            Self::Pgm | Self::Png => &["height_cells", "threshold", "cells_max"],
            Self::Stack => &["threshold", "cells_max"],
            Self::Yaml => &["unknown", "height_cells", "cells_max"],
        }
    }

    /// The terrain that a file describes, unrepaired.
    pub(super) fn read(self, spec: &ImportSpec) -> Result<Imported, FormatError> {
        let bytes = spec.bytes.as_slice();
        match self {
            Self::M3dm if packed::is_packed(bytes) => {
                let terrain = packed::read(bytes, spec.cells_allowed()).map_err(|error| match error {
                    PackedError::TooLarge { cells, cells_max } => FormatError::TooManyCells { cells, cells_max },
                    error => error.into(),
                })?;
                Ok(Imported { terrain, notes: Vec::new(), stores_cell_m: true, origin_m: None, yaw_rad: 0.0 })
            }
            Self::M3dm => with_cells_of(m3dm::read(bytes)?, spec),
            Self::Text => {
                let text = str::from_utf8(bytes).map_err(|error| FormatError::Utf8(error.valid_up_to()))?;
                let text = text.strip_prefix('\u{feff}').unwrap_or(text);
                // Places in errors count the line of the length.
                let map = cell_length::skip(text);
                with_cells_of(Grid::from_text(&map)?, spec)
            }
            Self::OctoMap | Self::FullOctoMap => octomap::read(spec),
            Self::Pcd => pcd::read(spec),
            Self::Ply => ply::read(spec),
            Self::Obj => obj::read(spec),
            Self::Stl => stl::read(spec),
            Self::Gltf | Self::Glb => gltf::read(spec),
            Self::Vox => vox::read(spec),
            Self::Pgm | Self::Png => plan::read(spec),
            Self::Yaml => plan::read_yaml(spec),
            Self::Xyz => xyz::read(spec),
            Self::Las | Self::Laz => las::read(spec),
            Self::Stack => stack::read(spec),
        }
    }

    /// Whether files of this format contain a cell length.
    #[must_use]
    pub fn may_store_cell_m(self) -> bool {
        matches!(self, Self::M3dm | Self::OctoMap | Self::FullOctoMap | Self::Text | Self::Obj | Self::Stl | Self::Yaml)
    }

    /// The cell length of a file, metres.
    pub(super) fn stored_cell_m(self, bytes: &[u8]) -> Option<f64> {
        match self {
            Self::M3dm if packed::is_packed(bytes) => Some(packed::extent(bytes).ok()?.cell_m()),
            Self::OctoMap | Self::FullOctoMap => octomap::resolution_m(bytes).ok(),
            Self::Yaml => plan::resolution_m(bytes),
            _ => cell_length::of(self, bytes),
        }
    }

    /// Whether a map of this extent can be written in this format.
    ///
    /// # Errors
    /// [`FormatError::NotWritten`].
    pub fn check(self) -> Result<(), FormatError> {
        if self.is_written() { Ok(()) } else { Err(FormatError::NotWritten { extension: self.extension() }) }
    }

    /// The bytes of a file of this format, with the length of its cells. M3DM is packed if
    /// `is_packed`, and where a plain one cannot hold the map: if it has more than 127 cells along
    /// an axis, or if its cells are not 1 m long.
    ///
    /// # Errors
    /// If the format is only read, or takes two files ([`export::floor_plan`]), or if the memory
    /// for a text cannot be had.
    pub fn write(self, terrain: &Grid<Terrain>, is_packed: bool) -> Result<Vec<u8>, FormatError> {
        self.check()?;
        Ok(match self {
            Self::M3dm if !is_packed && terrain.extent().cell_m() == 1.0 => {
                m3dm::write(terrain).unwrap_or_else(|_too_large| packed::write(terrain))
            }
            Self::M3dm => packed::write(terrain),
            Self::OctoMap => export::octomap(terrain),
            Self::Obj => export::obj(terrain),
            Self::Stl => export::stl(terrain),
            Self::Yaml => return Err(FormatError::TwoFiles),
            _ => text_file(terrain)?,
        })
    }

    fn extensions(which: impl Fn(Self) -> bool) -> String {
        let known = Self::ALL.into_iter().filter(|&format| which(format));
        let mut known: Vec<String> = known.map(|format| format!(".{}", format.extension())).collect();
        let last = known.pop().unwrap_or_default();
        format!("{} and {last}", known.join(", "))
    }
}

/// A map that was read with cells of 1 m, with the length that it gets.
fn with_cells_of(terrain: Grid<Terrain>, spec: &ImportSpec) -> Result<Imported, FormatError> {
    let extent = Extent::new(terrain.extent().size(), spec.length_m()).map_err(FormatError::Extent)?;
    let terrain = Grid::from_vec(extent, terrain.into_vec()).expect("the size is its own");
    Ok(Imported { terrain, notes: Vec::new(), stores_cell_m: false, origin_m: None, yaw_rad: 0.0 })
}

/// A text file with the length of its cells.
fn text_file(terrain: &Grid<Terrain>) -> Result<Vec<u8>, FormatError> {
    let mut text = cell_length::line(terrain.extent());
    text.try_reserve_exact(terrain.text_bytes()).map_err(|_| FormatError::Memory(terrain.as_slice().len()))?;
    terrain.append_text(&mut text);
    Ok(text.into_bytes())
}

fn if_any(extension: &str) -> String {
    if extension.is_empty() { "missing".to_owned() } else { format!("{extension:?}") }
}

fn some(options: &[&str]) -> String {
    if options.is_empty() { "none".to_owned() } else { options.join(", ") }
}
