//! Map files with the files that they name, read as any file of a user.

use std::io;
use std::path::Path;

use mapgen::ImportSpec;

use crate::input_file::{self, MAP_BYTES_MAX};

/// A map file, and the picture of a `map.yaml` from its folder.
///
/// # Errors
/// See [`input_file::read`]; of a second file, the error names it.
pub fn load(file: &Path) -> io::Result<ImportSpec> {
    let mut spec = ImportSpec::new(file.display().to_string(), input_file::read(file, MAP_BYTES_MAX)?);
    if let Some(named) = spec.names() {
        let other = file.parent().unwrap_or(Path::new("")).join(named);
        let bytes = input_file::read(&other, MAP_BYTES_MAX);
        spec.companion = Some(bytes.map_err(|error| {
            io::Error::new(error.kind(), format!("its image {:?}: {error}", other.display().to_string()))
        })?);
    }
    Ok(spec)
}
