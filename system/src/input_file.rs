//! The reader of files that a user names: scenarios, plans, maps and recordings.
//!
//! Invariants: it reads regular files only, so that neither a FIFO nor a device can make it wait or
//! supply bytes for ever, and it takes no more memory than the limit of the kind of file;
//! recordings have none, and are streams. The type is that of the open file, so that no other file
//! can take its place between check and reading.
//!
//! This module does not interpret what it reads. Its errors do not name the file: callers do.

use std::fs::{File, FileType};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

use crate::os::{self, Links};

/// Largest scenario or plan, bytes.
pub const TEXT_BYTES_MAX: u64 = 16 << 20;

/// Largest map file, bytes.
pub const MAP_BYTES_MAX: u64 = 1 << 30;

/// Opens a regular file for reading. A FIFO without a writer does not block.
///
/// # Errors
/// If it cannot be opened or is no regular file; the error says what it is.
pub fn open(file: &Path) -> io::Result<File> {
    let handle = os::open(file, Links::Followed)?;
    let kind = handle.metadata()?.file_type();
    if kind.is_file() {
        return Ok(handle);
    }
    Err(io::Error::new(ErrorKind::InvalidInput, format!("{}; expected a regular file", described(kind))))
}

/// Reads a regular file of at most `bytes_max` bytes.
///
/// # Errors
/// See [`open`]; also if the file is longer, with its length and the limit.
pub fn read(file: &Path, bytes_max: u64) -> io::Result<Vec<u8>> {
    let mut handle = open(file)?;
    let length = handle.metadata()?.len();
    if length > bytes_max {
        return Err(too_long(length, bytes_max));
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(usize::try_from(length).unwrap_or(usize::MAX))?;
    // A file may grow meanwhile, and those of /proc have no length.
    handle.by_ref().take(bytes_max + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > bytes_max {
        return Err(too_long(bytes.len() as u64, bytes_max));
    }
    Ok(bytes)
}

/// Reads a regular file in UTF-8 of at most `bytes_max` bytes.
///
/// # Errors
/// See [`read`]; also if it is not UTF-8.
pub fn read_text(file: &Path, bytes_max: u64) -> io::Result<String> {
    String::from_utf8(read(file, bytes_max)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        io::Error::new(ErrorKind::InvalidData, format!("byte {at}: not UTF-8 text"))
    })
}

fn too_long(length: u64, bytes_max: u64) -> io::Error {
    let reason = format!("the file has {length} bytes or more, allowed are {bytes_max}");
    io::Error::new(ErrorKind::FileTooLarge, reason)
}

/// What a file is, for errors.
#[must_use]
pub fn described(kind: FileType) -> &'static str {
    if kind.is_dir() {
        "a folder"
    } else if kind.is_symlink() {
        "a symbolic link"
    } else {
        os::special_file(kind)
    }
}

#[cfg(test)]
mod tests {
    use nix::sys::stat::Mode;
    use nix::unistd::mkfifo;

    use super::*;

    #[test]
    fn only_regular_files_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        mkfifo(&path("fifo"), Mode::S_IRWXU).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(path("socket")).unwrap();
        let refuse = |file: &Path| read(file, 100).unwrap_err().to_string();
        assert_eq!(refuse(&path("fifo")), "a FIFO; expected a regular file");
        assert_eq!(refuse(folder.path()), "a folder; expected a regular file");
        assert_eq!(refuse(Path::new("/dev/zero")), "a device; expected a regular file");
        refuse(&path("socket"));
        refuse(&path("nowhere"));

        std::fs::write(path("file"), "text").unwrap();
        std::os::unix::fs::symlink(path("file"), path("link")).unwrap();
        assert_eq!(read(&path("link"), 4).unwrap(), b"text");
        std::os::unix::fs::symlink("/dev/zero", path("zeros")).unwrap();
        assert_eq!(refuse(&path("zeros")), "a device; expected a regular file");
    }

    #[test]
    fn size_is_limited() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "text").unwrap();
        assert_eq!(read_text(&file, 4).unwrap(), "text");
        let error = read(&file, 3).unwrap_err().to_string();
        assert_eq!(error, "the file has 4 bytes or more, allowed are 3");
        // It has no blocks on the disk, but a length.
        File::create(&file).unwrap().set_len(1 << 40).unwrap();
        let error = read(&file, MAP_BYTES_MAX).unwrap_err().to_string();
        assert_eq!(error, "the file has 1099511627776 bytes or more, allowed are 1073741824");
        // A file of /proc has no length, and more bytes than one.
        let error = read(Path::new("/proc/self/maps"), 1).unwrap_err().to_string();
        assert_eq!(error, "the file has 2 bytes or more, allowed are 1");
    }
}
