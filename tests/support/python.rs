//! Python environments, which scripts make once and keep.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use super::root;

/// Longest wall time for downloading and building packages, seconds, for `timeout`.
const INSTALLATION: &str = "1500";

/// The interpreter with the usual readers of recordings.
pub(crate) fn for_recordings() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("recording"))
}

/// The interpreter with programs that check, convert and read recordings.
pub(crate) fn for_clients() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("clients"))
}

/// The interpreter with the viewer Rerun.
pub(crate) fn for_rerun() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("rerun"))
}

/// The interpreter with what the tests of the Python package need.
pub(crate) fn for_package() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("package"))
}

/// The interpreter that makes the documentation of the Python package, and executes notebooks.
pub(crate) fn for_documentation() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("documentation"))
}

/// The interpreter with Dask, Ray and submitit.
pub(crate) fn for_executors() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("executors"))
}

/// The interpreter with libraries for learning.
pub(crate) fn for_learning() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("learning"))
}

/// The interpreter with what opens maps: trimesh, Open3D and pyoctomap.
pub(crate) fn for_map_tools() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("map_tools"))
}

/// The interpreter with evo.
pub(crate) fn for_trajectories() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("evo"))
}

/// The interpreter with SIERRA.
pub(crate) fn for_sierra() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("sierra"))
}

/// The interpreter with colcon.
pub(crate) fn for_colcon() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("colcon"))
}

/// The interpreter with Cyclone DDS.
pub(crate) fn for_cyclone() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("cyclone"))
}

/// The interpreter with Zenoh, and an implementation of the format of rmw_zenoh.
#[cfg(feature = "zenoh")]
pub(crate) fn for_zenoh() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment("zenoh"))
}

/// The interpreter with the packages of a requirements file.
fn environment(name: &str) -> PathBuf {
    let mut command = Command::new("timeout");
    command.arg(INSTALLATION).arg(root().join("tests/python_env.sh")).arg(name);
    PathBuf::from(prepared(&mut command).trim_end())
}

/// Prepares a ROS 2 with the messages of this project. Commands run in it behind the arguments of
/// [`in_ros`].
pub(crate) fn prepare_ros() {
    static PREPARED: OnceLock<()> = OnceLock::new();
    PREPARED.get_or_init(|| {
        prepared(Command::new("timeout").arg(INSTALLATION).arg(root().join("launch_scripts/ros_env.sh")));
    });
}

/// Arguments for `bash`: a script that runs what follows in the ROS 2 of [`prepare_ros`].
pub(crate) fn in_ros() -> [String; 3] {
    let script = root().join("launch_scripts/ros_env.sh");
    ["-c".to_owned(), format!("eval \"$({})\" && exec \"$@\"", script.display()), "bash".to_owned()]
}

/// The output of a command that has to succeed.
fn prepared(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?} ({}):\n{complaint}", output.status);
    String::from_utf8(output.stdout).expect("paths are texts")
}
