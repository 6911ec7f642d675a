//! The lock on a ROS domain: two servers in one domain would share their agents.
//!
//! Invariants: the locks of a user are in a folder that only that user can write to, so that no
//! other user can hold them or put something in their place; a lock file is never truncated, and no
//! symbolic link is followed to it. So the lock keeps apart the runs of one user; those of
//! different users in one domain are kept apart by the server, which refuses a domain with another
//! server.

use std::fs::{self, DirBuilder, OpenOptions, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use nix::fcntl::OFlag;
use nix::unistd::geteuid;
use system::file_lock::FileLock;

use crate::SupervisorError;

/// The environment variable that ROS 2 reads.
pub const VARIABLE: &str = "ROS_DOMAIN_ID";

/// The environment variable with the user's folder for sockets and locks, which ends with the
/// session.
const RUNTIME_VARIABLE: &str = "XDG_RUNTIME_DIR";

/// Permissions of the folder of the locks.
const PRIVATE: u32 = 0o700;

/// The domain of this process's environment.
#[must_use]
pub fn of_environment() -> String {
    std::env::var(VARIABLE).ok().filter(|domain| !domain.is_empty()).unwrap_or_else(|| "0".to_owned())
}

/// A domain that is this process's own among the supervisors of a user. Child processes do not
/// inherit the lock.
#[derive(Debug)]
pub struct DomainLock {
    _lock: FileLock,
}

impl DomainLock {
    /// Takes the lock of a domain.
    ///
    /// # Errors
    /// If another process has it, its file cannot be made, or its folder is not the user's own.
    pub fn take(domain: &str) -> Result<Self, SupervisorError> {
        let runtime = std::env::var_os(RUNTIME_VARIABLE).filter(|folder| !folder.is_empty()).map(PathBuf::from);
        let folder = folder(runtime.as_deref(), &std::env::temp_dir())?;
        Self::take_in(&folder, domain)
    }

    fn take_in(folder: &Path, domain: &str) -> Result<Self, SupervisorError> {
        // The server says what is wrong with a domain that is no number; here it only has to be a
        // name.
        let path = folder.join(format!("domain-{}.lock", domain.replace('/', "_")));
        let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK;
        let opened = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .custom_flags(flags.bits())
            .open(&path);
        let file = opened.map_err(SupervisorError::of(&path))?;
        match FileLock::exclusive(file) {
            Ok(lock) => Ok(Self { _lock: lock }),
            Err(TryLockError::WouldBlock) => Err(SupervisorError::DomainTaken(domain.to_owned())),
            Err(TryLockError::Error(source)) => Err(SupervisorError::of(&path)(source)),
        }
    }
}

/// The private folder of the user's locks: `maes` in the runtime folder if that is the user's own,
/// else `maes-<user id>` in the folder for temporary files. It is made if it is missing.
fn folder(runtime: Option<&Path>, temporary: &Path) -> Result<PathBuf, SupervisorError> {
    let folder = match runtime.filter(|runtime| check_private(runtime).is_ok()) {
        Some(runtime) => runtime.join("maes"),
        None => temporary.join(format!("maes-{}", geteuid())),
    };
    match DirBuilder::new().mode(PRIVATE).create(&folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(SupervisorError::of(&folder)(error)),
        _ => check_private(&folder).map_err(SupervisorError::of(&folder))?,
    }
    Ok(folder)
}

/// Whether a folder is no link, belongs to this user, and no other user can write to it or read it.
fn check_private(folder: &Path) -> io::Result<()> {
    let there = fs::symlink_metadata(folder)?;
    let (owner, mode) = (there.uid(), there.mode() & 0o777);
    let what = if !there.is_dir() {
        "no folder".to_owned()
    } else if owner != geteuid().as_raw() {
        format!("a folder of user {owner}")
    } else if mode != PRIVATE {
        format!("a folder with mode {mode:o}")
    } else {
        return Ok(());
    };
    let expected = format!("expected a folder of user {} with mode {PRIVATE:o}", geteuid());
    Err(io::Error::other(format!("{what}, {expected}; remove it, or set {RUNTIME_VARIABLE}")))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn a_domain_has_one_owner() {
        let place = tempfile::tempdir().unwrap();
        let folder = folder(None, place.path()).unwrap();
        let name = "of/test";
        let first = DomainLock::take_in(&folder, name).unwrap();
        assert!(
            matches!(DomainLock::take_in(&folder, name), Err(SupervisorError::DomainTaken(taken)) if taken == name)
        );
        assert!(DomainLock::take_in(&folder, "7").is_ok());
        drop(first);
        assert!(DomainLock::take_in(&folder, name).is_ok());
    }

    #[test]
    fn folder_is_private() {
        let place = tempfile::tempdir().unwrap();
        let own = format!("maes-{}", geteuid());
        let made = folder(None, place.path()).unwrap();
        assert_eq!(made, place.path().join(&own));
        assert_eq!(fs::symlink_metadata(&made).unwrap().mode() & 0o777, PRIVATE);
        assert_eq!(folder(None, place.path()).unwrap(), made);

        // A runtime folder that others can read is not used.
        let runtime = tempfile::tempdir().unwrap();
        fs::set_permissions(runtime.path(), fs::Permissions::from_mode(PRIVATE)).unwrap();
        assert_eq!(folder(Some(runtime.path()), place.path()).unwrap(), runtime.path().join("maes"));
        fs::set_permissions(runtime.path(), fs::Permissions::from_mode(0o777)).unwrap();
        assert_eq!(folder(Some(runtime.path()), place.path()).unwrap(), made);
        assert_eq!(folder(Some(Path::new("/nowhere")), place.path()).unwrap(), made);

        // What another user has prepared is refused.
        let refuse = || folder(None, place.path()).unwrap_err().to_string();
        fs::set_permissions(&made, fs::Permissions::from_mode(0o777)).unwrap();
        assert!(refuse().contains("a folder with mode 777, expected "), "{}", refuse());
        fs::remove_dir(&made).unwrap();
        symlink(runtime.path(), &made).unwrap();
        assert!(refuse().contains("no folder, expected "), "{}", refuse());
    }

    #[test]
    fn folder_of_another_user_is_refused() {
        // The root of the file system belongs to root; root itself can make a folder of another
        // user.
        let error = if geteuid().is_root() {
            let place = tempfile::tempdir().unwrap();
            let foreign = place.path().join(format!("maes-{}", geteuid()));
            DirBuilder::new().mode(PRIVATE).create(&foreign).unwrap();
            std::os::unix::fs::chown(&foreign, Some(65_534), None).unwrap();
            folder(None, place.path()).unwrap_err().to_string()
        } else {
            check_private(Path::new("/")).unwrap_err().to_string()
        };
        assert!(error.contains("a folder of user "), "{error}");
    }

    #[test]
    fn a_link_is_not_followed_and_a_file_not_truncated() {
        let place = tempfile::tempdir().unwrap();
        let victim = place.path().join("victim");
        fs::write(&victim, "precious").unwrap();
        symlink(&victim, place.path().join("domain-7.lock")).unwrap();
        assert!(matches!(DomainLock::take_in(place.path(), "7"), Err(SupervisorError::Io { .. })));
        assert_eq!(fs::read(&victim).unwrap(), b"precious");
        fs::write(place.path().join("domain-8.lock"), "a note").unwrap();
        drop(DomainLock::take_in(place.path(), "8").unwrap());
        assert_eq!(fs::read(place.path().join("domain-8.lock")).unwrap(), b"a note");
    }
}
