//! A log of bounded length: what a launcher or an agent on a host prints may have no end.
//!
//! A full file is renamed, with `.old` after its name, and takes the place of the one before.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Maximum length of a file, bytes; there are at most two.
const BYTES_MAX: u64 = 8 << 20;

#[derive(Debug)]
pub(super) struct BoundedLog {
    path: PathBuf,
    file: File,
    /// Length of the file, bytes.
    length: u64,
    max: u64,
}

impl BoundedLog {
    /// Opens a log, and appends to what it has.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        Self::with_max(path, BYTES_MAX)
    }

    fn with_max(path: &Path, max: u64) -> io::Result<Self> {
        let file = OpenOptions::new().create(true).append(true).open(path)?;
        let length = file.metadata()?.len();
        Ok(Self { path: path.to_owned(), file, length, max })
    }

    /// Writes a line; one that cannot be written ends no run.
    pub(super) fn line(&mut self, line: &str) {
        drop(self.try_line(line));
    }

    fn try_line(&mut self, line: &str) -> io::Result<()> {
        let bytes = line.len() as u64 + 1;
        if self.length > 0 && self.length + bytes > self.max {
            let mut old = OsString::from(&self.path);
            old.push(".old");
            fs::rename(&self.path, old)?;
            *self = Self::with_max(&self.path, self.max)?;
        }
        self.length += bytes;
        writeln!(self.file, "{line}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_keeps_its_end_and_one_file_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.log");
        let mut log = BoundedLog::with_max(&path, 10).unwrap();
        ["one", "two", "three", "four", "a line that is longer than the bound"].iter().for_each(|line| log.line(line));
        drop(log);
        BoundedLog::with_max(&path, 10).unwrap().line("last");
        assert_eq!(fs::read_to_string(&path).unwrap(), "last\n");
        let old = fs::read_to_string(folder.path().join("a.log.old")).unwrap();
        assert_eq!(old, "a line that is longer than the bound\n");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
