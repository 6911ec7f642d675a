//! `cargo install`: the one program that it installs runs the server and the agents as well.

use std::fs;
use std::process::Command;

use crate::support::binaries;
use crate::support::runs::{Site, text};

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
    assert_eq!(names, ["experiments", "maes"], "the second one is the former name of some commands");

    let flags = ["run", "--agents", "2", "--size", "20", "--duration", "20", "--set", "stop_when_explored=false"];
    let program = || -> Command {
        let mut program = site.command(folder.join("bin/maes"));
        program.env_remove("MAES_BIN_DIR").args(flags);
        program
    };
    let over_ros = site.record_with(&mut program());
    over_ros.assert_same(&site.record_with(program().args(["--transport", "memory"])), "installed by cargo");
}
