//! Map files with the files that they name, and folders of pictures, read as any file of a user.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use map_files::{Companion, ImportSpec, PieceReader, Pieces, Search};
use mapgen::ImportOptions;

use system::input_file::{self, MAP_BYTES_MAX};

/// A point cloud of plain records that is longer than this is read in pieces, bytes.
const WHOLE_BYTES_MAX: u64 = 1 << 27;

/// Largest file that is read in pieces, bytes.
const PIECES_BYTES_MAX: u64 = 1 << 40;

/// What is read of the beginning of such a file: its header, with room to spare.
const BEGINNING_BYTES: u64 = 1 << 20;

/// Most pictures of a folder, one for each layer of the highest map.
const LAYERS_MAX: usize = 1024;

/// Most files that a map file may need, those of its models included.
const COMPANIONS_MAX: usize = 4096;

/// How the name of a file of a model begins.
const MODEL: &str = "model:";

/// A map file that is read with these options, and the files that it and they name, as the picture
/// of a `map.yaml`; of a folder, its PNG files. Of files that come from others, see
/// [`is_self_contained`].
///
/// # Errors
/// See [`input_file::read`]; of a second file, the error names it. If a folder has no picture, too
/// many of them, or more bytes than a map may have; if a file needs too many others.
pub fn load(file: &Path, options: &ImportOptions) -> io::Result<ImportSpec> {
    load_whole(file, options, WHOLE_BYTES_MAX)
}

