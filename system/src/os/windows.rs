//! Windows.

use std::fs::{File, FileType, Metadata, OpenOptions, Permissions};
use std::io::{self, ErrorKind};
use std::os::windows::fs::{FileExt, OpenOptionsExt};
use std::path::Path;
use std::process::{Command, ExitCode};

use super::Links;

/// `FILE_FLAG_OPEN_REPARSE_POINT`: a link is opened instead of what it names.
const OPEN_LINK: u32 = 0x0020_0000;

/// Opens a file for reading.
///
/// # Errors
/// If it cannot be opened.
pub fn open(file: &Path, links: Links) -> io::Result<File> {
    let flags = if links == Links::Refused { OPEN_LINK } else { 0 };
    OpenOptions::new().read(true).custom_flags(flags).open(file)
}

/// Creates a file for writing where there is none. Who may read it follows from its folder.
///
/// # Errors
/// If there is a file, or it cannot be created.
pub fn create_new(file: &Path, _is_private: bool) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).open(file)
}

/// What a file is that is neither a regular one, nor a folder, nor a link.
#[must_use]
pub fn special_file(_kind: FileType) -> &'static str {
    "no regular file"
}

/// The permissions that a file gets which takes the place of this one.
#[must_use]
pub fn inherited_permissions(replaced: &Metadata) -> Permissions {
    replaced.permissions()
}

/// Whether a file belongs to the user of this process: other users cannot write it otherwise.
#[must_use]
pub fn is_own(_file: &Metadata) -> bool {
    true
}

/// Whether a name still belongs to an open file. Names of files in use cannot be given to others.
#[must_use]
pub fn is_at(_open: &Metadata, name: &Path) -> bool {
    name.exists()
}

/// Does nothing: the system writes names by itself.
///
/// # Errors
/// Never.
pub fn sync_folder(_folder: &Path) -> io::Result<()> {
    Ok(())
}

/// Writes bytes at an offset.
///
/// # Errors
/// If they cannot be written; a part of them may have been.
pub fn write_all_at(file: &File, mut bytes: &[u8], mut at: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        match file.seek_write(bytes, at) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(written) => (bytes, at) = (&bytes[written..], at + written as u64),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Reads bytes at an offset.
///
/// # Errors
/// If they cannot be read, or the file ends before.
pub fn read_exact_at(file: &File, mut bytes: &mut [u8], mut at: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        match file.seek_read(bytes, at) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(read) => (bytes, at) = (&mut bytes[read..], at + read as u64),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Runs another program in place of this one, which waits for it: the exit code is that of the
/// program.
///
/// # Errors
/// If that cannot be started.
pub fn become_program(command: &mut Command) -> io::Result<ExitCode> {
    let code = command.status()?.code().unwrap_or(1);
    Ok(ExitCode::from(u8::try_from(code).unwrap_or(u8::MAX)))
}

/// The system has no such limit.
///
/// # Errors
/// Never.
pub fn report_full_files() -> io::Result<()> {
    Ok(())
}

/// The system does not delete files that are open.
///
/// # Errors
/// Never.
pub fn is_deleted(_file: &File) -> io::Result<bool> {
    Ok(false)
}
