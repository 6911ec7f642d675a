#!/usr/bin/env bash
# Measures recordings and prints the figures of docs/benchmarks.md:
#
#   launch_scripts/bench_recordings.sh [ROUNDS] [FOLDER]      default: 5 rounds, a temporary folder
#
# Bytes of half an hour of ten agents; processor time of a recorded run and of `maes verify`, each
# by that of a run in memory, in runs whose order turns from round to round; `maes diff` of two
# recordings of 1 GB with the same bytes, and of two that differ in their bytes alone. Takes 3 GB of
# the folder. With MAES_BIN_DIR set, its binaries run. The machine should have nothing else to do.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
maes=$("$here/build.sh")/maes
rounds=${1:-5}
out=$(mktemp -d "${2:-${TMPDIR:-/tmp}}/maes-bench-XXXXXX")
trap 'rm -rf "$out"' EXIT
TIMEFORMAT='%U %S %R'

# Seconds of the processor and of the wall.
seconds() { { time "$@" >"$out/stdout" 2>"$out/stderr"; } 2>&1 | awk '{print $1 + $2, $3}'; }

# The median of the ratios of a file with four columns: processor and wall of one, of the other.
ratios() { # WHAT FILE
    awk '{print $3 / $1, $4 / $2}' "$2" >"$2.ratios"
    printf '%-48s processor %.3f, wall %.3f (n = %d)\n' "$1" \
        "$(cut -d' ' -f1 "$2.ratios" | sort -g | awk '{v[NR] = $1} END {print v[int((NR + 1) / 2)]}')" \
        "$(cut -d' ' -f2 "$2.ratios" | sort -g | awk '{v[NR] = $1} END {print v[int((NR + 1) / 2)]}')" "$rounds"
}

echo "$(date -u +%Y-%m-%d), $(nproc) cores, load $(cut -d' ' -f1 /proc/loadavg)"
half_hour=(run --size 100 --seed 1 --set stop_when_explored=false --agents 10 --duration 1800 --transport memory)
for controller in dsvp rbw dsvp-team; do
    "$maes" "${half_hour[@]}" --controller "$controller" --record "$out/$controller.mcap" >"$out/stdout" 2>"$out/stderr"
    echo "$controller: $(stat -c %s "$out/$controller.mcap") bytes"
done
declare -A of
for ((round = 0; round < rounds; round++)); do
    kinds=(bare recorded verify)
    # Whatever comes first in a round is the second or third of the others.
    for ((turn = 0; turn < 3; turn++)); do
        kind=${kinds[(turn + round) % 3]}
        case $kind in
        bare) of[bare]=$(seconds "$maes" "${half_hour[@]}" --controller dsvp-team) ;;
        recorded) of[recorded]=$(seconds "$maes" "${half_hour[@]}" --controller dsvp-team --record "$out/again.mcap") ;;
        verify) of[verify]=$(seconds "$maes" verify "$out/dsvp-team.mcap") ;;
        esac
    done
    echo "${of[bare]} ${of[recorded]}" >>"$out/recorded"
    echo "${of[bare]} ${of[verify]}" >>"$out/verify"
done
ratios "recorded run by one that is not" "$out/recorded"
ratios "maes verify by the run" "$out/verify"

"$maes" run --size 100 --seed 1 --set stop_when_explored=false --controller rbw --agents 6 --duration 720 \
    --transport memory --record-topics points --record "$out/points.mcap" >"$out/stdout" 2>"$out/stderr"
cp "$out/points.mcap" "$out/other.mcap"
bytes=$(stat -c %s "$out/points.mcap")
diffs() { # WHAT
    echo "maes diff of two recordings of $bytes bytes, $1: processor and wall, s"
    for ((round = 0; round < rounds; round++)); do
        seconds "$maes" diff "$out/points.mcap" "$out/other.mcap"
        grep -q '^the same run: ' "$out/stdout"
    done
}
diffs "the same bytes"
rm "$out/other.mcap"
"$maes" recover "$out/points.mcap" -o "$out/other.mcap" >"$out/stdout" 2>"$out/stderr"
diffs "one written again by maes recover"
