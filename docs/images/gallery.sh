#!/usr/bin/env bash
# Makes the maps and pictures of docs/gallery.md again, with the commands of that page, and prints
# the hashes of the maps.
#
#   docs/images/gallery.sh [FOLDER]      default: docs/images
#
# With MAES_BIN_DIR set, the `maes` of that folder runs, and nothing is built. The pictures need the
# built page, Node.js and Chromium (docs/viewer.md).
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
folder=$(realpath "${1:-$root/docs/images}")
bin=$("$root/launch_scripts/build.sh")
work=$(mktemp -d "${TMPDIR:-/tmp}/maes-gallery-XXXXXX")
trap 'rm -rf "$work"' EXIT
cd "$work"
PATH=$bin:$PATH

ln -s "$root/launch_scripts" .
# The commands of the page that make something.
while read -r command; do
    read -ra words <<<"$command"
    report=$("${words[@]}")
    hash=$(sed -n 's/^blake3 *//p' <<<"$report")
    printf '%s\n' "$command${hash:+  # $hash}"
done < <(sed -n '/^maes \(map\|run\|snapshot\) /p' "$root/docs/gallery.md")
mv ./*.png "$folder"
