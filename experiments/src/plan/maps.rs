//! The map files of a plan: a list of files and patterns, each relative to the plan.

use std::path::{Path, PathBuf};

/// The allowed values of `maps`, for error messages.
pub(super) const MAPS_EXPECTED: &str = "expected a map file or a pattern such as \"maps/*.m3dm\", relative to the \
                                        plan, or a list of them; `*` and `?` are allowed in the last part of a path";

/// A map file of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct MapFile {
    /// The file name, which names the map in tables.
    pub(super) name: String,
    /// As in the plan, with the wild cards replaced.
    pub(super) path: PathBuf,
}

/// The files that `maps` names, in the order of the list and by name within a pattern. Patterns
/// start from `folder`.
///
/// # Errors
/// What is wrong: a pattern without files, a path that is not text, two files of one name.
pub(super) fn files(value: &toml::Value, folder: &Path) -> Result<Vec<MapFile>, String> {
    let patterns: Vec<&str> = match value {
        toml::Value::String(pattern) => vec![pattern],
        toml::Value::Array(list) => {
            let texts: Option<_> = list.iter().map(toml::Value::as_str).collect();
            texts.ok_or_else(|| MAPS_EXPECTED.to_owned())?
        }
        _ => return Err(MAPS_EXPECTED.to_owned()),
    };
    let mut files: Vec<MapFile> = Vec::new();
    for pattern in patterns {
        for path in matching(pattern, folder)? {
            let name = path.file_name().and_then(|name| name.to_str());
            let name = name.ok_or_else(|| format!("{pattern:?}: {MAPS_EXPECTED}"))?.to_owned();
            if let Some(other) = files.iter().find(|file| file.name == name) {
                let (one, other) = (path.display(), other.path.display());
                return Err(format!("{one} and {other} have the same name; expected files of different names"));
            }
            files.push(MapFile { name, path });
        }
    }
    if files.is_empty() { Err(format!("no maps; {MAPS_EXPECTED}")) } else { Ok(files) }
}

fn matching(pattern: &str, folder: &Path) -> Result<Vec<PathBuf>, String> {
    let path = Path::new(pattern);
    let last = Path::new(pattern).file_name().and_then(|name| name.to_str()).unwrap_or_default();
    if !last.contains(['*', '?']) {
        return Ok(vec![path.to_owned()]);
    }
    let parent = path.parent().unwrap_or(Path::new(""));
    let place = folder.join(parent);
    let place = if place.as_os_str().is_empty() { PathBuf::from(".") } else { place };
    let entries = std::fs::read_dir(&place).map_err(|error| format!("{pattern:?}: {}: {error}", place.display()))?;
    let mut found = Vec::new();
    for entry in entries {
        let entry = entry.map_err(|error| format!("{pattern:?}: {}: {error}", place.display()))?;
        let name = entry.file_name();
        if entry.path().is_file() && name.to_str().is_some_and(|name| matches(last.as_bytes(), name.as_bytes())) {
            found.push(parent.join(name));
        }
    }
    found.sort();
    if found.is_empty() { Err(format!("{pattern:?}: no file in {} matches", place.display())) } else { Ok(found) }
}

/// Whether a name matches a pattern, in which `*` stands for any bytes and `?` for one. A leading
/// dot has to be named.
fn matches(pattern: &[u8], name: &[u8]) -> bool {
    if name.first() == Some(&b'.') && pattern.first() != Some(&b'.') {
        return false;
    }
    // `reached[i]`: the pattern so far matches the first i bytes.
    let mut reached = vec![false; name.len() + 1];
    reached[0] = true;
    for &part in pattern {
        match part {
            b'*' => {
                let first = reached.iter().position(|&is| is).unwrap_or(reached.len());
                reached[first..].fill(true);
            }
            _ => {
                for i in (0..name.len()).rev() {
                    reached[i + 1] = reached[i] && (part == b'?' || part == name[i]);
                }
                reached[0] = false;
            }
        }
    }
    reached[name.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_match_names() {
        for (pattern, name, expected) in [
            ("*.m3dm", "a.m3dm", true),
            ("*.m3dm", ".a.m3dm", false),
            ("*.m3dm", "a.m3dm.bak", false),
            ("cave-?.*", "cave-1.m3dm", true),
            ("cave-?.*", "cave-10.m3dm", false),
            ("*", "", true),
            ("a*b*c", "aXbYbZc", true),
            ("a*b*c", "aXbYbZ", false),
        ] {
            assert_eq!(matches(pattern.as_bytes(), name.as_bytes()), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn files_are_listed_by_name_and_once() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.txt", "a.txt", "c.map"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let names = |value: &str| -> Result<Vec<String>, String> {
            let value: toml::Table = toml::from_str(&format!("maps = {value}")).unwrap();
            let files = files(&value["maps"], folder.path())?;
            Ok(files.into_iter().map(|file| file.name).collect())
        };
        assert_eq!(names("[\"c.map\", \"*.txt\"]").unwrap(), ["c.map", "a.txt", "b.txt"]);
        assert!(names("[\"a.txt\", \"*.txt\"]").unwrap_err().contains("have the same name"));
        assert!(names("\"*.pgm\"").unwrap_err().contains("no file in"));
        for wrong in ["3", "[3]", "[]"] {
            assert!(names(wrong).unwrap_err().contains(MAPS_EXPECTED), "{wrong}");
        }
    }
}
