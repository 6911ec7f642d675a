//! Imported maps: a file's bytes become a terrain whose shell is solid and whose free cells are connected.
//!
//! The reference claims this repair and does not do it (maes3d.md 1.12 d). Files are recognised by the extension of
//! their name. Nothing here opens a file: the bytes come from the caller and go back to it.

use std::path::Path;

use thiserror::Error;
use voxels::{Extent, Grid, M3dmError, Terrain, TextError, close_shell, m3dm};

use super::{Draft, MapError};

/// Layers of wall that an imported map gets on every side.
const SHELL_LAYERS: u32 = 1;

/// A map file to start from.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportSpec {
    /// Name of the file as the user wrote it; its extension decides how `bytes` are read.
    pub file: String,
    /// The content of the file.
    pub bytes: Vec<u8>,
}

impl ImportSpec {
    /// The terrain as it stands in the file, with cells of 1 m; its size is the extent that [`super::generate`] wants.
    ///
    /// # Errors
    /// [`MapError::Import`] with the name of the file, and where in it the fault lies.
    pub fn read(&self) -> Result<Grid<Terrain>, MapError> {
        let read = || MapFormat::of(Path::new(&self.file))?.read(&self.bytes);
        read().map_err(|reason| MapError::Import { file: self.file.clone(), reason })
    }

    /// The terrain as it stands in the file, which must have the size of `extent`.
    pub(super) fn read_as(&self, extent: Extent) -> Result<Grid<Terrain>, MapError> {
        let terrain = self.read()?;
        let (got, expected) = (terrain.extent().size(), extent.size());
        if got != expected {
            return Err(MapError::ImportSize { file: self.file.clone(), got, expected });
        }
        Ok(Grid::from_vec(extent, terrain.into_vec()).expect("the sizes were compared"))
    }
}

/// Reads the map and closes its shell.
pub(super) fn draft(spec: &ImportSpec, extent: Extent) -> Result<Draft, MapError> {
    let mut terrain = spec.read_as(extent)?;
    let shell_cells_closed = close_shell(&mut terrain, SHELL_LAYERS);
    Ok(Draft { terrain, carved: None, shell_cells_closed })
}

/// A file format for maps; none of them stores the length of a cell's edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapFormat {
    /// The reference's bit format, `.m3dm`, up to 127 cells per axis.
    M3dm,
    /// A world drawn with `#` and `.`, `.txt`.
    Text,
}

/// Why bytes are not a map, or a map has no bytes in this format.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FormatError {
    /// The extension of the file's name is missing or unknown.
    #[error("the file's extension is {}, known are {}", if_any(.0), MapFormat::extensions())]
    Extension(String),
    /// Not M3DM, or too large for it.
    #[error(transparent)]
    M3dm(#[from] M3dmError),
    /// Not UTF-8.
    #[error("byte {0}: not UTF-8 text")]
    Utf8(usize),
    /// Not a world drawn as text.
    #[error(transparent)]
    Text(#[from] TextError),
}

impl MapFormat {
    /// All formats.
    pub const ALL: [Self; 2] = [Self::M3dm, Self::Text];

    /// The extension of this format's files, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::M3dm => "m3dm",
            Self::Text => "txt",
        }
    }

    /// The format of a file, by the extension of its name; upper and lower case are the same.
    ///
    /// # Errors
    /// [`FormatError::Extension`], which lists the known extensions.
    pub fn of(file: &Path) -> Result<Self, FormatError> {
        let extension = file.extension().unwrap_or_default().to_string_lossy();
        let known = Self::ALL.into_iter().find(|format| extension.eq_ignore_ascii_case(format.extension()));
        known.ok_or_else(|| FormatError::Extension(extension.into_owned()))
    }

    /// The terrain that `bytes` describe, unrepaired, with cells of 1 m.
    ///
    /// # Errors
    /// If the bytes are not of this format; the error names the place.
    pub fn read(self, bytes: &[u8]) -> Result<Grid<Terrain>, FormatError> {
        match self {
            Self::M3dm => Ok(m3dm::read(bytes)?),
            Self::Text => {
                let text = str::from_utf8(bytes).map_err(|error| FormatError::Utf8(error.valid_up_to()))?;
                Ok(Grid::from_text(text)?)
            }
        }
    }

    /// Whether the format has room for a map of this extent.
    ///
    /// # Errors
    /// [`FormatError::M3dm`] with the axis that is too long.
    pub fn check(self, extent: Extent) -> Result<(), FormatError> {
        let too_long = |&(_, cells): &(char, u32)| self == Self::M3dm && cells > m3dm::AXIS_MAX;
        match ['x', 'y', 'z'].into_iter().zip(extent.size()).find(too_long) {
            Some((axis, cells)) => Err(M3dmError::TooLarge { axis, cells }.into()),
            None => Ok(()),
        }
    }

    /// The bytes of a file of this format.
    ///
    /// # Errors
    /// If the format has no room for a map of this extent.
    pub fn write(self, terrain: &Grid<Terrain>) -> Result<Vec<u8>, FormatError> {
        match self {
            Self::M3dm => Ok(m3dm::write(terrain)?),
            Self::Text => Ok(terrain.to_text().into_bytes()),
        }
    }

    fn extensions() -> String {
        Self::ALL.map(|format| format!(".{}", format.extension())).join(" and ")
    }
}

fn if_any(extension: &str) -> String {
    if extension.is_empty() { "missing".to_owned() } else { format!("{extension:?}") }
}
