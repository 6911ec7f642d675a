//! Programs that users name: where they are, and how they are started.

use std::path::{Path, PathBuf, absolute};
use std::process::Command;

/// What a server writes into the pipe of `--ready` when the agents that belong to its start may
/// start; a name of a scenario file stands for those of another run.
pub const AGENTS_OF_START: &str = "ready";

/// A path as a process in `folder` finds it, the present folder if that is empty.
#[must_use]
pub fn within(folder: &Path, path: &Path) -> PathBuf {
    let path = folder.join(path);
    absolute(&path).unwrap_or(path)
}

/// The command of a program and its arguments, in `folder`, the present one if that is empty. A
/// program with a `/` in its name is looked for from that folder, another one in `PATH`.
#[must_use]
pub fn command(words: &[String], folder: &Path) -> Command {
    let (program, arguments) = words.split_first().map_or(("", [].as_slice()), |(first, rest)| (first.as_str(), rest));
    // A relative path would be that of a folder which depends on the system.
    let path = if program.contains('/') { within(folder, Path::new(program)) } else { PathBuf::from(program) };
    let mut command = Command::new(path);
    command.args(arguments);
    if !folder.as_os_str().is_empty() {
        command.current_dir(folder);
    }
    command
}
