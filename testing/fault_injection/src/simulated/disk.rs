//! The simulated disk: a folder with one recording, which is written under a temporary name.
//!
//! A killed process leaves what it has written, and a part of the write that it was in. A power
//! failure leaves what was synced; of each later operation it leaves all, nothing, or, of a write,
//! a part, independently of the others.
//!
//! Invariants: a file that was given its name has it after a power failure; nothing changes what
//! was synced and not overwritten since.

use std::cell::RefCell;
use std::io;
use std::rc::Rc;

use rand::RngExt;
use recording::recorder::Store;

use super::adversary::{Mutation, up_to};
use super::network::{Killed, SharedNetwork};

/// Bytes that a disk writes at once.
const SECTOR: usize = 512;

/// Most bytes that a disk takes before it fails.
const ROOM_MAX: u64 = 60_000;

/// The disk of the server; clones share it.
#[derive(Clone)]
pub(super) struct SimulatedDisk {
    network: SharedNetwork,
    /// The recording that has its name.
    published: Rc<RefCell<Option<SharedFile>>>,
}

type SharedFile = Rc<RefCell<File>>;

/// A change of a file that may not be on the disk yet.
#[derive(Debug, Clone)]
enum Change {
    Write { at: usize, bytes: Vec<u8> },
    Truncation { length: usize },
}

#[derive(Debug, Default)]
struct File {
    /// As processes see it.
    cached: Vec<u8>,
    /// As of the last sync.
    synced: Vec<u8>,
    /// Changes since then.
    changes: Vec<Change>,
}

impl File {
    fn apply(&mut self, change: Change) {
        change.apply(&mut self.cached);
        self.changes.push(change);
    }
}

impl Change {
    fn apply(&self, file: &mut Vec<u8>) {
        match self {
            Self::Write { at, bytes } => {
                if file.len() < at + bytes.len() {
                    file.resize(at + bytes.len(), 0);
                }
                file[*at..at + bytes.len()].copy_from_slice(bytes);
            }
            Self::Truncation { length } => file.truncate(*length),
        }
    }
}

/// A recording on the disk, being written by one server.
pub(super) struct SimulatedFile {
    disk: SimulatedDisk,
    file: SharedFile,
    /// Bytes that can be written until the disk is full.
    room: Option<RefCell<u64>>,
}

impl SimulatedDisk {
    pub(super) fn new(network: SharedNetwork) -> Self {
        Self { network, published: Rc::default() }
    }

    /// A new file under a temporary name.
    pub(super) fn create(&self) -> SimulatedFile {
        let mut network = self.network.borrow_mut();
        let fails = network.adversary.disk_failures > 0 && network.random.random_bool(0.7);
        let room = fails.then(|| {
            network.adversary.disk_failures -= 1;
            RefCell::new(network.random.random_range(0..ROOM_MAX))
        });
        SimulatedFile { disk: self.clone(), file: Rc::default(), room }
    }

    /// The content of the recording that has its name.
    pub(super) fn published(&self) -> Option<Vec<u8>> {
        self.published.borrow().as_ref().map(|file| file.borrow().cached.clone())
    }

    /// Loses what is not on the disk, or a part of it.
    pub(super) fn fail_power(&self) {
        let Some(file) = self.published.borrow().clone() else { return };
        let file = &mut *file.borrow_mut();
        let mut network = self.network.borrow_mut();
        let random = &mut network.random;
        let mut left = std::mem::take(&mut file.synced);
        // Most often, only the last changes are not on the disk.
        let since = random.random_range(0..=file.changes.len());
        for (number, change) in std::mem::take(&mut file.changes).into_iter().enumerate() {
            if number < since || random.random_bool(0.4) {
                change.apply(&mut left);
            } else if random.random_bool(0.5)
                && let Change::Write { at, bytes } = change
            {
                let kept = random.random_range(0..=bytes.len()) / SECTOR * SECTOR;
                Change::Write { at, bytes: bytes[..kept].to_vec() }.apply(&mut left);
            }
        }
        let lost = file.cached.len().abs_diff(left.len());
        network.log(|| format!("disk: the power has failed; {} bytes are left, {lost} more or less", left.len()));
        file.synced.clone_from(&left);
        file.cached = left;
    }

