#!/usr/bin/env bash
# Makes the files of a release a second time, from a clone in another folder, and compares them:
#
#   launch_scripts/check_reproducible.sh [FOLDER]     default: out/release, which release.sh has made
#
# Exit code 1 if a file differs.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
release=$(realpath "${1:-$root/out/release}")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
git clone --quiet "$root" "$folder/clone"
(unset CARGO_TARGET_DIR && "$folder/clone/launch_scripts/release.sh" "$folder/release" >&2)
diff "$release/SHA256SUMS" "$folder/release/SHA256SUMS"
echo "the same files, made in two folders"
