//! Where a recording is: in a file, or in the rosbag2 folder that holds it.

use std::fs;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Recordings of a split bag that an error names.
const FILES_SHOWN: usize = 3;

/// A folder with several recordings, as a bag that was split: no run is in more than one file.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("a folder with {count} recordings ({names}); expected one; name the file")]
pub struct SplitBagError {
    count: usize,
    names: String,
}

/// The recording in a rosbag2 folder; any other path as it is. Wherever a recording is named, its
/// folder may be named instead.
///
/// # Errors
/// If the folder has several.
pub fn recording_at(path: PathBuf) -> Result<PathBuf, SplitBagError> {
    let Ok(entries) = fs::read_dir(&path) else { return Ok(path) };
    let files = entries.filter_map(Result::ok).map(|entry| entry.path());
    let mut files: Vec<PathBuf> = files.filter(|file| is_recording(file) && file.is_file()).collect();
    files.sort();
    match files.as_slice() {
        [] => Ok(path),
        [_] => Ok(files.remove(0)),
        several => {
            let names = several.iter().take(FILES_SHOWN).filter_map(|file| file.file_name());
            let mut names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
            if several.len() > FILES_SHOWN {
                names.push("...".into());
            }
            Err(SplitBagError { count: several.len(), names: names.join(", ") })
        }
    }
}

/// Whether a file has the name of a recording. The temporary name of one that has not begun yet is
/// none.
fn is_recording(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension == "mcap")
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
}
