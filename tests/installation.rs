//! Other builds of `maes`: the one program that `cargo install` installs, which runs the server and
//! the agents as well, and the program without ROS 2, which Windows has.

use std::fs;
use std::process::Command;

use crate::support::runs::{Site, text};
use crate::support::{binaries, root};

#[test]
#[ignore = "compiles foreign crates again, with the features of one package"]
fn cargo_installs_a_program_that_runs_over_ros() {
    let site = Site::new();
    let folder = site.path("installed");
    let arguments = ["install", "--locked", "--path", "maes", "--root", text(&folder)];
    let built = binaries::cargo().args(arguments).output().expect("cargo runs");
    assert!(built.status.success(), "cargo install:\n{}", String::from_utf8_lossy(&built.stderr));
    let programs: Vec<_> = fs::read_dir(folder.join("bin")).expect("it has programs").flatten().collect();
    let mut names: Vec<_> = programs.iter().map(|program| program.file_name()).collect();
    names.sort();
    assert_eq!(names, ["maes"]);

    let flags = ["run", "--agents", "2", "--size", "20", "--duration", "20", "--set", "stop_when_explored=false"];
    let program = || -> Command {
        let mut program = site.command(folder.join("bin/maes"));
        program.env_remove("MAES_BIN_DIR").args(flags);
        program
    };
    let over_ros = site.record_with(&mut program());
    over_ros.assert_same(&site.record_with(program().args(["--transport", "memory"])), "installed by cargo");
}

#[test]
#[ignore = "compiles all crates again, without ROS 2"]
fn program_without_ros_works_over_memory() {
    let target = binaries::target_folder().join("without_ros");
    let arguments = ["build", "--release", "--locked", "-p", "maes", "--bin", "maes", "--no-default-features"];
    let built = binaries::cargo().args(arguments).arg("--target-dir").arg(&target).output().expect("cargo runs");
    assert!(built.status.success(), "cargo build:\n{}", String::from_utf8_lossy(&built.stderr));
    let program = target.join("release/maes");

    let checked = Command::new(root().join("launch_scripts/check_memory_path.sh")).arg(&program).output();
    let checked = checked.expect("the script runs");
    let printed = format!("{}{}", String::from_utf8_lossy(&checked.stdout), String::from_utf8_lossy(&checked.stderr));
    assert!(checked.status.success() && printed.contains("the memory path and the page work"), "{printed}");

    let refused = |arguments: &[&str]| {
        let ended = Command::new(&program).args(arguments).output().expect("it runs");
        assert_eq!(ended.status.code(), Some(2), "{arguments:?}");
        String::from_utf8_lossy(&ended.stderr).into_owned()
    };
    let over_ros = refused(&["run", "--transport", "ros2"]);
    assert_eq!(over_ros, "error: --transport ros2: this program was built without ROS 2; expected memory\n");
    assert!(refused(&["view"]).contains("without ROS 2; expected a recording (.mcap)"));
}
