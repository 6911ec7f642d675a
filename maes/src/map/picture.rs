//! A picture of a map in three dimensions, by the page's own renderer.
//!
//! The page reads a packed M3DM file from a temporary folder, whose name is in the caption.

use std::path::Path;

use foxglove_server::capture::{self, MapPicture};
use sim_server::exit;
use voxels::{Grid, Terrain, packed};

use super::{CheckArgs, MapCliError};

/// Renders a map into a file.
pub(super) fn draw(terrain: &Grid<Terrain>, args: &CheckArgs, file: &Path) -> Result<(), MapCliError> {
    let failed = |reason: String, is_bad_input| MapCliError::Render { file: file.to_path_buf(), reason, is_bad_input };
    let cut = args.cut.map(|cut| cut.share(terrain, &args.file)).transpose()?;
    let folder = tempfile::tempdir().map_err(|error| failed(error.to_string(), false))?;
    let map = folder.path().join(format!("{}.m3dm", plain_stem(&args.file)));
    std::fs::write(&map, packed::write(terrain)).map_err(|error| failed(error.to_string(), false))?;
    let picture = MapPicture { map: &map, size: args.picture_size, cut, page: args.page.as_deref() };
    capture::take_map(&picture, file).map_err(|error| {
        let is_bad_input = capture::exit_code(&error) == exit::BAD_INPUT;
        failed(error.to_string(), is_bad_input)
    })
}

/// The name of a file without its extension, of the characters that need no escaping in an address.
fn plain_stem(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let is_plain = |character: &char| character.is_ascii_alphanumeric() || ['-', '_', '.'].contains(character);
    let plain: String = stem.chars().filter(is_plain).collect();
    if plain.is_empty() { "map".to_owned() } else { plain }
}
