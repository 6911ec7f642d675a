#!/usr/bin/env bash
# Memory of a long run at real time, with recording, page and observers:
#
#   launch_scripts/soak.sh [MINUTES]      default: 120
#
# Five agents walk at random over ROS 2; the run is recorded, and a client of the page's protocol
# and one of ROS 2 read it all the time. Each minute the resident memory of every process is noted.
# After ten minutes (half of a shorter run) none may grow by more than 20 MB: exit code 1. Prints a
# table: process, MB then, greatest MB since. With MAES_BIN_DIR set, its binaries run. Needs Node.js
# and the packages of the page (npm --prefix viewer ci), and for the ROS 2 client those of
# ros_env.sh.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
bin=$("$here/build.sh")
minutes=${1:-120}
settled=$((minutes < 20 ? minutes / 2 : 10))
GROWTH_MAX_KB=20000
eval "$("$here/ros_env.sh")"
export ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-78}

folder=$(mktemp -d)
started=()
stop() {
    ((${#started[@]} == 0)) || kill "${started[@]}" 2>/dev/null || true
    rm -rf "$folder"
}
trap stop EXIT

"$bin/maes" run --agents 5 --duration "$((minutes * 60))" --set stop_when_explored=false --rtf 1 \
    --record "$folder/soak.mcap" --logs "$folder/logs" --view 127.0.0.1:0 --stay=false \
    >"$folder/printed" 2>"$folder/stderr" &
run=$!
started+=("$run")
# Reads until the address is printed, or the run has ended without one.
address=$(tail --pid="$run" -n +1 -f "$folder/stderr" | grep -om1 'ws://[^)]*') || true
[[ -n $address ]] || { cat "$folder/stderr"; exit 1; }
node --no-warnings --experimental-websocket "$here/../viewer/bench/receive-all.mjs" "$address" >"$folder/page" 2>&1 &
started+=($!)
ros2 topic hz /agent_0/odom >"$folder/ros2" 2>&1 &
started+=($!)

declare -A first greatest name
for ((minute = 0; ; minute++)); do
    for process in "$run" $(pgrep -P "$run" || true); do
        kb=$(awk '/^VmRSS/ { print $2 }' "/proc/$process/status" 2>/dev/null) || continue
        [[ -n $kb ]] || continue
        name[$process]=$(tr '\0' ' ' <"/proc/$process/cmdline" 2>/dev/null | cut -c1-60)
        ((minute >= settled)) || continue
        : "${first[$process]:=$kb}"
        ((kb <= ${greatest[$process]:-0})) || greatest[$process]=$kb
    done
    # Waits a minute, or less if the run ends.
    timeout 60 tail --pid="$run" -f /dev/null || true
    kill -0 "$run" 2>/dev/null || break
    ((minute % 10)) || echo "minute $minute" >&2
done
wait "$run"
tail -n 2 "$folder/printed"
echo "$(stat -c %s "$folder/soak.mcap") bytes recorded; page: $(cat "$folder/page"); ROS 2: rates of $(grep -c '^average' "$folder/ros2") seconds"
failed=0
for process in "${!first[@]}"; do
    growth=$((${greatest[$process]} - ${first[$process]}))
    printf '%8.1f MB %8.1f MB  %s\n' "$((${first[$process]}))e-3" "$((${greatest[$process]}))e-3" "${name[$process]}"
    ((growth <= GROWTH_MAX_KB)) || failed=1
done
exit "$failed"
