#!/usr/bin/env bash
# Makes the pictures of docs/viewer.md again: the page with a recording, and with two side by side.
#
#   docs/images/viewer.sh [FOLDER]      default: docs/images
#
# With MAES_BIN_DIR set, the `maes` of that folder runs, and nothing is built. The pictures need the
# built page, Node.js and Chromium (docs/viewer.md).
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
folder=$(realpath "${1:-$root/docs/images}")
bin=$("$root/launch_scripts/build.sh")
work=$(mktemp -d "${TMPDIR:-/tmp}/maes-pictures-XXXXXX")
trap 'rm -rf "$work"' EXIT
cd "$work"
PATH=$bin:$PATH

# record NAME FLAG...
record() {
    maes run --transport memory --record "$1.mcap" "${@:2}" >/dev/null
}

# take NAME SECONDS SIZE FILE...: FILE and the flags of `maes view`
take() {
    exec 3< <(exec maes view "${@:4}" --address 127.0.0.1:0 --browser false --page "$root/viewer/dist")
    local server=$! url
    read -r url <&3
    node "$root/docs/images/page.mjs" "$url" "$2" "$3" "$folder/$1.jpg"
    kill "$server"
    printf '%s\n' "$folder/$1.jpg"
}

record cave-100 --size 100 --agents 10 --controller dsvp --seed 2
record rbw --agents 5 --controller rbw
record dsvp --agents 5 --controller dsvp
take viewer 75 1600x900 cave-100.mcap
take side-by-side 60 1200x640 rbw.mcap --beside dsvp.mcap
