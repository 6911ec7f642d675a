//! The Python package: its own tests and its types, with a library of the features of the workspace
//! instead of a wheel; and a controller in Python as a ROS 2 node.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use tempfile::TempDir;

use crate::support::processes::Process;
use crate::support::recordings::Recording;
use crate::support::runs::Site;
use crate::support::{binaries, python, root};

/// The longest wall time of the tests in Python, seconds, for `timeout`.
const HANG: &str = "600";

/// A folder with the package `maes`, as a wheel installs it.
pub(crate) fn package() -> &'static Path {
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
    command_of(python::for_package())
}

/// Python with the package and what makes its documentation.
fn documenting() -> Command {
    command_of(python::for_documentation())
}

/// This interpreter with the package.
fn command_of(interpreter: &Path) -> Command {
    let mut command = Command::new("timeout");
    command.args(["--signal=INT", "--kill-after=10", HANG]).arg(interpreter);
    command.env("PYTHONPATH", package()).env("PYTHONDONTWRITEBYTECODE", "1").env("MPLBACKEND", "agg");
    // Not in the folder of the sources, whose `maes` has no library.
    command.current_dir(package());
    command
}

/// The configuration of the tools.
fn configuration() -> PathBuf {
    root().join("python/pyproject.toml")
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
    let text = passed(command().args(["-m", "pytest", "-c"]).arg(configuration()).arg(root().join("python/tests")));
    assert!(text.contains(" passed"), "{text}");
}

/// What `launch_scripts/site.sh` makes: each public name has its documentation.
#[test]
#[ignore = "installs pdoc and Jupyter"]
fn documentation_of_the_package_can_be_made() {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    let modules = ["maes", "maes.envs", "maes.node", "maes.rerun"];
    passed(documenting().args(["-m", "pdoc"]).args(modules).arg("--output-directory").arg(folder.path()));
    let page = |name: &str| fs::read_to_string(folder.path().join(name)).expect("a page");
    let (package, environments) = (page("maes.html"), page("maes/envs.html"));
    assert!(page("maes/rerun.html").contains("id=\"send\""), "the module for the viewer Rerun");
    for name in ["Scenario", "Recording", "Controller", "Auction", "batch"] {
        assert!(package.contains(&format!("id=\"{name}\"")), "{name} is in the page");
    }
    // From the stubs, because the library is native.
    assert!(package.contains("id=\"Ctx.search\"") && environments.contains("id=\"Worlds.step\""));
}

/// Each library takes the environments as its own, and trains on them.
#[test]
#[ignore = "installs PyTorch and six libraries for learning"]
fn learning_libraries_train() {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    let mut command = command_of(python::for_learning());
    command.env("HOME", folder.path()).env("RAY_TMPDIR", folder.path()).env("OMP_NUM_THREADS", "1");
    command.args(["-m", "pytest", "-p", "no:cacheprovider", "-c"]).arg(configuration());
    // Ray stays open beside the other ones.
    let text = passed(command.arg(root().join("tests/learning")));
    assert!(text.contains("10 passed"), "{text}");
}

/// The example of a training comes to its end, with a policy and figures.
#[test]
#[ignore = "installs PyTorch and six libraries for learning"]
fn learning_example_trains() {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    let mut command = command_of(python::for_learning());
    command.arg(root().join("examples/python/train_ppo.py")).arg(folder.path()).args(["--minutes", "0.3"]);
    passed(&mut command);
    for file in ["curve.csv", "curve.svg", "evaluation.csv"] {
        assert!(fs::metadata(folder.path().join(file)).is_ok_and(|found| found.len() > 0), "{file}");
    }
}

/// Tables do not depend on where runs are executed, nor on a worker that is killed meanwhile.
#[test]
#[ignore = "installs Dask, Ray and submitit"]
fn executors_lose_a_worker_and_give_the_same_tables() {
    for executor in ["dask", "ray", "submitit"] {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let mut command = command_of(python::for_executors());
        // Ray keeps files in both.
        command.env("HOME", folder.path()).env("RAY_TMPDIR", folder.path());
        command.arg(root().join("tests/executors.py")).arg(executor).arg(root().join("examples/python"));
        let text = passed(command.arg(folder.path()));
        assert!(text.contains("1 worker killed, same tables"), "{text}");
    }
}

/// The notebooks of the documentation: each cell works, and what should be a picture is one.
#[test]
#[ignore = "installs pdoc and Jupyter"]
fn notebooks_of_the_documentation_work() {
    let notebooks = root().join("docs/notebooks");
    let mut files: Vec<PathBuf> =
        fs::read_dir(&notebooks).expect("there are notebooks").map(|file| file.expect("a file").path()).collect();
    files.sort();
    // Notebooks draw with a backend of their own.
    let mut command = documenting();
    command.env_remove("MPLBACKEND").arg(root().join("tests/notebook.py")).args(&files);
    let text = passed(&mut command);
    for (name, pictures) in [("compare", 2), ("first_run", 2), ("own_controller", 1)] {
        let line = format!("{name}.ipynb: 4 cells, {pictures} pictures");
        assert!(text.contains(&line), "expected {line} in\n{text}");
    }
    assert_eq!(files.len(), 3, "each notebook is in the list above: {files:?}");
}

#[test]
fn types_of_the_package_are_right() {
    let cache = tempfile::tempdir().expect("there is room for a folder");
    passed(command().args(["-m", "mypy", "--config-file"]).arg(configuration()).arg("--cache-dir").arg(cache.path()));
}

/// What the library exports is what the stubs say.
#[test]
fn stubs_match_the_library() {
    let check = ["-m", "mypy.stubtest", "maes._maes", "--ignore-missing-stub", "--mypy-config-file"];
    passed(command().args(check).arg(configuration()));
}

/// Agent 0 is the example in Python, a ROS 2 node of its own; agent 1 is the same algorithm in
/// Rust.
#[test]
fn controller_in_python_is_a_ros_node() {
    let site = Site::new();
    let flags = ["--agents", "2", "--size", "30", "--duration", "30", "--controller", "nearest-frontier"];
    let flags = [&flags[..], &["--set", "stop_when_explored=false"]].concat();
    let result = |bytes: &[u8]| Recording::from_bytes(bytes).result();
    let in_rust = result(&site.record(&[&flags[..], &["--transport", "memory"]].concat()).bytes);
    let mut node = site.command(python::for_package());
    let example = root().join("examples/python/nearest_frontier.py").display().to_string() + ":NearestFrontier";
    node.env("PYTHONPATH", package()).env("PYTHONDONTWRITEBYTECODE", "1");
    let node = Process::start(node.args(["-m", "maes.node", &example, "--id", "0"]));
    let over_ros = site.record(&[&flags[..], &["--external", "0", "--join-timeout", "300"]].concat());
    node.ended().with_code(0);
    let in_python = result(&over_ros.bytes);
    assert!(in_python.distance_m.iter().all(|&distance_m| distance_m > 5.0), "{:?}", in_python.distance_m);
    assert_eq!((in_python.distance_m, in_python.explored_by), (in_rust.distance_m, in_rust.explored_by));
}
