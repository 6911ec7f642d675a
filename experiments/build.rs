//! Names the build after the sources that decide what a run is: two builds with the same name make
//! the same runs.

use std::path::{Path, PathBuf};

/// What a run is made by, from the folder of the workspace. What only looks at runs is not among
/// it.
const SOURCES: [&str; 19] = [
    "Cargo.lock",
    "voxels/src",
    "mapgen/src",
    "map_files/src",
    "msgs/msg",
    "msgs/src",
    "system/src",
    "ros_node/src",
    "protocol/src",
    "world/src",
    "simulation/src",
    "transport/src",
    "recording/src",
    "sim_server/src",
    "agent/src",
    "controllers/src",
    "agent_node/src",
    "in_memory/src",
    "experiments/src/measure.rs",
];

fn main() -> std::io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace");
    let mut hasher = blake3::Hasher::new();
    for source in SOURCES {
        let source = root.join(source);
        println!("cargo::rerun-if-changed={}", source.display());
        let mut files = Vec::new();
        collect(&source, &mut files)?;
        files.sort();
        for file in files {
            let name = file.strip_prefix(root).expect("it was found below the root");
            hasher.update(name.to_string_lossy().as_bytes()).update(&[0]);
            hasher.update(blake3::hash(&std::fs::read(&file)?).as_bytes());
        }
    }
    println!("cargo::rustc-env=MAES_BUILD={}", &hasher.finalize().to_hex()[..12]);
    Ok(())
}

/// The files below a folder, or the file itself, without tests.
fn collect(place: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if place.is_dir() {
        for entry in std::fs::read_dir(place)? {
            collect(&entry?.path(), files)?;
        }
    } else if !place.ends_with("tests.rs") {
        files.push(place.to_owned());
    }
    Ok(())
}
