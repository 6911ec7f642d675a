//! The ROS 2 package `maes`: what its CMake installs works where it lies.

use std::fs;

use crate::support::runs::{Site, text};
use crate::support::{binaries, python, root};

/// Configures and installs what `colcon build` would, with the programs of this test. $1 is the
/// source, $2 the folder for the build, $3 that of the installation, $4 that of the programs.
const INSTALL: &str = r#"
cmake -G Ninja -S "$1" -B "$2" -DMAES_BIN_DIR="$4" -DCMAKE_INSTALL_PREFIX="$3" -DCMAKE_PREFIX_PATH="$AMENT_PREFIX_PATH" &&
    cmake --build "$2" && cmake --install "$2"
"#;

/// Prints where the launch file looks for the binaries. There is no wheel of `launch`, of which the
/// file only takes names when it is loaded.
const FOLDER_OF_BINARIES: &str = r#"
import runpy, sys
from unittest.mock import MagicMock
for name in ("launch", "launch.actions", "launch.conditions", "launch.event_handlers", "launch.substitutions"):
    sys.modules[name] = MagicMock()
print("binaries", runpy.run_path(sys.argv[1])["binaries"]())
"#;

/// Builds both packages with colcon. $1 is colcon, $2 the folder for what it makes, $3 that of the
/// programs.
const COLCON: &str = r#"
"$1" --log-base "$2/log" build --build-base "$2/build" --install-base "$2/install" \
    --paths msgs maes --cmake-args -G Ninja -DMAES_BIN_DIR="$3" &&
    . "$2/install/setup.sh" && "$2/install/maes/lib/maes/maes" --version &&
    python3 -c 'from maes_msgs.msg import Observation; print(Observation.__name__)'
"#;

#[test]
#[ignore = "installs colcon"]
fn colcon_builds_both_packages() {
    let site = Site::new();
    python::prepare_ros();
    let colcon = python::for_colcon().with_file_name("colcon");
    let mut build = site.command("bash");
    build.args(python::in_ros()).args(["sh", "-c", COLCON, "sh"]).arg(colcon).arg(site.path("colcon"));
    let printed = site.start(build.arg(binaries::folder()).current_dir(root())).ended().with_code(0).stdout;
    assert!(printed.contains("2 packages finished") && printed.trim_end().ends_with("\nObservation"), "{printed}");
}

#[test]
fn installed_package_runs() {
    let site = Site::new();
    python::prepare_ros();
    let [build, installed] = ["build", "installed"].map(|name| site.path(name));
    let mut install = site.command("bash");
    install.args(python::in_ros()).args(["sh", "-c", INSTALL, "sh"]).arg(root().join("maes"));
    site.start(install.arg(&build).arg(&installed).arg(binaries::folder())).ended().with_code(0);
    assert!(installed.join("share/ament_index/resource_index/packages/maes").is_file(), "ROS 2 finds the package");

    let share = installed.join("share/maes/launch");
    let flags = ["--agents", "2", "--size", "20", "--duration", "10", "--set", "stop_when_explored=false"];
    let over_memory = site.record(&[&flags[..], &["--transport", "memory"]].concat());
    let mut maes = site.command(installed.join("lib/maes/maes"));
    maes.env_remove("MAES_BIN_DIR").arg("run").arg(share.join("scenarios/default.toml")).args(flags);
    let ended = site.start(&mut maes).ended().with_code(0);
    assert_eq!(ended.digest(), over_memory.digest(), "the processes of the package");

    // The folders of a release.
    let release = site.path("release");
    for folder in ["bin", "share/maes/launch_scripts"] {
        fs::create_dir_all(release.join(folder)).expect("a folder");
    }
    fs::copy(binaries::folder().join("sim_server"), release.join("bin/sim_server")).expect("a copy");
    let released = release.join("share/maes/launch_scripts/maes.launch.py");
    fs::copy(root().join("launch_scripts/maes.launch.py"), &released).expect("a copy");

    for (file, expected) in [
        (released, fs::canonicalize(release.join("bin")).expect("it was made")),
        (share.join("maes.launch.py"), fs::canonicalize(installed.join("lib/maes")).expect("programs are installed")),
        (root().join("launch_scripts/maes.launch.py"), root().join("target/release")),
    ] {
        let mut launch = site.command("python3");
        let file = fs::canonicalize(file).expect("it is a file");
        launch.env_remove("MAES_BIN_DIR").args(["-c", FOLDER_OF_BINARIES]).arg(file);
        let printed = site.start(&mut launch).ended().with_code(0).stdout;
        assert_eq!(printed.trim_end(), format!("binaries {}", text(&expected)));
    }
}
