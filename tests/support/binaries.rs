//! The binaries under test, built once.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use super::root;

/// The folder with `maes`, `sim_server` and `agent_node`, as they are delivered.
pub(crate) fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        // `--examples`, of which there are none, makes cargo build crates with the features that
        // development dependencies ask for, as `cargo test` does. Otherwise all would be built
        // again (`tests/dependencies.rs`).
        let arguments = ["build", "--release", "--bins", "--examples"];
        let packages = ["-p", "sim_server", "-p", "agent_node", "-p", "maes"];
        let mut build = cargo();
        build.args(arguments).args(packages);
        if cfg!(feature = "zenoh") {
            build.args(["--features", "sim_server/zenoh,agent_node/zenoh,maes/zenoh"]);
        }
        let built = build.output().expect("cargo runs");
        assert!(built.status.success(), "building the binaries:\n{}", String::from_utf8_lossy(&built.stderr));
        target_folder().join("release")
    })
}

/// Cargo, in the workspace, with the target folder of this test.
pub(crate) fn cargo() -> Command {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(root()).env("CARGO_TARGET_DIR", target_folder());
    cargo
}

/// The target folder of cargo: this test lies in `<target>/<profile>/deps`.
pub(crate) fn target_folder() -> PathBuf {
    let test = std::env::current_exe().expect("the test knows where it is");
    test.ancestors().nth(3).expect("a test lies in <target>/<profile>/deps").to_owned()
}
