//! Map files with the files that they name, and folders of pictures, read as any file of a user.

use std::io;
use std::path::{Path, PathBuf};

use map_files::ImportSpec;

use crate::input_file::{self, MAP_BYTES_MAX};

/// Most pictures of a folder, one for each layer of the highest map.
const LAYERS_MAX: usize = 1024;

/// A map file, and the files that it names, as the picture of a `map.yaml`; of a folder, its PNG
/// files. Of files that come from others, see [`is_self_contained`].
///
/// # Errors
/// See [`input_file::read`]; of a second file, the error names it. If a folder has no picture, too
/// many of them, or more bytes than a map may have.
pub fn load(file: &Path) -> io::Result<ImportSpec> {
    if file.is_dir() {
        return load_folder(file);
    }
    let spec = ImportSpec::new(file.display().to_string(), input_file::read(file, MAP_BYTES_MAX)?);
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut left = MAP_BYTES_MAX.saturating_sub(spec.bytes.len() as u64);
    let mut companions = Vec::new();
    for named in spec.names() {
        let other = folder.join(named);
        let bytes = input_file::read(&other, left).map_err(|error| {
            io::Error::new(error.kind(), format!("it names {:?}: {error}", other.display().to_string()))
        })?;
        left -= bytes.len() as u64;
        companions.push(bytes);
    }
    Ok(spec.with_companions(companions))
}

/// Whether all files that a map file names lie below its folder, links followed. Whoever writes a
/// map file chooses what it names: if that is not the user of this machine, nothing else is read.
#[must_use]
pub fn is_self_contained(file: &Path) -> bool {
    let (Some(folder), Ok(bytes)) = (file.parent(), input_file::read(file, MAP_BYTES_MAX)) else { return false };
    let Ok(folder) = folder.canonicalize() else { return false };
    let names = ImportSpec::new(file.display().to_string(), bytes).names();
    names.iter().all(|name| folder.join(name).canonicalize().is_ok_and(|named| named.starts_with(&folder)))
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
