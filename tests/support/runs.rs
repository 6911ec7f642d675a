//! Runs as people start them: `run.sh`, the server, an agent, a run in memory.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use super::domains::Domain;
use super::processes::{Ended, Process};
use super::recordings::Recording;
use super::{Slot, binaries, root};

/// A place for runs: a ROS domain and a folder. Dropping it removes the folder.
pub(crate) struct Site {
    domain: Domain,
    folder: TempDir,
}

/// A run that is under way.
pub(crate) struct Run {
    process: Process,
    _slot: Slot,
}

/// A run that came to its end, with its recording.
pub(crate) struct Outcome {
    /// How it ended.
    pub(crate) ended: Ended,
    /// The bytes of the recording.
    pub(crate) bytes: Vec<u8>,
}

impl Site {
    pub(crate) fn new() -> Self {
        Self { domain: Domain::claim(), folder: tempfile::tempdir().expect("there is room for a folder") }
    }

    /// The domain.
    pub(crate) fn domain(&self) -> &Domain {
        &self.domain
    }

    /// A path in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A text file in the folder.
    pub(crate) fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, content).expect("the folder can be written to");
        path
    }

    /// The recording of that name.
    #[track_caller]
    pub(crate) fn recording(&self, name: &str) -> Recording {
        Recording::read(&self.path(name))
    }

    /// A command in the domain and the folder, with nothing else of ROS in its environment.
    pub(crate) fn command(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = Command::new(program);
        command
            .current_dir(self.folder.path())
            .env("ROS_DOMAIN_ID", self.domain.id().to_string())
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
            .env_remove("ROS_LOCALHOST_ONLY")
            .env("MAES_BIN_DIR", binaries::folder());
        command
    }

    /// One of the binaries.
    pub(crate) fn binary(&self, name: &str) -> Command {
        self.command(binaries::folder().join(name))
    }

    /// `run.sh` with these arguments. Its logs go into the folder.
    pub(crate) fn run_sh(&self, arguments: &[&str]) -> Command {
        let mut command = self.command(root().join("launch_scripts/run.sh"));
        command.args(arguments).arg("--logs").arg(self.path("logs"));
        command
    }

    /// Starts a run when it is its turn.
    pub(crate) fn start(&self, command: &mut Command) -> Run {
        let slot = Slot::take();
        Run { process: Process::start(command), _slot: slot }
    }

    /// Carries out `run.sh` with these arguments, and with a recording.
    #[track_caller]
    pub(crate) fn record(&self, arguments: &[&str]) -> Outcome {
        self.record_with(&mut self.run_sh(arguments))
    }

    /// Carries out a command that is a run, with a recording.
    #[track_caller]
    pub(crate) fn record_with(&self, command: &mut Command) -> Outcome {
        let file = self.path("compared.mcap");
        let ended = self.start(command.arg("--record").arg(&file)).ended().with_code(0);
        let bytes = std::fs::read(&file).expect("there is a recording");
        std::fs::remove_file(&file).expect("the recording can be removed");
        Outcome { ended, bytes }
    }
}

impl Outcome {
    /// The digest as it was printed.
    #[track_caller]
    pub(crate) fn digest(&self) -> String {
        self.ended.digest()
    }

    /// Fails if the other one is not the same run, byte for byte.
    #[track_caller]
    pub(crate) fn assert_same(&self, other: &Self, what: &str) {
        let difference = difference((&self.digest(), &self.bytes), (&other.digest(), &other.bytes));
        assert!(difference.is_none(), "{what}: {}", difference.unwrap_or_default());
    }
}

/// In what two runs differ, if they do: digests first, then the bytes of their recordings.
pub(crate) fn difference(one: (&str, &[u8]), two: (&str, &[u8])) -> Option<String> {
    let parting = || Recording::from_bytes(one.1).first_difference(&Recording::from_bytes(two.1));
    if one.0 != two.0 {
        Some(format!("digest {} or {}: {}", one.0, two.0, parting()))
    } else if one.1 != two.1 {
        Some(format!("same digest, but other bytes: {}", parting()))
    } else {
        None
    }
}

impl Run {
    /// The process.
    pub(crate) fn process(&mut self) -> &mut Process {
        &mut self.process
    }

    /// Waits until the clock has started and the run is some way on.
    #[track_caller]
    pub(crate) fn is_under_way(&mut self) {
        self.process.says("x real time");
    }

    /// Where people can look on, as the server says on stderr.
    #[track_caller]
    pub(crate) fn address(&mut self) -> String {
        let line = self.process.says("to look on: http://");
        line.split(['/', ' ']).find(|word| word.starts_with("127.")).expect("the line has an address").to_owned()
    }

    /// Waits for the end.
    #[track_caller]
    pub(crate) fn ended(self) -> Ended {
        self.process.ended()
    }
}

/// A scenario that comes with the project.
pub(crate) fn scenario(name: &str) -> PathBuf {
    root().join("launch_scripts/scenarios").join(name)
}

/// A path as an argument.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("paths of tests are texts")
}
