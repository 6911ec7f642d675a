#!/usr/bin/env bash
# Checks what `maes` can do without ROS 2, on any system: a run over memory with the digest of
# README.md, its verification, a small plan with its report, and the recording on the page.
#
#   launch_scripts/check_memory_path.sh MAES...      the program, as words: `wine maes.exe` are two
#
# The program needs the page in it (feature `embedded_page`), or a page beside it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
(($#)) || { echo "usage: ${BASH_SOURCE[0]} MAES..." >&2; exit 2; }

folder=$(mktemp -d)
server=
trap '[[ -z $server ]] || kill "$server" 2>/dev/null || true; rm -rf "$folder"' EXIT
# Windows ends lines with CR LF.
lines() { tr -d '\r'; }

"$@" run --agents 5 --transport memory --record "$folder/run.mcap" | lines >"$folder/run.txt"
grep --fixed-strings --line-regexp "$(grep '^digest: .' README.md)" "$folder/run.txt"
"$@" verify --controllers "$folder/run.mcap" | lines

"$@" batch experiments/plans/quick.toml --out "$folder/quick" --report | lines
[[ -s $folder/quick/report/report.html ]]

# It prints the address once the page is served.
exec 3< <(exec "$@" view "$folder/run.mcap" --address 127.0.0.1:0 --browser false)
server=$!
read -r url <&3
curl --silent --show-error --fail --location --cookie '' "${url%$'\r'}" | grep '<title>'
echo "the memory path and the page work"
