//! The fuzz targets over their corpora and seeded mutations of them: a short, reproducible version
//! of `launch_scripts/fuzz.sh`.
//!
//! Mutations follow from a fixed seed and have a fixed number, so failures are reproducible. A
//! failure names its input.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use fuzz::{TARGETS, Target};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Mutations for each target: some seconds in all.
const MUTATIONS: [(&str, usize); TARGETS.len()] = [
    ("m3dm", 20_000),
    ("packed", 20_000),
    ("bt", 5_000),
    ("pcd", 5_000),
    ("ply", 5_000),
    ("obj", 2_000),
    ("stl", 2_000),
    ("vox", 5_000),
    ("pgm", 5_000),
    ("gltf", 2_000),
    ("las", 2_000),
    ("ot", 2_000),
    ("yaml", 5_000),
    ("dae", 2_000),
    ("sdf", 2_000),
    ("e57", 2_000),
    ("xyz", 5_000),
    ("picture", 2_000),
    ("trajectory", 5_000),
    ("scenario", 3_000),
    ("plan", 500),
    ("recording", 1_000),
    ("messages", 10_000),
    ("server", 300),
    ("agent", 5_000),
];

/// Most places of an input that one mutation changes.
const PLACES_MAX: usize = 8;

/// Longest piece that is repeated or removed, bytes.
const PIECE_MAX: usize = 64;

/// The corpus of a target: names and inputs, sorted.
fn corpus(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../testing/fuzz/corpus").join(target);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut inputs: Vec<_> = entries
        .map(|entry| {
            let path = entry.expect("a folder can be listed").path();
            let bytes = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            (path.display().to_string(), bytes)
        })
        .collect();
    inputs.sort();
    assert!(!inputs.is_empty(), "{}: there are no inputs", folder.display());
    inputs
}

/// Fails with the input if the target panics.
#[track_caller]
fn feed(target: Target, what: &str, bytes: &[u8]) {
    if catch_unwind(AssertUnwindSafe(|| target(bytes))).is_err() {
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        panic!("{what}, {} bytes: {hex}", bytes.len());
    }
}

/// Mutates a few places: bits, bytes, numbers of four bytes, repeated and removed pieces, and
/// pieces of another input.
fn mutated(mut bytes: Vec<u8>, other: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    for _ in 0..rng.random_range(1..=PLACES_MAX) {
        if bytes.is_empty() {
            return other.to_vec();
        }
        let at = rng.random_range(0..bytes.len());
        let end = (at + rng.random_range(1..=PIECE_MAX)).min(bytes.len());
        match rng.random_range(0..8u8) {
            0 | 1 => bytes[at] ^= 1 << rng.random_range(0..8u8),
            2 => bytes[at] = rng.random(),
            3 => {
                let number: u32 = [0, 1, u32::MAX, i32::MAX as u32, rng.random()][rng.random_range(0..5usize)];
                let place = at..(at + 4).min(bytes.len());
                bytes[place.clone()].copy_from_slice(&number.to_le_bytes()[..place.len()]);
            }
            4 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            5 => drop(bytes.drain(at..end)),
            6 => bytes.truncate(at),
            _ => {
                let piece = other[other.len().min(at)..other.len().min(end)].to_vec();
                bytes.splice(at..at, piece);
            }
        }
    }
    bytes
}

#[test]
fn mutated_corpus_breaks_no_target() {
    for ((name, target), (of, count)) in TARGETS.into_iter().zip(MUTATIONS) {
        assert_eq!(name, of, "the targets are those of the list");
        let inputs = corpus(name);
        for (input, bytes) in &inputs {
            feed(target, input, bytes);
        }
        let mut rng = voxels::random_streams::stream(1, 0, name);
        for number in 0..count {
            let (input, bytes) = &inputs[rng.random_range(0..inputs.len())];
            let (_, other) = &inputs[rng.random_range(0..inputs.len())];
            feed(target, &format!("{input}, mutation {number}"), &mutated(bytes.clone(), other, &mut rng));
        }
    }
}
