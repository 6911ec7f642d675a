//! Runs of the programs under test: `run.sh`, a server, an agent, an in-memory run.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use super::domains::Domain;
use super::processes::{Ended, Process};
use super::recordings::Recording;
use super::{Slot, binaries, root};

/// The join secret of all runs of a site.
const JOIN_SECRET: &str = "the join secret of the tests";

/// A ROS domain and a temporary folder for the runs of a test. Dropping it removes the folder.
pub(crate) struct Site {
    domain: Domain,
    folder: TempDir,
}

/// A run that has been started.
pub(crate) struct Run {
    process: Process,
    _slot: Slot,
}

/// A run that has ended, with its recording.
pub(crate) struct Outcome {
    pub(crate) ended: Ended,
    /// The bytes of the recording.
    pub(crate) bytes: Vec<u8>,
}

impl Site {
    pub(crate) fn new() -> Self {
        Self { domain: Domain::reserve(), folder: tempfile::tempdir().expect("there is room for a folder") }
    }

    pub(crate) fn domain(&self) -> &Domain {
        &self.domain
    }

    /// A path in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file in the folder.
    pub(crate) fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, content).expect("the folder can be written to");
        path
    }

    /// Reads a recording in the folder.
    #[track_caller]
    pub(crate) fn recording(&self, name: &str) -> Recording {
        Recording::read(&self.path(name))
    }

    /// A command in the domain and the folder, with no other setting of ROS in its environment.
    pub(crate) fn command(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = Command::new(program);
        command
            .current_dir(self.folder.path())
            .env("ROS_DOMAIN_ID", self.domain.id().to_string())
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
            .env_remove("ROS_LOCALHOST_ONLY")
            .env("MAES_BIN_DIR", binaries::folder())
            // So that a test can start an agent of a run by hand.
            .env(protocol::signing::JOIN_SECRET, JOIN_SECRET);
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

    /// Starts a run as soon as a slot is free.
    pub(crate) fn start(&self, command: &mut Command) -> Run {
        let slot = Slot::take();
        Run { process: Process::start(command), _slot: slot }
    }

    /// Runs `run.sh` with these arguments and a recording, to its end.
    #[track_caller]
    pub(crate) fn record(&self, arguments: &[&str]) -> Outcome {
        self.record_with(&mut self.run_sh(arguments))
    }

    /// Runs a command with `--record` to its end.
    #[track_caller]
    pub(crate) fn record_with(&self, command: &mut Command) -> Outcome {
        let file = self.path("compared.mcap");
        let ended = self.start(command.arg("--record").arg(&file)).ended().with_code(0);
        let bytes = std::fs::read(&file).expect("there is a recording");
        std::fs::remove_file(&file).expect("the recording can be removed");
        Outcome { ended, bytes }
    }

    /// Fails unless a fork in memory of `run.mcap` at a sim time, without a change, has this digest
    /// and verifies with its controllers.
    #[track_caller]
    pub(crate) fn assert_fork_is_same(&self, at_s: &str, digest: &str) {
        let maes = |arguments: &[&str]| Process::start(self.binary("maes").args(arguments)).ended().with_code(0);
        let fork = maes(&["run", "--transport", "memory", "--fork", "run.mcap", "--at", at_s, "--record", "fork.mcap"]);
        assert_eq!(fork.digest(), digest, "a fork without a change");
        assert_eq!(maes(&["verify", "fork.mcap", "--controllers"]).digest(), digest);
    }
}

impl Outcome {
    /// The printed digest.
    #[track_caller]
    pub(crate) fn digest(&self) -> String {
        self.ended.digest()
    }

    /// Fails unless both have the same digest and the same recording, byte for byte.
    #[track_caller]
    pub(crate) fn assert_same(&self, other: &Self, what: &str) {
        let difference = difference((&self.digest(), &self.bytes), (&other.digest(), &other.bytes));
        assert!(difference.is_none(), "{what}: {}", difference.unwrap_or_default());
    }
}

/// How two runs differ, if they do: first their digests, then the bytes of their recordings.
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
    pub(crate) fn process(&mut self) -> &mut Process {
        &mut self.process
    }

    /// Waits until the recording of the run has the digest of its first second of sim time.
    #[track_caller]
    pub(crate) fn is_under_way(&mut self, recording: &Path) {
        let has_first_second = |recording: Recording| recording.digests().len() >= 2;
        self.process.waits_until(|| Recording::read_so_far(recording).is_some_and(has_first_second));
    }

    /// The address of the Foxglove server, with its token, from the server's stderr:
    /// `127.0.0.1:PORT/?token=TOKEN`.
    #[track_caller]
    pub(crate) fn address(&mut self) -> String {
        let line = self.process.says("observe at http://");
        let url = line.split(' ').find_map(|word| word.strip_prefix("http://")).expect("the line has an address");
        url.to_owned()
    }

    /// Waits for the end.
    #[track_caller]
    pub(crate) fn ended(self) -> Ended {
        self.process.ended()
    }
}

/// The file of a scenario of the project.
pub(crate) fn scenario(name: &str) -> PathBuf {
    root().join("launch_scripts/scenarios").join(name)
}

/// A path as an argument.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("paths of tests are texts")
}
