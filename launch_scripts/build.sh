#!/usr/bin/env bash
# Builds the binaries if needed, and prints their folder on stdout; everything else is on stderr.
# They have the fixes of contrib/rustdds (see patched_rustdds.sh).
#
# With MAES_BIN_DIR set, that is the folder and nothing is built. Exit code 1 if something that the
# build needs is missing.
set -eu
if [[ -n ${MAES_BIN_DIR:-} ]]; then
    echo "$MAES_BIN_DIR"
    exit
fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${CARGO_TARGET_DIR:-$root/target}/release

missing() {
    printf 'error: %s\n' "$1" >&2
    exit 1
}

command -v cargo >/dev/null || missing "cargo is missing: install Rust from https://rustup.rs"
command -v cc >/dev/null ||
    missing "a C compiler is missing: install gcc or clang, on Debian and Ubuntu with: apt install build-essential"
needed=$(sed -n 's/^rust-version = "\(.*\)"$/\1/p' "$root/Cargo.toml")
found=$(cd "$root" && cargo --version) || missing "cargo does not run: install a toolchain with: rustup default stable"
found=$(cut -d ' ' -f 2 <<<"$found")
[[ $(printf '%s\n' "$needed" "$found" | sort -V | head -n 1) == "$needed" ]] ||
    missing "Rust $needed or later is needed, and this is $found: update it with: rustup update"

[[ -x $bin/maes ]] || echo "The first build takes about seven minutes on two cores." >&2
"$root/launch_scripts/patched_rustdds.sh" >/dev/null
# `--examples`, of which there are none, makes cargo build foreign crates with the features that tests
# ask for: so `cargo test --release` does not build them again.
(cd "$root" && cargo build --release --bins --examples >&2)
echo "$bin"
