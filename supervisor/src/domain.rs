//! The lock on a ROS domain: two servers in one domain would share their agents.

use std::fs::{File, TryLockError};
use std::path::PathBuf;

use crate::SupervisorError;

/// The environment variable that ROS 2 reads.
pub const VARIABLE: &str = "ROS_DOMAIN_ID";

/// The domain of this process's environment.
#[must_use]
pub fn of_environment() -> String {
    std::env::var(VARIABLE).ok().filter(|domain| !domain.is_empty()).unwrap_or_else(|| "0".to_owned())
}

/// A domain that is this process's own among supervisors. Child processes do not inherit the lock.
#[derive(Debug)]
pub struct DomainLock {
    _file: File,
}

impl DomainLock {
    /// Takes the lock of a domain.
    ///
    /// # Errors
    /// If another process has it, or its file cannot be made.
    pub fn take(domain: &str) -> Result<Self, SupervisorError> {
        let path = path(domain);
        let file = File::create(&path).map_err(SupervisorError::of(&path))?;
        match file.try_lock() {
            Ok(()) => Ok(Self { _file: file }),
            Err(TryLockError::WouldBlock) => Err(SupervisorError::DomainTaken(domain.to_owned())),
            Err(TryLockError::Error(source)) => Err(SupervisorError::of(&path)(source)),
        }
    }
}

fn path(domain: &str) -> PathBuf {
    // The server says what is wrong with a domain that is no number; here it only has to be a name.
    std::env::temp_dir().join(format!("maes-domain-{}.lock", domain.replace('/', "_")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_domain_has_one_owner() {
        let name = format!("of/test {}", std::process::id());
        let first = DomainLock::take(&name).unwrap();
        assert!(matches!(DomainLock::take(&name), Err(SupervisorError::DomainTaken(taken)) if taken == name));
        drop(first);
        assert!(DomainLock::take(&name).is_ok());
        std::fs::remove_file(path(&name)).unwrap();
    }
}
