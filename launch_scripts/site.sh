#!/usr/bin/env bash
# Builds the site: the documentation as a book, the API of the crates and of the Python package, and
# the page with recordings that play without a server:
#
#   launch_scripts/site.sh [FOLDER]     default: out/site
#
# Needs npm and Python; installs mdBook into a folder of its own if it is missing. `--no-api` leaves
# both APIs out. At the end every link of the pages is checked. Exit code 1 if a step fails or a link
# is broken.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
api=1
if [[ ${1:-} == --no-api ]]; then
    api=
    shift
fi
out=$(realpath -m "${1:-out/site}")
if ! command -v mdbook >/dev/null; then
    tools=${XDG_CACHE_HOME:-${HOME:?}/.cache}/maes-mdbook
    cargo install mdbook --version 0.5.4 --locked --quiet --root "$tools" >&2
    PATH=$tools/bin:$PATH
fi
bin=$(launch_scripts/build.sh)
stage=$(mktemp -d)
trap 'rm -rf "$stage"' EXIT

# The documents link to each other and to files of the workspace, so the book has the same folders.
# Beside the chapters it has these; a test compares the links with this list.
copied=(docs launch_scripts/scenarios experiments/plans examples msgs/msg LICENSE-MIT LICENSE-APACHE
    CITATION.cff)
mkdir -p "$stage/src"
git ls-files -z --cached --others --exclude-standard -- '*.md' "${copied[@]}" |
    tar --create --null --files-from - | tar --extract --directory "$stage/src"
sed -e 's,](\.\./,](,' -e t -e 's,](,](docs/,' docs/SUMMARY.md >"$stage/src/SUMMARY.md"
cat >"$stage/book.toml" <<'EOF'
[book]
title = "MAES: 3-D multi-robot exploration over ROS 2"
language = "en"

# A README stays README.html, as the links to it say.
[build]
use-default-preprocessors = false

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
    # Pages of an earlier call would mix with these.
    rm -rf "${CARGO_TARGET_DIR:-target}/doc"
    cargo doc --release --workspace --exclude maes_python --lib --no-deps --locked --quiet
    rm -rf "$out/api"
    cp -r "${CARGO_TARGET_DIR:-target}/doc" "$out/api"
    echo '<!DOCTYPE html><title>API</title><meta http-equiv="refresh" content="0; url=../docs/api.html">' \
        >"$out/api/index.html"
    python=$(tests/python_env.sh documentation)
    cargo build --release --package maes_python --features unified --locked --quiet
    cp -r python/maes "$stage/maes"
    cp "${CARGO_TARGET_DIR:-target}/release/lib_maes.so" "$stage/maes/_maes.abi3.so"
    PYTHONPATH=$stage "$python" -m pdoc maes maes.envs maes.node maes.rerun \
        --output-directory "$out/api/python" >&2
fi
launch_scripts/check_site.py "$out" >&2
echo "$out/index.html"
