//! The pipe by which a server says that agents may be started.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use nix::fcntl::OFlag;
use nix::sys::stat::Mode;
use nix::unistd::mkfifo;
use system::program::StartableAgents;

use crate::SupervisorError;

/// A named pipe. Dropping it removes its name.
#[derive(Debug)]
pub struct ReadyPipe {
    path: PathBuf,
    file: File,
    /// The beginning of a line that is not whole.
    line: Vec<u8>,
}

impl ReadyPipe {
    /// Makes the pipe `ready` in a folder, in the place of one that was left there.
    ///
    /// # Errors
    /// If the folder cannot have one.
    pub fn create(folder: &Path) -> Result<Self, SupervisorError> {
        let path = folder.join("ready");
        let failed = SupervisorError::of(&path);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failed(error)),
            _ => {}
        }
        mkfifo(&path, Mode::S_IRUSR | Mode::S_IWUSR).map_err(|errno| failed(errno.into()))?;
        // Opened for writing as well, so that it never ends and opening does not wait for a writer.
        let file = OpenOptions::new().read(true).write(true).custom_flags(OFlag::O_NONBLOCK.bits()).open(&path);
        let file = file.map_err(failed)?;
        Ok(Self { path, file, line: Vec::new() })
    }

    /// The value of the server's flag `--ready`.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The next agents that may start, if there is a whole line.
    ///
    /// # Errors
    /// If the pipe cannot be read.
    pub fn next_agents(&mut self) -> io::Result<Option<StartableAgents>> {
        let mut part = [0; 1024];
        loop {
            if let Some(end) = self.line.iter().position(|&byte| byte == b'\n') {
                let line: Vec<u8> = self.line.drain(..=end).collect();
                return Ok(Some(StartableAgents::of_line(&String::from_utf8_lossy(&line[..end]))));
            }
            match self.file.read(&mut part) {
                Ok(length) => self.line.extend_from_slice(&part[..length]),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(None),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}

impl AsFd for ReadyPipe {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

impl Drop for ReadyPipe {
    fn drop(&mut self) {
        drop(fs::remove_file(&self.path));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_out_whole_and_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let mut pipe = ReadyPipe::create(folder.path()).unwrap();
        assert_eq!(pipe.next_agents().unwrap(), None);
        fs::write(pipe.path(), "ready\nrun_1.toml\nrun").unwrap();
        assert_eq!(pipe.next_agents().unwrap(), Some(StartableAgents::OfStart));
        assert_eq!(pipe.next_agents().unwrap(), Some(StartableAgents::OfScenario("run_1.toml".into())));
        assert_eq!(pipe.next_agents().unwrap(), None);
        fs::write(pipe.path(), "_2.toml\n").unwrap();
        assert_eq!(pipe.next_agents().unwrap(), Some(StartableAgents::OfScenario("run_2.toml".into())));
        drop(pipe);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_pipe_that_was_left_behind_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("ready"), "stale\n").unwrap();
        assert_eq!(ReadyPipe::create(folder.path()).unwrap().next_agents().unwrap(), None);
    }
}
