//! What is done with bytes from outside, one function for each kind of them: the targets of fuzzing.
//!
//! A target takes any bytes. It panics if a promise of docs/reliability.md is broken, and else does nothing. The same functions
//! run under libFuzzer (`launch_scripts/fuzz.sh`) and, over the corpus and seeded changes of it, in an ordinary test
//! (`tests/fuzzed.rs`).
//!
//! Invariants: a target is a function of its bytes, touches no file and no network, and ends. How much memory it may take is
//! limited by whoever runs it.

mod agent;
mod files;
mod lies;
mod maps;
mod messages;
mod server;

/// What is done with bytes.
pub type Target = fn(&[u8]);

/// All targets by name, which is that of the folder of their corpus, too.
pub const TARGETS: [(&str, Target); 15] = [
    ("m3dm", files::map),
    ("packed", maps::packed),
    ("bt", maps::octomap),
    ("pcd", maps::pcd),
    ("ply", maps::ply),
    ("obj", maps::obj),
    ("stl", maps::stl),
    ("vox", maps::vox),
    ("pgm", maps::pgm),
    ("scenario", files::scenario),
    ("plan", files::plan),
    ("recording", files::recording),
    ("messages", messages::all),
    ("server", server::run),
    ("agent", agent::take),
];
