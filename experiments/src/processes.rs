//! Processes that this one starts: each in a group of its own, in a ROS domain, and gone when nobody looks after it any more.
//!
//! Invariant: a [`Ward`] never outlives the value, so that a failure or a panic leaves no process behind.
//!
//! This module does not know what the processes do.

use std::io;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// Wall time between two looks at something that does not tell when it changes.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// A program in a ROS domain. Ctrl-C on the terminal is not for it, but for this process.
pub(crate) fn in_domain(program: &Path, domain: u32) -> Command {
    let mut command = Command::new(program);
    command.env("ROS_DOMAIN_ID", domain.to_string()).process_group(0).stdin(Stdio::null());
    command
}

/// Sends a signal, such as `TERM`; that the process is gone already is no failure.
pub(crate) fn signal(child: &Child, name: &str) -> io::Result<()> {
    let mut kill = Command::new("kill");
    kill.args(["-s", name, &child.id().to_string()]).stdin(Stdio::null()).stderr(Stdio::null()).status().map(drop)
}

/// A while between two looks.
#[expect(clippy::disallowed_methods, reason = "a process has no condition to wait on together with a flag")]
pub(crate) fn pause() {
    thread::sleep(LOOK_PERIOD);
}

/// Wall time.
#[expect(clippy::disallowed_methods, reason = "it says when processes are disturbed, and when a hang is one")]
pub(crate) fn now() -> Instant {
    Instant::now()
}

/// A process that is killed when this is dropped.
#[derive(Debug)]
pub(crate) struct Ward(Child);

impl Ward {
    /// Starts a command.
    pub(crate) fn start(command: &mut Command) -> io::Result<Self> {
        command.spawn().map(Self)
    }

    /// How it has ended, if it has.
    pub(crate) fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.0.try_wait()
    }

    /// See [`signal`].
    pub(crate) fn signal(&self, name: &str) -> io::Result<()> {
        signal(&self.0, name)
    }
}

impl Drop for Ward {
    fn drop(&mut self) {
        // Neither fails but for a process that is gone.
        drop(self.0.kill());
        drop(self.0.wait());
    }
}
