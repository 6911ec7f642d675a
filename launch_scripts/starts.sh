#!/usr/bin/env bash
# Counts starts of ten agent processes and a server that do not begin.
#
#   launch_scripts/starts.sh [STARTS] [PROCESSES_OF_LOAD]      default: 20 starts beside 2
#
# A start has begun if its run of one second of sim time ends with the digest of the first one; it
# has 60 s for it. With MAES_BIN_DIR set, the binaries of that folder run and nothing is built.
# Exit code 1 if one has not begun; its logs are in out/starts.
set -eu
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
bin=$("$here/build.sh")
starts=${1:-20} load=${2:-2}

busy=()
stop() { ((${#busy[@]} == 0)) || kill "${busy[@]}" 2>/dev/null || true; }
trap stop EXIT
for ((i = 0; i < load; i++)); do
    (while :; do :; done) &
    busy+=($!)
done

expected='' lost=0
for ((i = 1; i <= starts; i++)); do
    logs=out/starts/$i
    mkdir -p "$logs"
    if last=$("$bin/maes" run --agents 10 --size 30 --duration 1 --join-timeout 60 --logs "$logs" 2>"$logs/stderr" | tail -n 1) &&
        [[ $last == digest:* && $last == "${expected:=$last}" ]]; then
        rm -rf "$logs"
    else
        lost=$((lost + 1))
        echo "start $i has not begun: $(tail -n 1 "$logs/stderr") ($logs)"
    fi
done
echo "$starts starts of 10 agent processes beside $load processes of load in $SECONDS s: $lost did not begin"
((lost == 0))
