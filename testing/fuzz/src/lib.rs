//! Fuzz targets: one function for each kind of bytes from outside.
//!
//! A target takes any bytes and panics if a promise of docs/reliability.md is broken. The same
//! functions run under libFuzzer (`launch_scripts/fuzz.sh`) and in an ordinary test over the corpus
//! and seeded mutations of it (`tests/fuzz_corpus.rs`).
//!
//! Invariants: a target is a function of its bytes, touches no file and no network, and terminates.
//! The caller limits its memory.

mod agent;
mod files;
mod hostile_messages;
mod maps;
mod messages;
mod server;

/// A function of bytes that panics if a promise is broken.
pub type Target = fn(&[u8]);

/// All targets by name, which is also the name of the folder of their corpus.
pub const TARGETS: [(&str, Target); 25] = [
    ("m3dm", files::map),
    ("packed", maps::packed),
    ("bt", maps::octomap),
    ("pcd", maps::pcd),
    ("ply", maps::ply),
    ("obj", maps::obj),
    ("stl", maps::stl),
    ("vox", maps::vox),
    ("pgm", maps::pgm),
    ("gltf", maps::gltf),
    ("las", maps::las),
    ("ot", maps::full_octomap),
    ("yaml", maps::yaml),
    ("dae", maps::collada),
    ("sdf", maps::world),
    ("e57", maps::survey),
    ("xyz", maps::text_cloud),
    ("picture", maps::picture),
    ("trajectory", maps::trajectory),
    ("scenario", files::scenario),
    ("plan", files::plan),
    ("recording", files::recording),
    ("messages", messages::all),
    ("server", server::run),
    ("agent", agent::take),
];
