//! The join secret of a run: from a file that only its owner can read, or from the environment.
//!
//! It is never an argument, because every user of a machine can read the arguments of a process.

use std::ffi::OsString;
use std::fs::OpenOptions;
use std::io::{self, Read};
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::Path;

use nix::errno::Errno;
use nix::fcntl::OFlag;
use protocol::signing::{JOIN_SECRET, JoinSecret, SECRET_BYTES_MAX, SecretLengthError};
use thiserror::Error;

/// Why there is no join secret.
#[derive(Debug, Error)]
pub enum JoinSecretError {
    #[error("--join-secret-file {file}: {source}")]
    Io { file: String, source: io::Error },
    #[error("--join-secret-file {file}: expected a regular file, and no link to one")]
    NotRegular { file: String },
    /// Others may have read it.
    #[error("--join-secret-file {file}: its mode is {mode:03o}; expected 600: chmod 600 {file}")]
    Readable { file: String, mode: u32 },
    #[error("{place}: {source}")]
    Length { place: String, source: SecretLengthError },
}

/// The secret of a file if one is named, and otherwise that of the environment, if there is one.
///
/// # Errors
/// If the file is not a regular file, can be accessed by others, or cannot be read, or the secret
/// has an illegal length.
pub fn read(
    file: Option<&Path>,
    variable: impl Fn(&str) -> Option<OsString>,
) -> Result<Option<JoinSecret>, JoinSecretError> {
    let (place, bytes) = match (file, variable(JOIN_SECRET)) {
        (Some(file), _) => (format!("--join-secret-file {}", file.display()), of_file(file)?),
        (None, Some(value)) => (JOIN_SECRET.to_owned(), value.into_vec()),
        (None, None) => return Ok(None),
    };
    match JoinSecret::new(&bytes) {
        Ok(secret) => Ok(Some(secret)),
        Err(source) => Err(JoinSecretError::Length { place, source }),
    }
}

fn of_file(path: &Path) -> Result<Vec<u8>, JoinSecretError> {
    let file = path.display().to_string();
    let failed = |source| JoinSecretError::Io { file: file.clone(), source };
    // A link is not followed, and a pipe without a writer does not block.
    let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK;
    let opened = match OpenOptions::new().read(true).custom_flags(flags.bits()).open(path) {
        Err(error) if error.raw_os_error() == Some(Errno::ELOOP as i32) => {
            return Err(JoinSecretError::NotRegular { file });
        }
        opened => opened.map_err(failed)?,
    };
    let metadata = opened.metadata().map_err(failed)?;
    let mode = metadata.permissions().mode() & 0o777;
    if !metadata.is_file() {
        return Err(JoinSecretError::NotRegular { file });
    }
    if mode & 0o077 != 0 {
        return Err(JoinSecretError::Readable { file, mode });
    }
    let mut bytes = Vec::new();
    opened.take(SECRET_BYTES_MAX as u64 + 2).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const TEXT: &str = "the secret of this test\n";

    /// A file of the test that is removed at its end.
    struct Scratch(std::path::PathBuf);

    impl Scratch {
        fn new(name: &str, text: &str, mode: u32) -> Self {
            let file = std::env::temp_dir().join(format!("maes-join-secret-{}-{name}", std::process::id()));
            fs::write(&file, text).unwrap();
            fs::set_permissions(&file, fs::Permissions::from_mode(mode)).unwrap();
            Self(file)
        }

        fn error(&self) -> String {
            let error = read(Some(&self.0), |_| None).unwrap_err().to_string();
            error.replace(&self.0.display().to_string(), "FILE")
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            drop(fs::remove_file(&self.0));
        }
    }

    #[test]
    fn a_file_comes_before_the_environment() {
        let file = Scratch::new("private", TEXT, 0o600);
        let variable = |name: &str| (name == JOIN_SECRET).then(|| OsString::from("the secret of the environment"));
        let secret = |text: &str| JoinSecret::new(text.as_bytes()).unwrap();
        assert_eq!(read(Some(&file.0), variable).unwrap(), Some(secret(TEXT)));
        assert_eq!(read(None, variable).unwrap(), Some(secret("the secret of the environment")));
        assert_eq!(read(None, |_| None).unwrap(), None);
        let error = read(None, |_| Some("x".into())).unwrap_err().to_string();
        let range = "a join secret has 16 to 4096 bytes without white space at its ends, not 1";
        assert_eq!(error, format!("MAES_JOIN_SECRET: {range}"));
    }

    #[test]
    fn only_private_regular_files_are_read() {
        let public = Scratch::new("public", TEXT, 0o640);
        assert_eq!(public.error(), "--join-secret-file FILE: its mode is 640; expected 600: chmod 600 FILE");
        let long = Scratch::new("long", &"x".repeat(SECRET_BYTES_MAX + 100), 0o600);
        assert!(long.error().starts_with("--join-secret-file FILE: a join secret has 16 to 4096 bytes"));
        let link = Scratch::new("link", "", 0o600);
        fs::remove_file(&link.0).unwrap();
        std::os::unix::fs::symlink(&public.0, &link.0).unwrap();
        assert_eq!(link.error(), "--join-secret-file FILE: expected a regular file, and no link to one");
        let folder = read(Some(&std::env::temp_dir()), |_| None).unwrap_err().to_string();
        assert!(folder.ends_with("expected a regular file, and no link to one"), "{folder}");
        assert!(read(Some(Path::new("/nowhere")), |_| None).is_err());
    }
}
