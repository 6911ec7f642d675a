//! Map files with the files that they name, and folders of pictures, read as any file of a user.

use std::io;
use std::path::{Path, PathBuf};

use map_files::ImportSpec;

use crate::input_file::{self, MAP_BYTES_MAX};

/// Most pictures of a folder, one for each layer of the highest map.
const LAYERS_MAX: usize = 1024;

/// A map file, and the picture of a `map.yaml` from its folder; of a folder, its PNG files.
///
/// # Errors
/// See [`input_file::read`]; of a second file, the error names it. If a folder has no picture, too
/// many of them, or more bytes than a map may have.
pub fn load(file: &Path) -> io::Result<ImportSpec> {
    if file.is_dir() {
        return load_folder(file);
    }
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

fn load_folder(folder: &Path) -> io::Result<ImportSpec> {
    let refuse = |reason: String| io::Error::new(io::ErrorKind::InvalidInput, reason);
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let name = PathBuf::from(entry?.file_name());
        if name.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
            names.push(name);
        }
        if names.len() > LAYERS_MAX {
            return Err(refuse(format!("a folder with more than {LAYERS_MAX} .png files")));
        }
    }
    if names.is_empty() {
        return Err(refuse("a folder without .png files; expected one for each layer of cells".to_owned()));
    }
    names.sort();
    let mut left = MAP_BYTES_MAX;
    let mut layers = Vec::new();
    for name in names {
        let bytes = input_file::read(&folder.join(&name), left)
            .map_err(|error| io::Error::new(error.kind(), format!("its layer {name:?}: {error}")))?;
        left -= bytes.len() as u64;
        layers.push((name.to_string_lossy().into_owned(), bytes));
    }
    Ok(ImportSpec::stack(folder.display().to_string(), layers))
}
