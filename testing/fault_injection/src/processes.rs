//! Helpers of fault injection: processes in a ROS domain, and polling.

use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::Duration;

use supervisor::domain;

/// Wall time between two polls of processes and recordings.
const PERIOD: Duration = Duration::from_millis(50);

/// A program in a ROS domain.
pub(crate) fn in_domain(program: &Path, id: u32) -> Command {
    let mut command = Command::new(program);
    command.env(domain::VARIABLE, id.to_string());
    command
}

/// Waits for the next poll.
#[expect(clippy::disallowed_methods, reason = "a process has no condition to wait on together with a recording")]
pub(crate) fn pause() {
    thread::sleep(PERIOD);
}