/// As [`load`]; a file that is longer than `whole_bytes_max` is read in pieces if its format is.
fn load_whole(file: &Path, options: &ImportOptions, whole_bytes_max: u64) -> io::Result<ImportSpec> {
    if file.is_dir() {
        return Ok(ImportSpec { options: options.clone(), ..load_folder(file)? });
    }
    let mut spec = match in_pieces(file, options, whole_bytes_max)? {
        Some(spec) => spec,
        None => {
            let spec = ImportSpec::new(file.display().to_string(), input_file::read(file, MAP_BYTES_MAX)?);
            ImportSpec { options: options.clone(), ..spec }
        }
    };
    let named = |file: &Path, error: io::Error| {
        io::Error::new(error.kind(), format!("it names {:?}: {error}", file.display().to_string()))
    };
    if let Some(trajectory) = &options.trajectory {
        let bytes = input_file::read(trajectory, MAP_BYTES_MAX).map_err(|error| named(trajectory, error))?;
        spec.trajectory = Some(bytes);
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut left = MAP_BYTES_MAX.saturating_sub(spec.bytes.len() as u64);
    loop {
        let missing = spec.missing();
        if missing.is_empty() {
            return Ok(spec);
        }
        if spec.companions.len() + missing.len() > COMPANIONS_MAX {
            let reason = format!("it needs more than {COMPANIONS_MAX} other files");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        for name in missing {
            let path = match spec.search() {
                Search::Anywhere => Some(folder.join(&name)),
                Search::Models => find(&name, folder, options.model_path.as_deref().unwrap_or_default()),
            };
            let companion = match path {
                None => None,
                Some(path) => {
                    let bytes = input_file::read(&path, left).map_err(|error| named(&path, error))?;
                    left -= bytes.len() as u64;
                    Some(Companion { path, bytes })
                }
            };
            spec = spec.with_companion(name, companion);
        }
    }
}

/// The length of the cells that a map file itself has, metres; `None` if it has none or cannot be
/// read.
#[must_use]
pub fn stored_cell_m(file: &Path) -> Option<f64> {
    let pieces = in_pieces(file, &ImportOptions::default(), WHOLE_BYTES_MAX).ok()?;
    let whole = || Some(ImportSpec::new(file.display().to_string(), input_file::read(file, MAP_BYTES_MAX).ok()?));
    pieces.or_else(whole)?.stored_cell_m()
}

/// A long file whose format is read in pieces; `None` of another one.
fn in_pieces(file: &Path, options: &ImportOptions, whole_bytes_max: u64) -> io::Result<Option<ImportSpec>> {
    let mut handle = input_file::open(file)?;
    let length = handle.metadata()?.len();
    if length <= whole_bytes_max || length > PIECES_BYTES_MAX {
        return Ok(None);
    }
    let mut beginning = Vec::new();
    handle.by_ref().take(BEGINNING_BYTES).read_to_end(&mut beginning)?;
    let pieces = Pieces::new(OpenFile { handle: Mutex::new(handle), length });
    let spec = ImportSpec::in_pieces(file.display().to_string(), beginning, pieces);
    let spec = ImportSpec { options: options.clone(), ..spec };
    Ok(spec.is_read_in_pieces().then_some(spec))
}

/// A file that stays open while it is read.
#[derive(Debug)]
struct OpenFile {
    handle: Mutex<File>,
    length: u64,
}

impl PieceReader for OpenFile {
    fn length(&self) -> u64 {
        self.length
    }

    fn read(&self, at: u64, piece: &mut [u8]) -> io::Result<()> {
        let mut handle = self.handle.lock().unwrap_or_else(PoisonError::into_inner);
        handle.seek(SeekFrom::Start(at))?;
        handle.read_exact(piece)
    }
}

/// The file with a name, below the folder of the map or, for `model://NAME/...`, below one of the
/// folders of models; links are followed, and must not lead out of it.
fn find(name: &Path, folder: &Path, model_paths: &[PathBuf]) -> Option<PathBuf> {
    let of_model = name.strip_prefix(MODEL).ok();
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let roots = model_paths.iter().map(PathBuf::as_path).filter(|_| of_model.is_some()).chain([folder]);
    let name = of_model.unwrap_or(name);
    if !name.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return None;
    }
    roots.into_iter().find_map(|root| {
        let path = root.join(name);
        let (real, real_root) = (path.canonicalize().ok()?, root.canonicalize().ok()?);
        (real.starts_with(real_root) && real.is_file()).then_some(path)
    })
}

/// Whether all files that a map file names lie below its folder, links followed. Whoever writes a
/// map file chooses what it names: if that is not the user of this machine, nothing else is read.
#[must_use]
pub fn is_self_contained(file: &Path) -> bool {
    let (Some(folder), Ok(bytes)) = (file.parent(), input_file::read(file, MAP_BYTES_MAX)) else { return false };
    let Ok(folder) = folder.canonicalize() else { return false };
    let spec = ImportSpec::new(file.display().to_string(), bytes);
    // Models are only found below the folder.
    let is_below = |name: &PathBuf| folder.join(name).canonicalize().is_ok_and(|named| named.starts_with(&folder));
    spec.search() == Search::Models || spec.missing().iter().all(is_below)
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const INCLUDE: &str =
        "<sdf version=\"1.6\"><world name=\"w\"><include><uri>model://tile</uri></include></world></sdf>";
    const TILE: &str = "<sdf version=\"1.6\"><model name=\"tile\"><link name=\"l\"><visual name=\"v\"><geometry><box>\
                        <size>4 4 4</size></box></geometry></visual></link></model></sdf>";

    #[test]
    fn models_are_found_below_their_folders_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for name in ["worlds", "models/tile", "elsewhere"] {
            fs::create_dir_all(path(name)).unwrap();
        }
        fs::write(path("worlds/a.world"), INCLUDE).unwrap();
        fs::write(path("models/tile/model.sdf"), TILE).unwrap();
        let read = |model_path: Option<&str>| {
            let model_path = model_path.map(|name| vec![path(name)]);
            let options = ImportOptions { margin_cells: Some(1), model_path, ..ImportOptions::default() };
            load(&path("worlds/a.world"), &options).unwrap().read()
        };
        assert!(read(None).unwrap_err().to_string().contains("map.import.model_path (--model-path)"));
        assert!(read(Some("elsewhere")).is_err());
        assert_eq!(read(Some("models")).unwrap().terrain.extent().size(), [8, 8, 8]);
        // A link out of the folder is not followed.
        std::os::unix::fs::symlink(path("models/tile"), path("elsewhere/tile")).unwrap();
        assert!(read(Some("elsewhere")).is_err());
        fs::create_dir(path("worlds/tile")).unwrap();
        fs::copy(path("models/tile/model.sdf"), path("worlds/tile/model.sdf")).unwrap();
        assert_eq!(read(None).unwrap().terrain.extent().size(), [8, 8, 8]);
        assert!(is_self_contained(&path("worlds/a.world")));
    }

    /// A cloud of two walls of points in cells of 1 m, of which each point is there many times, and
    /// a truncated one.
    #[test]
    fn long_clouds_are_read_in_pieces() {
        let folder = tempfile::tempdir().unwrap();
        let corners: Vec<[f32; 3]> =
            (0..6).flat_map(|y| [[0.5, y as f32 + 0.5, 0.5], [7.5, y as f32 + 0.5, 2.5]]).collect();
        let data: Vec<u8> = corners.iter().flatten().flat_map(|along| along.to_le_bytes()).collect();
        let copies = 1000;
        let read = |name: &str, header: &str, data: &[u8]| {
            let file = folder.path().join(name);
            fs::write(&file, [header.as_bytes(), data].concat()).unwrap();
            let spec = load_whole(&file, &ImportOptions::default(), 1000).unwrap();
            (spec.pieces.is_some(), spec.read())
        };
        let pcd = |points: usize| format!("FIELDS x y z\nPOINTS {points}\nDATA binary\n");
        let ply = |points: usize| {
            format!(
                "ply\nformat binary_little_endian 1.0\nelement vertex {points}\nproperty float x\nproperty float y\n\
                 property float z\nend_header\n"
            )
        };
        let (is_in_pieces, short) = read("short.pcd", &pcd(12), &data);
        let short = short.unwrap();
        assert!(!is_in_pieces);
        let many = data.repeat(copies);
        for (name, header) in [("long.pcd", pcd(12 * copies)), ("long.ply", ply(12 * copies))] {
            let (is_in_pieces, long) = read(name, &header, &many);
            let long = long.unwrap();
            assert!(is_in_pieces && long.terrain == short.terrain && long.origin_m == short.origin_m, "{name}");
            assert_eq!(long.notes[0].text, short.notes[0].text.replace("12 in", &format!("{} in", 12 * copies)));
        }
        let (_, cut) = read("cut.pcd", &pcd(12 * copies + 1), &many);
        let error = cut.unwrap_err().to_string();
        assert!(error.contains("the file ends here, data of"), "{error}");
    }

    #[test]
    fn a_trajectory_that_is_missing_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.xyz");
        fs::write(&file, "0 0 0\n5 5 5\n").unwrap();
        let options = ImportOptions { trajectory: Some(folder.path().join("poses.txt")), ..ImportOptions::default() };
        let error = load(&file, &options).unwrap_err().to_string();
        assert!(error.contains("it names") && error.contains("poses.txt"), "{error}");
    }
}
