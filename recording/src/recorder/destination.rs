//! The file of a recording: which files it may replace, its temporary name, and its lock.
//!
//! Invariants: a recording replaces nothing but a recording or an empty file, and keeps its mode;
//! it is never written through a symbolic link, nor into a device or a FIFO. Until it is published
//! it has a temporary name beside the final one, and it is locked as long as its process lives, so
//! that a later run can distinguish an abandoned file from one that is being written.
//!
//! A name that ends in a slash is that of a rosbag2 folder: the recording is a file in it, and its
//! metadata another one, written when the recording is finished. The folder is new or empty, or has
//! these two files alone. So it is when a recording is named by its file in such a folder, to
//! resume its run for instance.
//!
//! This module does not write the content.

use std::fs::{self, File, Permissions, TryLockError};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use crate::bag;
use crate::location::is_recording;
use system::input_file::described;
use system::os::{self, Links, is_at};

/// How often a temporary file is created again that another process takes for abandoned.
const ATTEMPTS_MAX: u32 = 10;

/// The files of a recording that is not yet published.
#[derive(Debug)]
pub(super) struct Destination {
    file: PathBuf,
    /// Whether the file is in a rosbag2 folder of its own, and whether that was made for it.
    is_in_bag: bool,
    has_made_folder: bool,
    temporary: PathBuf,
    /// Permissions of the file that will be replaced.
    older: Option<Permissions>,
    is_published: bool,
    /// Holds the lock.
    locked: File,
}

/// Whether a recording may be written to `file`: to a new or empty file, or in place of a
/// recording.
///
/// # Errors
/// `InvalidInput` with the reason and a remedy; or why the present file cannot be read.
pub(super) fn check(file: &Path) -> io::Result<()> {
    let file = match bag_folder(file) {
        Some(folder) => {
            check_bag_folder(folder)?;
            &file_in_bag(folder)?
        }
        None => file,
    };
    replaceable(file).map(drop)
}

impl Destination {
    /// Creates the temporary file, locked and empty, and removes those of killed processes.
    ///
    /// # Errors
    /// See [`check`]; also if the file cannot be created.
    pub(super) fn create(file: &Path) -> io::Result<(Self, File)> {
        let bag = bag_folder(file);
        let mut has_made_folder = false;
        let file = match bag {
            Some(folder) => {
                check_bag_folder(folder)?;
                if !folder.is_dir() {
                    fs::create_dir(folder)?;
                    has_made_folder = true;
                }
                &file_in_bag(folder)?
            }
            None => file,
        };
        let older = replaceable(file)?;
        let refuse = || io::Error::new(ErrorKind::InvalidInput, "a recording needs a file name");
        let name = file.file_name().ok_or_else(refuse)?.to_string_lossy().into_owned();
        let temporary = file.with_file_name(temporary_name(&name, std::process::id()));
        remove_abandoned(file, &name);
        for _ in 0..ATTEMPTS_MAX {
            // Until it has the permissions of the file that it replaces.
            let handle = os::create_new(&temporary, older.is_some())?;
            match handle.try_lock() {
                // Another process has taken the new file for abandoned.
                Err(TryLockError::WouldBlock) => continue,
                // Without locks the file only looks like one in use.
                Ok(()) | Err(TryLockError::Error(_)) => {}
            }
            if is_at(&handle.metadata()?, &temporary) {
                let locked = handle.try_clone()?;
                let file = file.to_owned();
                let is_in_bag = bag.is_some() || is_of_bag(&file);
                let destination =
                    Self { file, is_in_bag, has_made_folder, temporary, older, is_published: false, locked };
                return Ok((destination, handle));
            }
        }
        Err(io::Error::other(format!("{}: removed {ATTEMPTS_MAX} times by another process", temporary.display())))
    }

    /// Gives the file its final name, in place of an older recording, and syncs the folder.
    ///
    /// # Errors
    /// See [`check`]; also if the file cannot be renamed or the folder cannot be synced.
    pub(super) fn publish(&mut self) -> io::Result<()> {
        // The file may have been replaced meanwhile.
        if let Some(permissions) = replaceable(&self.file)?.or_else(|| self.older.take()) {
            self.locked.set_permissions(permissions)?;
        }
        if self.is_in_bag {
            remove_if_there(&self.file.with_file_name(bag::FILE_NAME))?;
        }
        fs::rename(&self.temporary, &self.file)?;
        self.is_published = true;
        // On some systems a locked file cannot be read. Where there are no locks it has none.
        let _ = self.locked.unlock();
        os::sync_folder(folder_of(&self.file))
    }

    /// Writes the metadata of a finished recording beside it, if it is in a rosbag2 folder; `text`
    /// makes them for its file name.
    ///
    /// # Errors
    /// If they cannot be written.
    pub(super) fn write_metadata(&self, text: impl FnOnce(&str) -> String) -> io::Result<()> {
        if !self.is_in_bag {
            return Ok(());
        }
        let name = self.file.file_name().unwrap_or_default().to_string_lossy();
        let (temporary, metadata) =
            (self.file.with_file_name(METADATA_TEMPORARY), self.file.with_file_name(bag::FILE_NAME));
        remove_if_there(&temporary)?;
        let mut file = os::create_new(&temporary, false)?;
        file.write_all(format!("{}\n", text(&name)).as_bytes())?;
        file.sync_all()?;
        fs::rename(&temporary, &metadata)?;
        os::sync_folder(folder_of(&self.file))
    }
}

