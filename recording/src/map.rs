//! The true map of a recorded run, which is an attachment of its recording.

use map_files::{ImportError, ImportSpec};
use simulation::scenario::Scenario;
use thiserror::Error;
use voxels::{Grid, Terrain};

use crate::Recording;

/// The attachment is no map.
#[derive(Debug, Error)]
#[error("the map of the recording: {source}")]
pub struct RecordedMapError {
    source: ImportError,
}

/// The map of a recording, if it has one.
///
/// # Errors
/// If the attachment is no map.
pub fn read(recording: &Recording, scenario: &Scenario) -> Result<Option<Grid<Terrain>>, RecordedMapError> {
    let Some(import) = attached(recording, scenario) else { return Ok(None) };
    let import = ImportSpec { cell_m: scenario.map.cell_m, ..import };
    Ok(Some(import.read().map_err(|source| RecordedMapError { source })?.terrain))
}

/// The attachment that holds the map, unread. A generated map has the size in the scenario.
#[must_use]
pub fn attached(recording: &Recording, scenario: &Scenario) -> Option<ImportSpec> {
    let size = scenario.map.size.map_or([0; 3], |size| size.cells());
    let (name, bytes) = recording.map_attachment()?;
    Some(ImportSpec::new(name, bytes.to_vec()).allowing(size.iter().map(|&cells| cells as usize).product()))
}
