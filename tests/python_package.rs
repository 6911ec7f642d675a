//! The Python package: its own tests and its types, with a library of the features of the workspace
//! instead of a wheel; and a controller in Python as a ROS 2 node.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use tempfile::TempDir;

use crate::support::{binaries, python, root};

/// The longest wall time of the tests in Python, seconds, for `timeout`.
const HANG: &str = "600";

/// A folder with the package `maes`, as a wheel installs it.
fn package() -> &'static Path {
    static PACKAGE: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, folder) = PACKAGE.get_or_init(|| {
        let arguments = ["build", "--release", "-p", "maes_python", "--features", "unified", "--locked"];
        let built = binaries::cargo().args(arguments).output().expect("cargo runs");
        assert!(built.status.success(), "building the package:\n{}", String::from_utf8_lossy(&built.stderr));
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let package = folder.path().join("maes");
        fs::create_dir(&package).expect("a folder");
        for file in fs::read_dir(root().join("python/maes")).expect("the package has sources") {
            let file = file.expect("a folder can be listed").path();
            let is_source =
                file.extension().is_some_and(|ending| ["py", "pyi", "typed"].iter().any(|one| ending == *one));
            if is_source {
                fs::copy(&file, package.join(file.file_name().expect("a name"))).expect("a copy");
            }
        }
        let library = binaries::target_folder().join("release/lib_maes.so");
        symlink(library, package.join("_maes.abi3.so")).expect("a link");
        let path = folder.path().to_owned();
        (folder, path)
    });
    folder
}

/// Python with the package and what its tests need.
fn command() -> Command {
    let mut command = Command::new("timeout");
    command.args(["--signal=INT", "--kill-after=10", HANG]).arg(python::for_package());
    command.env("PYTHONPATH", package()).env("PYTHONDONTWRITEBYTECODE", "1").env("MPLBACKEND", "agg");
    command.current_dir(root().join("python"));
    command
}

/// The output of a command that has to succeed.
fn passed(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?} ({}):\n{text}", output.status);
    text
}

#[test]
fn tests_of_the_package_pass() {
    let text = passed(command().args(["-m", "pytest", "tests"]));
    assert!(text.contains(" passed"), "{text}");
}

#[test]
fn types_of_the_package_are_right() {
    let cache = tempfile::tempdir().expect("there is room for a folder");
    passed(command().args(["-m", "mypy", "--cache-dir"]).arg(cache.path()));
}

/// What the library exports is what the stubs say.
#[test]
fn stubs_match_the_library() {
    passed(command().args(["-m", "mypy.stubtest", "maes._maes", "--ignore-missing-stub"]));
}
