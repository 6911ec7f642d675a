//! Where a recording is: in a file, or in the rosbag2 folder that holds it.

use std::fs;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Recordings of a split bag that an error names.
const FILES_SHOWN: usize = 3;

/// What the files of bags are called: of MCAP, as recordings are, and of SQLite.
const MCAP: &str = "mcap";
const SQLITE: &str = "db3";

/// A bag of rosbag2 that is no recording.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum BagError {
    /// No run is in more than one file.
    #[error("a folder with {count} recordings ({names}); expected one; name the file")]
    Split { count: usize, names: String },
    #[error(
        "a bag of rosbag2 in SQLite{place}; expected MCAP: `rosbags-convert --src BAG --dst NEW --dst-storage mcap` \
         makes one that `maes info` and `maes replay` read, without the attachments of a run"
    )]
    Sqlite { place: String },
    #[error(
        "a bag of rosbag2 that is compressed by {mode}; expected one without: `rosbags-convert --src BAG --dst NEW \
         --dst-storage mcap` makes one that `maes info` and `maes replay` read, without the attachments of a run"
    )]
    Compressed { mode: String },
}

/// The recording in a rosbag2 folder; any other path as it is. Wherever a recording is named, its
/// folder may be named instead.
///
/// # Errors
/// If the folder has several, or the bag is one of SQLite, or compressed as only ROS reads it.
pub fn recording_at(path: PathBuf) -> Result<PathBuf, BagError> {
    let folder = if path.is_dir() { Some(path.as_path()) } else { path.parent() };
    if let Some(mode) = folder.and_then(|folder| compression_mode(folder, &path)) {
        return Err(BagError::Compressed { mode });
    }
    let Ok(entries) = fs::read_dir(&path) else {
        let is_sqlite = has_extension(&path, SQLITE) && path.is_file();
        return if is_sqlite { Err(BagError::Sqlite { place: String::new() }) } else { Ok(path) };
    };
    let files = entries.filter_map(Result::ok).map(|entry| entry.path()).filter(|path| path.is_file());
    let (mut files, others): (Vec<PathBuf>, Vec<PathBuf>) = files.partition(|file| has_extension(file, MCAP));
    files.sort();
    match files.as_slice() {
        [] => {
            match others.iter().filter(|file| has_extension(file, SQLITE)).filter_map(|file| file.file_name()).min() {
                Some(name) => Err(BagError::Sqlite { place: format!(" ({})", name.to_string_lossy()) }),
                None => Ok(path),
            }
        }
        [_] => Ok(files.remove(0)),
        several => {
            let names = several.iter().take(FILES_SHOWN).filter_map(|file| file.file_name());
            let mut names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
            if several.len() > FILES_SHOWN {
                names.push("...".into());
            }
            Err(BagError::Split { count: several.len(), names: names.join(", ") })
        }
    }
}

/// What a bag of rosbag2 has compressed, by the `metadata.yaml` in its folder, if that names this
/// file: each `message`, or each `file`. What MCAP itself compresses is not in it.
fn compression_mode(folder: &Path, path: &Path) -> Option<String> {
    let metadata = fs::read_to_string(folder.join(crate::bag::FILE_NAME)).ok()?;
    let is_of_bag =
        path == folder || path.file_name().and_then(|name| name.to_str()).is_some_and(|name| metadata.contains(name));
    let mode = metadata.lines().find_map(|line| line.trim().strip_prefix("compression_mode:"))?;
    let mode = mode.trim().trim_matches(['"', '\'']).to_lowercase();
    (is_of_bag && matches!(mode.as_str(), "message" | "file" | "storage")).then_some(mode)
}

/// Whether a path is named as a recording is, `.mcap` in upper or lower case.
#[must_use]
pub fn is_recording(path: &Path) -> bool {
    has_extension(path, MCAP)
}

/// Whether a file has such a name. The temporary name of a recording that has not begun yet has
/// another one.
fn has_extension(file: &Path, extension: &str) -> bool {
    file.extension().is_some_and(|is| is.eq_ignore_ascii_case(extension))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_stand_for_the_recording_in_them() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let empty = at("empty");
        fs::create_dir(&empty).unwrap();
        for path in [empty, at("none.mcap")] {
            assert_eq!(recording_at(path.clone()), Ok(path));
        }
        let bag = at("night");
        fs::create_dir(&bag).unwrap();
        for name in ["night_0.mcap", "metadata.yaml", ".night_1.mcap.7.tmp"] {
            fs::write(bag.join(name), "").unwrap();
        }
        let file = bag.join("night_0.mcap");
        assert_eq!([&bag, &file].map(|path| recording_at(path.clone())), [Ok(file.clone()), Ok(file)]);
        for number in 1..4 {
            fs::write(bag.join(format!("night_{number}.mcap")), "").unwrap();
        }
        let refused = recording_at(bag).unwrap_err().to_string();
        let names = "night_0.mcap, night_1.mcap, night_2.mcap, ...";
        assert_eq!(refused, format!("a folder with 4 recordings ({names}); expected one; name the file"));
    }

    #[test]
    fn recordings_have_their_extension_in_either_case() {
        let is_named = |name: &str| is_recording(Path::new(name));
        assert!(is_named("a/run.mcap") && is_named("RUN.MCAP") && !is_named("run.mcap.tmp") && !is_named("mcap"));
    }

    #[test]
    fn compressed_bags_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("night_0.mcap");
        fs::write(&file, "").unwrap();
        let with_mode = |line: &str| {
            let text = format!("rosbag2_bagfile_information:\n{line}\n  relative_file_paths:\n    - night_0.mcap\n");
            fs::write(folder.path().join("metadata.yaml"), text).unwrap();
            [folder.path(), &file].map(|path| recording_at(path.to_owned()))
        };
        for line in ["  compression_format: zstd\n  compression_mode: message", "  compression_mode: \"FILE\""] {
            for refused in with_mode(line).map(|found| found.unwrap_err().to_string()) {
                assert!(refused.starts_with("a bag of rosbag2 that is compressed by "), "{refused}");
            }
        }
        for line in ["  compression_mode: \"\"", "  compression_mode: none", ""] {
            assert_eq!(with_mode(line), [Ok(file.clone()), Ok(file.clone())]);
        }
        // A file that the metadata do not name is not of the bag.
        let other = folder.path().join("other.mcap");
        assert!(with_mode("  compression_mode: message").iter().all(Result::is_err));
        assert_eq!(recording_at(other.clone()), Ok(other));
    }

    #[test]
    fn bags_of_sqlite_are_named() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["metadata.yaml", "night_0.db3"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        for path in [folder.path().to_owned(), folder.path().join("night_0.db3")] {
            let refused = recording_at(path).unwrap_err().to_string();
            assert!(
                refused.starts_with("a bag of rosbag2 in SQLite") && refused.contains("rosbags-convert"),
                "{refused}"
            );
        }
        // A converted bag beside it is the recording.
        let converted = folder.path().join("night_0.mcap");
        fs::write(&converted, "").unwrap();
        assert_eq!(recording_at(folder.path().to_owned()), Ok(converted));
    }
}