    /// Replaces the content of the recording.
    pub(super) fn replace(&self, bytes: Vec<u8>) {
        if let Some(file) = &*self.published.borrow() {
            *file.borrow_mut() = File { cached: bytes.clone(), synced: bytes, changes: Vec::new() };
        }
    }
}

impl SimulatedFile {
    /// Counts an operation, which may take a while, and may be the last of the server: then
    /// `partly` happens.
    fn operate(&self, what: impl FnOnce() -> String, partly: impl FnOnce(&mut File, f64)) {
        let mut network = self.disk.network.borrow_mut();
        network.log(|| format!("disk: {}", what()));
        if network.adversary.slow_disk > 0.0 && network.is_server_up {
            let chance = network.adversary.slow_disk;
            if network.random.random_bool(chance) {
                let limit = network.adversary.slow_disk_max;
                let delay = up_to(&mut network.random, limit);
                network.log(|| format!("disk: takes {:.3} s", delay.as_secs_f64()));
                network.clock += delay;
            }
        }
        if let Some(killed) = network.server_acts() {
            let share = network.random.random_range(0.0..1.0);
            drop(network);
            partly(&mut self.file.borrow_mut(), share);
            kill(killed);
        }
    }

    fn failure(&self, error: io::ErrorKind) -> io::Error {
        let mut network = self.disk.network.borrow_mut();
        network.counts.disk_failures += 1;
        network.log(|| format!("disk: fails: {error}"));
        error.into()
    }
}

/// Ends the server process.
pub(super) fn kill(killed: Killed) -> ! {
    // Unwinds without the message of a panic.
    std::panic::resume_unwind(Box::new(killed))
}

impl Store for SimulatedFile {
    fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        let at = usize::try_from(at).map_err(|_too_large| io::ErrorKind::FileTooLarge)?;
        let what = || format!("write {} bytes at {at}", bytes.len());
        self.operate(what, |file, share| {
            let kept = (bytes.len() as f64 * share) as usize;
            file.apply(Change::Write { at, bytes: bytes[..kept].to_vec() });
        });
        let mut written = bytes;
        if let Some(room) = &self.room {
            let mut room = room.borrow_mut();
            let fits = usize::try_from(*room).map_or(bytes.len(), |room| room.min(bytes.len()));
            *room -= fits as u64;
            written = &bytes[..fits];
        }
        self.file.borrow_mut().apply(Change::Write { at, bytes: written.to_vec() });
        if written.len() < bytes.len() { Err(self.failure(io::ErrorKind::StorageFull)) } else { Ok(()) }
    }

    fn set_len(&self, length: u64) -> io::Result<()> {
        let length = usize::try_from(length).map_err(|_too_large| io::ErrorKind::FileTooLarge)?;
        self.operate(|| format!("truncate to {length} bytes"), |_, _| ());
        self.file.borrow_mut().apply(Change::Truncation { length });
        Ok(())
    }

    fn sync(&self) -> io::Result<()> {
        self.operate(|| "sync".to_owned(), |_, _| ());
        if self.room.as_ref().is_some_and(|room| room.borrow().is_multiple_of(4)) {
            return Err(self.failure(io::ErrorKind::Other));
        }
        if self.disk.network.borrow().mutation != Some(Mutation::NoSyncs) {
            let file = &mut *self.file.borrow_mut();
            file.changes.clear();
            file.synced.clone_from(&file.cached);
        }
        Ok(())
    }

    fn publish(&self) -> io::Result<()> {
        self.operate(|| "rename".to_owned(), |_, _| ());
        *self.disk.published.borrow_mut() = Some(Rc::clone(&self.file));
        Ok(())
    }
}
