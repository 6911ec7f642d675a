//! ROS domains, one for each test that needs one.

use std::fs::File;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::atomic::{AtomicU16, Ordering};

use supervisor::domain::DomainLock;
use system::file_lock::FileLock;

/// Above the usual domains, and below the ports that Linux hands out at random.
const DOMAINS: std::ops::Range<u16> = 30..100;

/// A ROS domain that nothing else on this machine uses.
///
/// A lock on a file keeps other test processes out; the system releases it when its process ends.
#[derive(Debug)]
pub(crate) struct Domain {
    id: u16,
    _lock: FileLock,
}

impl Domain {
    /// Reserves the next free domain.
    ///
    /// # Panics
    /// If there is none.
    pub(crate) fn reserve() -> Self {
        static NEXT: AtomicU16 = AtomicU16::new(0);
        for _ in DOMAINS {
            let id = DOMAINS.start + NEXT.fetch_add(1, Ordering::Relaxed) % DOMAINS.len() as u16;
            if let Some(lock) = lock_if_free(id) {
                return Self { id, _lock: lock };
            }
        }
        panic!("all ROS domains from {} to {} are in use", DOMAINS.start, DOMAINS.end - 1);
    }

    /// Its number.
    pub(crate) fn id(&self) -> u16 {
        self.id
    }
}

/// The lock of a domain in which there is no other test, no run of `maes` and no DDS participant.
fn lock_if_free(domain: u16) -> Option<FileLock> {
    let locked = |name: String| {
        let file =
            File::options().create(true).truncate(false).write(true).open(std::env::temp_dir().join(name)).ok()?;
        FileLock::exclusive(file).ok()
    };
    let lock = locked(format!("maes-test-domain-{domain}.lock"))?;
    // Runs of this user hold this one. It is released at once, for the runs of the test.
    DomainLock::take(&domain.to_string()).ok()?;
    is_silent(domain).then_some(lock)
}

/// Whether no participant on this machine has a port of the domain open.
///
/// DDSI-RTPS 2.5, 9.6.2.3: a domain has 250 ports from 7400 on. Its participants share the first
/// two, for multicast, and the one with index n has 10 + 2n and 11 + 2n to itself.
fn is_silent(domain: u16) -> bool {
    let base = 7400 + 250 * domain;
    [0, 1].into_iter().chain(10..250).all(|offset| UdpSocket::bind((Ipv4Addr::UNSPECIFIED, base + offset)).is_ok())
}
