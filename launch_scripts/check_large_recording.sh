#!/usr/bin/env bash
# Makes a recording of more than 4 GiB with points, and fails unless every command takes it with at
# most 200 MB of memory:
#
#   launch_scripts/check_large_recording.sh [FOLDER]      default: a temporary folder
#
# Takes 14 GB of the folder. Prints bytes, seconds and the highest resident memory of each command.
# Needs python3. With MAES_BIN_DIR set, its binaries run.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
maes=$("$here/build.sh")/maes
out=$(mktemp -d "${1:-${TMPDIR:-/tmp}}/maes-large-XXXXXX")
trap 'rm -rf "$out"' EXIT
readonly bytes_min=$((4 << 30)) memory_max_kb=200000

fail() {
    printf 'check_large_recording: %s\n' "$1" >&2
    exit 1
}

# Runs a command, and prints its seconds and memory. Fails if it needs too much, does not end with
# the code CODE, or prints no line with WORDS.
check() { # NAME CODE WORDS COMMAND...
    python3 - "$memory_max_kb" "$@" <<'END'
import resource, subprocess, sys, time
limit_kb, name, code, words, *command = sys.argv[1:]
begin = time.monotonic()
ended = subprocess.run(command, capture_output=True, text=True)
memory_kb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(f"{name}: {time.monotonic() - begin:.1f} s, {memory_kb / 1000:.0f} MB", flush=True)
print("\n".join(line for line in ended.stdout.splitlines() if line.startswith("digest: ")), flush=True)
if ended.returncode != int(code) or words not in ended.stdout + ended.stderr:
    sys.exit(f"{name}: exit code {ended.returncode}, expected {code} and {words!r}\n{ended.stdout}{ended.stderr}")
if memory_kb > int(limit_kb):
    sys.exit(f"{name}: {memory_kb} kB of memory, allowed are {limit_kb}")
END
}

export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
run=(run --size 100 --seed 1 --set stop_when_explored=false --controller rbw --agents 6
    --transport memory --record-topics points)
check "maes run" 0 "digest: " "$maes" "${run[@]}" --duration 3000 --record "$out/large.mcap" | tee "$out/run"
digest=$(sed -n 's/^digest: //p' "$out/run")
[[ -n $digest ]] || fail "maes run prints no digest"
bytes=$(stat -c %s "$out/large.mcap")
echo "$bytes bytes"
((bytes > bytes_min)) || fail "$bytes bytes are not more than $bytes_min"

check "maes info" 0 "$digest" "$maes" info "$out/large.mcap"
check "maes verify" 0 "$digest" "$maes" verify "$out/large.mcap"
# All of a topic, and the last seconds of all.
check "maes replay, one topic" 0 "replayed " "$maes" replay "$out/large.mcap" --rate max --topics /sim/progress
check "maes replay, the end" 0 "replayed " "$maes" replay "$out/large.mcap" --rate max --start 2990

cut=$((bytes - (64 << 20)))
((cut > bytes_min)) || cut=$((bytes_min + (bytes - bytes_min) / 2))
head --bytes "$cut" "$out/large.mcap" >"$out/cut.mcap"
check "maes recover" 0 "up to tick " "$maes" recover "$out/cut.mcap" -o "$out/recovered.mcap"
check "maes diff, one cut" 1 "the same as far as " "$maes" diff "$out/large.mcap" "$out/cut.mcap"
rm "$out/recovered.mcap"
check "maes run --resume" 0 "$digest" "$maes" run --resume "$out/cut.mcap" --record-topics points
cmp "$out/large.mcap" "$out/cut.mcap" || fail "the resumed recording has other bytes"
check "maes diff" 0 "the same run" "$maes" diff "$out/large.mcap" "$out/cut.mcap"
rm "$out/cut.mcap"
check "maes run --fork" 0 "$digest" "$maes" run --transport memory --fork "$out/large.mcap" --at 2990
echo "all commands take it"
