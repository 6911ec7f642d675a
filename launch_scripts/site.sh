#!/usr/bin/env bash
# Builds the site: the documentation as a book, the API of the crates and of the Python package, and
# the page with recordings that play without a server:
#
#   launch_scripts/site.sh [FOLDER]     default: out/site
#
# Needs mdbook (cargo install mdbook --locked), npm and Python. `--no-api` leaves both APIs out.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
api=1
if [[ ${1:-} == --no-api ]]; then
    api=
    shift
fi
out=$(realpath -m "${1:-out/site}")
command -v mdbook >/dev/null || {
    echo "error: mdbook is missing: cargo install mdbook --locked" >&2
    exit 1
}
bin=$(launch_scripts/build.sh)
stage=$(mktemp -d)
trap 'rm -rf "$stage"' EXIT

# The documents link to each other and to files of the workspace, so the book has the same folders.
mkdir -p "$stage/src"
git ls-files -z -- '*.md' docs launch_scripts/scenarios experiments/plans examples \
    LICENSE-MIT LICENSE-APACHE CITATION.cff |
    tar --create --null --files-from - | tar --extract --directory "$stage/src"
sed -e 's,](\.\./,](,' -e t -e 's,](,](docs/,' docs/SUMMARY.md >"$stage/src/SUMMARY.md"
cat >"$stage/book.toml" <<'EOF'
[book]
title = "MAES: 3-D multi-robot exploration over ROS 2"
language = "en"

[output.html]
no-section-label = true
EOF
mdbook build --dest-dir "$out" "$stage" >&2

# The page and what it plays: the same cave, three algorithms.
"$bin/maes" view --build-only true >&2
mkdir -p "$out/page/recording"
cp -r viewer/dist/. "$out/page/"
for controller in rbw lvd dsvp; do
    "$bin/maes" run --agents 5 --controller "$controller" --transport memory \
        --record "$out/page/recording/$controller.mcap" >"$out/page/recording/$controller.txt" 2>/dev/null
done

if [[ -n $api ]]; then
    cargo doc --release --workspace --no-deps --locked --quiet
    cp -r "${CARGO_TARGET_DIR:-target}/doc" "$out/api"
    python=$(tests/python_env.sh documentation)
    cargo build --release --package maes_python --features unified --locked --quiet
    cp -r python/maes "$stage/maes"
    cp "${CARGO_TARGET_DIR:-target}/release/lib_maes.so" "$stage/maes/_maes.abi3.so"
    PYTHONPATH=$stage "$python" -m pdoc maes maes.envs maes.node --output-directory "$out/api/python" >&2
fi
echo "$out/index.html"
