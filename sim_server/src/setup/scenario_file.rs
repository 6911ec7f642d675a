//! Scenarios as their files have them: text, overridden keys, the folder of paths, and the length
//! of the cells of a map file.

use std::path::{Path, PathBuf};

use map_files::MapReader;
use recording::Recording;
use recording::location::is_recording;
use simulation::scenario::{MapSection, Origins, Override, Scenario};
use system::input_file::{self, TEXT_BYTES_MAX};

use super::SetupError;
use crate::map_file;

/// Reads a scenario file, or the scenario of a recording (`.mcap`), and sets the overridden keys.
/// Paths in a scenario file start from its folder, those of overrides and recordings from the
/// working directory.
///
/// # Errors
/// If the file cannot be read or the scenario is not legal.
pub fn load(file: &Path, overrides: &[Override]) -> Result<Scenario, SetupError> {
    load_with_paths_from(folder_of(file), file, overrides)
}

/// The folder that the paths of a scenario file start from unless another is named; empty for a
/// recording: the working directory.
#[must_use]
pub fn folder_of(file: &Path) -> &Path {
    let folder = if is_recording(file) { None } else { file.parent() };
    folder.unwrap_or(Path::new(""))
}

/// [`load`], with the paths in a scenario file from another folder.
///
/// # Errors
/// See [`load`].
pub fn load_with_paths_from(folder: &Path, file: &Path, overrides: &[Override]) -> Result<Scenario, SetupError> {
    let folder = if is_recording(file) { Path::new("") } else { folder };
    parse_with_paths_from(folder, &file.display().to_string(), &text(file)?, overrides)
}

/// The text of a scenario file, or of the scenario of a recording.
///
/// # Errors
/// If the file cannot be read.
pub fn text(file: &Path) -> Result<String, SetupError> {
    let name = file.display().to_string();
    if is_recording(file) {
        return Ok(Recording::open(file)?.scenario().to_string());
    }
    let bytes =
        input_file::read(file, TEXT_BYTES_MAX).map_err(|source| SetupError::Read { file: name.clone(), source })?;
    String::from_utf8(bytes).map_err(|error| {
        let before = String::from_utf8_lossy(&error.as_bytes()[..error.utf8_error().valid_up_to()]).into_owned();
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|&character| character != '\n').count() + 1;
        SetupError::NoText { file: name, line, column }
    })
}

/// Lets the paths of a scenario file start from a folder, and those of overrides from the working
/// directory.
fn start_paths_from(folder: &Path, map: &mut MapSection, overrides: &[Override]) {
    if folder.as_os_str().is_empty() {
        return;
    }
    let is_typed = |keys: &[&str]| overrides.iter().any(|change| keys.contains(&change.key.as_str()));
    let absolute = |path: PathBuf| std::path::absolute(&path).unwrap_or(path);
    let has_typed_file = is_typed(&["map", "map.file"]);
    let place = |path: PathBuf, is_typed: bool| match (is_typed, has_typed_file) {
        (true, false) => absolute(path),
        (false, true) => folder.join(path),
        // It starts from where the map does.
        (true, true) | (false, false) => path,
    };
    let of_import = |key: &str| is_typed(&["map", "map.import", key]);
    let (has_typed_trajectory, has_typed_models) =
        (of_import("map.import.trajectory"), of_import("map.import.model_path"));
    map.import.trajectory = map.import.trajectory.take().map(|file| place(file, has_typed_trajectory));
    map.import.model_path = map
        .import
        .model_path
        .take()
        .map(|folders| folders.into_iter().map(|folder| place(folder, has_typed_models)).collect());
    if !has_typed_file {
        folder.clone_into(&mut map.folder);
    }
}

/// Parses a scenario with the overridden keys, and resolves it. `file` is the name for error
/// messages.
///
/// # Errors
/// If the scenario is not legal.
pub fn parse(file: &str, text: &str, overrides: &[Override]) -> Result<Scenario, SetupError> {
    parse_with_paths_from(Path::new(""), file, text, overrides)
}

/// [`parse`], with the paths in the text from a folder, and those of overrides from the working
/// directory.
///
/// # Errors
/// See [`parse`].
pub fn parse_with_paths_from(
    folder: &Path,
    file: &str,
    text: &str,
    overrides: &[Override],
) -> Result<Scenario, SetupError> {
    let mut scenario = Scenario::parse(file, text, overrides)?;
    start_paths_from(folder, &mut scenario.map, overrides);
    resolve(scenario, &Origins::new(file, text, overrides))
}

/// The scenario with the length of its cells. If it names none, the map file decides; the length is
/// 1 m if the file stores none or cannot be read, which is reported when the world is built.
///
/// # Errors
/// If the rest of the scenario does not fit cells of this length.
pub fn resolve(mut scenario: Scenario, origins: &Origins<'_>) -> Result<Scenario, SetupError> {
    if scenario.map.cell_m.is_none() {
        let stored = scenario.map.path().and_then(|map| {
            let stores = MapReader::of(&map).is_ok_and(MapReader::may_store_cell_m);
            if stores { map_file::stored_cell_m(&map) } else { None }
        });
        scenario.map.cell_m = Some(stored.unwrap_or(1.0));
        scenario.check(origins)?;
    }
    Ok(scenario)
}
