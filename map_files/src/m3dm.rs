//! The bit format of MAES3D, up to 127 cells per axis, and the packed one of this project.

use voxels::{PackedError, m3dm, packed};

use super::{FormatError, ImportSpec, Imported, MapReader, with_cells_of};

/// A plain or packed map.
pub(super) const READER: MapReader = MapReader {
    stored_cell_m: Some(stored_cell_m),
    ..MapReader::new("map of MAES3D", &["m3dm"], &["cells_max"], read)
};

/// A map of a plain or packed file.
fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    if !packed::is_packed(&spec.bytes) {
        return with_cells_of(m3dm::read(&spec.bytes)?, spec);
    }
    let terrain = packed::read(&spec.bytes, spec.cells_allowed()).map_err(|error| match error {
        PackedError::TooLarge { cells, cells_max } => FormatError::TooManyCells { cells, cells_max },
        error => error.into(),
    })?;
    Ok(Imported { terrain, notes: Vec::new(), stores_cell_m: true, origin_m: None, yaw_rad: 0.0 })
}

/// The length of the cells of a packed file, metres.
fn stored_cell_m(bytes: &[u8]) -> Option<f64> {
    packed::is_packed(bytes).then(|| packed::extent(bytes).ok()).flatten().map(|extent| extent.cell_m())
}
