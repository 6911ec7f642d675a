//! The libFuzzer program: runs the target that an environment variable names.
#![no_main]

use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;

/// Environment variable with the name of one of [`fuzz::TARGETS`].
const VARIABLE: &str = "FUZZ_TARGET";

static TARGET: OnceLock<fn(&[u8])> = OnceLock::new();

fn target() -> fn(&[u8]) {
    let name = std::env::var(VARIABLE).unwrap_or_default();
    let known = fuzz::TARGETS.iter().find(|(known, _)| *known == name);
    known.unwrap_or_else(|| panic!("{VARIABLE}={name}: expected one of {:?}", fuzz::TARGETS.map(|(name, _)| name))).1
}

fuzz_target!(|bytes: &[u8]| TARGET.get_or_init(target)(bytes));
