//! Maps for the programs of others: trimesh, Open3D, pyoctomap and the tools of PCL open what is
//! exported and recorded, and find the same map.

use std::process::Command;

use crate::support::runs::Site;
use crate::support::{python, root};

#[test]
#[ignore = "installs Open3D, trimesh and pyoctomap"]
fn tools_of_others_open_maps_and_topics() {
    let site = Site::new();
    let maes = |arguments: &[&str]| site.start(site.binary("maes").args(arguments)).ended().with_code(0);
    let size = ["--size", "48x40x14", "--cell-m", "0.5", "--radius-max", "5", "--seed", "3"];
    maes(&[&["map", "generate", "-o", "cave.m3dm"], &size[..]].concat());
    for name in ["cave.txt", "cave.obj", "cave.stl", "cave.glb", "cave.pcd", "cave.bt"] {
        maes(&["map", "convert", "cave.m3dm", name]);
    }
    let topics = "octomap,explored_octomap,explored_occupancy,explored_points";
    let run = ["run", "--transport", "memory", "--map", "cave.m3dm", "--agents", "2", "--duration", "30"];
    maes(&[&run[..], &["--set", "body.radius_m=0.2", "--record", "run.mcap", "--record-topics", topics]].concat());
    let mut tools = Command::new(python::for_map_tools());
    let output = tools.arg(root().join("tests/map_tools.py")).arg(site.path(".")).output().expect("it starts");
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{printed}\n{}", String::from_utf8_lossy(&output.stderr));
    assert!(printed.lines().filter(|line| line.starts_with("ok: ")).count() > 20, "{printed}");
}