/// The name of the metadata while they are written.
const METADATA_TEMPORARY: &str = ".metadata.yaml.tmp";

/// Whether a recording may be written under a name: a file (`.mcap`), or a rosbag2 folder. Other
/// endings are those of other formats, and would mislead their programs.
#[must_use]
pub fn may_be_named(file: &Path) -> bool {
    is_recording(file) || bag_folder(file).is_some()
}

/// The folder of a name that ends in a slash.
#[must_use]
pub fn bag_folder(file: &Path) -> Option<&Path> {
    let ends_in_slash = file.as_os_str().as_encoded_bytes().last().is_some_and(|&byte| byte == b'/');
    ends_in_slash.then_some(file)
}

/// The recording in a rosbag2 folder, as `ros2 bag record` names it.
fn file_in_bag(folder: &Path) -> io::Result<PathBuf> {
    let refuse = || io::Error::new(ErrorKind::InvalidInput, "a folder of a recording needs a name");
    let name = folder.file_name().ok_or_else(refuse)?.to_string_lossy();
    Ok(folder.join(format!("{name}_0.mcap")))
}

/// Whether a folder may become that of a recording.
fn check_bag_folder(folder: &Path) -> io::Result<()> {
    let file = file_in_bag(folder)?;
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
    };
    for entry in entries {
        let found = entry?.file_name().to_string_lossy().into_owned();
        let is_temporary = found.starts_with(&format!(".{name}.")) || found == METADATA_TEMPORARY;
        if found != name && found != bag::FILE_NAME && !is_temporary {
            let reason = format!(
                "a folder with another file, {found}; nothing was written; a rosbag2 folder is made where there is \
                 none, or an empty one, or one of a recording alone; choose another name"
            );
            return Err(io::Error::new(ErrorKind::InvalidInput, reason));
        }
    }
    Ok(())
}

/// Whether a file is the recording of a rosbag2 folder, by its name and by what else is there.
fn is_of_bag(file: &Path) -> bool {
    let Ok(folder) = folder_of(file).canonicalize() else { return false };
    let name = file_in_bag(&folder).ok();
    name.as_deref().and_then(Path::file_name) == file.file_name() && check_bag_folder(&folder).is_ok()
}

fn remove_if_there(file: &Path) -> io::Result<()> {
    match fs::remove_file(file) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

impl Drop for Destination {
    fn drop(&mut self) {
        if !self.is_published {
            // The reason for aborting is reported elsewhere.
            let _ = fs::remove_file(&self.temporary);
            if self.has_made_folder {
                let _ = fs::remove_dir(folder_of(&self.file));
            }
        }
    }
}

/// The permissions of the file that a recording at `file` replaces; `None` if there is none.
fn replaceable(file: &Path) -> io::Result<Option<Permissions>> {
    let refused = |what: &str| {
        let reason = format!(
            "{what}; nothing was written; a recording replaces only a recording or an empty file; choose another \
             name, or one that ends in / for a rosbag2 folder"
        );
        io::Error::new(ErrorKind::InvalidInput, reason)
    };
    // Opening a device may already have an effect.
    let kind = match fs::symlink_metadata(file) {
        Ok(metadata) => metadata.file_type(),
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    if !kind.is_file() {
        return Err(refused(described(kind)));
    }
    let mut handle = os::open(file, Links::Refused)?;
    let metadata = handle.metadata()?;
    if !metadata.is_file() {
        return Err(refused(described(metadata.file_type())));
    }
    if !is_recording_or_empty(&mut handle)? {
        return Err(refused("a file that is no recording"));
    }
    Ok(Some(os::inherited_permissions(&metadata)))
}

fn is_recording_or_empty(handle: &mut File) -> io::Result<bool> {
    let mut beginning = Vec::new();
    handle.take(mcap::MAGIC.len() as u64).read_to_end(&mut beginning)?;
    Ok(beginning.is_empty() || beginning == mcap::MAGIC)
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn temporary_name(name: &str, process: u32) -> String {
    format!(".{name}.{process}.tmp")
}

/// Removes the temporary files that killed processes have left for recordings of this name. What
/// cannot be removed stays.
fn remove_abandoned(file: &Path, name: &str) {
    let Ok(entries) = fs::read_dir(folder_of(file)) else { return };
    for entry in entries.filter_map(Result::ok) {
        let found = entry.file_name();
        let Some(process) = found.to_str().and_then(|found| {
            let process: u32 = found.strip_prefix(&format!(".{name}."))?.strip_suffix(".tmp")?.parse().ok()?;
            (found == temporary_name(name, process)).then_some(process)
        }) else {
            continue;
        };
        // Processes of earlier builds do not lock their files.
        let is_other = process != std::process::id();
        if !(is_other && Path::new("/proc").join(process.to_string()).exists()) {
            let _ = remove_if_abandoned(&entry.path());
        }
    }
}

/// Removes a temporary file that is a recording of this user and that no process has locked.
fn remove_if_abandoned(temporary: &Path) -> io::Result<()> {
    if !fs::symlink_metadata(temporary)?.is_file() {
        return Ok(());
    }
    let mut handle = os::open(temporary, Links::Refused)?;
    let metadata = handle.metadata()?;
    let is_own = metadata.is_file() && os::is_own(&metadata);
    if is_own && handle.try_lock().is_ok() && is_recording_or_empty(&mut handle)? && is_at(&metadata, temporary) {
        fs::remove_file(temporary)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
