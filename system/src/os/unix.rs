//! Linux, macOS and their kin.

use std::fs::{self, File, FileType, Metadata, OpenOptions, Permissions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileExt, FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitCode};
use std::sync::Arc;

use nix::fcntl::OFlag;

use super::Links;

/// The bits of a mode that a file keeps that replaces another one: no set-user-id and the like.
const MODE_BITS: u32 = 0o777;

/// Permissions of a file that only its user may read.
const PRIVATE: u32 = 0o600;

/// Opens a file for reading; a FIFO without a writer does not block.
///
/// # Errors
/// If it cannot be opened, or is a link that is refused.
pub fn open(file: &Path, links: Links) -> io::Result<File> {
    let mut flags = OFlag::O_NONBLOCK | OFlag::O_NOCTTY;
    flags.set(OFlag::O_NOFOLLOW, links == Links::Refused);
    OpenOptions::new().read(true).custom_flags(flags.bits()).open(file)
}

/// Creates a file for writing where there is none; a private one can be read by its user alone.
///
/// # Errors
/// If there is a file, or it cannot be created.
pub fn create_new(file: &Path, is_private: bool) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    if is_private {
        options.mode(PRIVATE);
    }
    options.open(file)
}

/// What a file is that is neither a regular one, nor a folder, nor a link.
#[must_use]
pub fn special_file(kind: FileType) -> &'static str {
    if kind.is_fifo() {
        "a FIFO"
    } else if kind.is_socket() {
        "a socket"
    } else if kind.is_char_device() || kind.is_block_device() {
        "a device"
    } else {
        "no regular file"
    }
}

/// The permissions that a file gets which takes the place of this one.
#[must_use]
pub fn inherited_permissions(replaced: &Metadata) -> Permissions {
    Permissions::from_mode(replaced.mode() & MODE_BITS)
}

/// Whether a file belongs to the user of this process.
#[must_use]
pub fn is_own(file: &Metadata) -> bool {
    file.uid() == nix::unistd::geteuid().as_raw()
}

/// Whether a name still belongs to an open file.
#[must_use]
pub fn is_at(open: &Metadata, name: &Path) -> bool {
    let there = fs::symlink_metadata(name);
    there.is_ok_and(|there| (there.dev(), there.ino()) == (open.dev(), open.ino()))
}

/// Syncs a folder, so that the names in it survive a power failure.
///
/// # Errors
/// If it cannot be synced, on a file system that can.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    match File::open(folder)?.sync_all() {
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => Ok(()),
        synced => synced,
    }
}

/// Writes bytes at an offset.
///
/// # Errors
/// If they cannot be written; a part of them may have been.
pub fn write_all_at(file: &File, bytes: &[u8], at: u64) -> io::Result<()> {
    FileExt::write_all_at(file, bytes, at)
}

/// Reads bytes at an offset.
///
/// # Errors
/// If they cannot be read, or the file ends before.
pub fn read_exact_at(file: &File, bytes: &mut [u8], at: u64) -> io::Result<()> {
    FileExt::read_exact_at(file, bytes, at)
}

/// Makes this process another program.
///
/// # Errors
/// If that cannot be started; it returns in no other case.
pub fn become_program(command: &mut Command) -> io::Result<ExitCode> {
    Err(command.exec())
}

/// Makes a write beyond the limit of a file's size (`ulimit -f`) an error of that write, where the
/// signal SIGXFSZ would end the process without a word.
///
/// # Errors
/// If the handler cannot be installed.
pub fn report_full_files() -> io::Result<()> {
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default()).map(drop)
}

/// Whether a file that is open has no name any more.
///
/// # Errors
/// If the system does not say.
pub fn is_deleted(file: &File) -> io::Result<bool> {
    Ok(file.metadata()?.nlink() == 0)
}
