//! A world drawn with `#` and `.`.

use voxels::Grid;

use super::bytes::in_utf8;
use super::{FormatError, ImportSpec, Imported, MapReader, cell_length, with_cells_of};

/// A drawn world.
pub(super) const READER: MapReader =
    MapReader { stored_cell_m: Some(cell_length::in_first_line), ..MapReader::new("drawn world", &["txt"], &[], read) };

/// A map of a drawing.
fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let bytes = in_utf8(&spec.bytes);
    let text = str::from_utf8(&bytes).map_err(|error| FormatError::Utf8(error.valid_up_to()))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    // Places in errors count the line of the length.
    let map = cell_length::skip(text)?;
    with_cells_of(Grid::from_text(&map)?, spec)
}
