#!/usr/bin/env bash
# Follows README.md from the sources on a bare Debian: what is said without Rust and without a C
# compiler, and then the first run, from a clone of the last commit:
#
#   launch_scripts/check_sources.sh [SUITE]     default: bookworm
#
# Needs root, debootstrap and Rust, whose folders the bare system gets from this one. Prints how long
# the first run takes, with the build. Exit code 1 if a step fails. README's second command, the
# tests, is what .ci/run calls.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
suite=${1:-bookworm}
expected=$(sed -n 's/^digest: //p' "$root/README.md")
# shellcheck source=launch_scripts/bare_debian.sh
. "$root/launch_scripts/bare_debian.sh"
toolchain=$(cd "$root" && rustc --print sysroot)
cargo_home=${CARGO_HOME:-$HOME/.cargo}

bare_debian "$suite" --include=ca-certificates,git
mkdir -p "$system/opt/rust" "$system/opt/cargo"
cp /etc/resolv.conf "$system/etc/"
git clone --quiet "$root" "$system/maes"

inside() { chroot "$system" env --ignore-environment HOME=/root "$@"; }
first_run='cd /maes && launch_scripts/run.sh --agents 5 --record run.mcap'
said() {
    local text
    if text=$(inside "$@" bash -c "$first_run" 2>&1); then fail "it runs without what it needs"; fi
    echo "$text"
}
path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
said PATH="$path" | grep "install Rust from https://rustup.rs"
mount --bind "$toolchain" "$system/opt/rust"
mount --bind "$cargo_home" "$system/opt/cargo"
with_rust=(PATH="/opt/rust/bin:$path" CARGO_HOME=/opt/cargo)
said "${with_rust[@]}" | grep "apt install build-essential"
chroot "$system" sh -c 'apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq build-essential patch' \
    >/dev/null 2>&1 || fail "apt"

begun=$SECONDS
inside "${with_rust[@]}" bash -c "$first_run" >"$system/result.txt" 2>"$system/errors.txt" ||
    fail "$(tail -n 20 "$system/errors.txt")"
grep --fixed-strings --line-regexp "digest: $expected" "$system/result.txt"
echo "from a clone to the result of the first run: $((SECONDS - begun)) s"
