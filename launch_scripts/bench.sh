#!/usr/bin/env bash
# Measures whole runs over real ROS 2 processes and prints the figures of docs/benchmarks.md.
#
#   launch_scripts/bench.sh [RUNS]      counted runs of each kind, after a warm-up (default 3)
#   launch_scripts/bench.sh --against COMMIT [--scenes] [--rounds N] [--profile NAME] [--only WORDS] [--instructions]
#
# Each line: what, then the least, the median and the greatest value. The machine should have nothing
# else to do.
#
# With --against, the binaries of this checkout and those of a commit run in turns (bench_against.sh).
set -u
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
if [[ ${1:-} == --against ]]; then
    exec "$root/launch_scripts/bench_against.sh" "${@:2}"
fi
runs=${1:-3}
out=$(mktemp -d "${TMPDIR:-/tmp}/maes-bench-XXXXXX")
trap 'rm -rf "$out"' EXIT
export ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-77}
MAES_BIN_DIR=$("$root/launch_scripts/build.sh") || exit 1
export MAES_BIN_DIR

# The highest resident memory of the processes of this name, in MiB; polled while they run.
watch_memory() { # NAME FILE
    local pid peak
    while [[ -e $out/running ]]; do
        for pid in $(pgrep -x "$1"); do
            peak=$(awk '/^VmHWM/ {print $2}' "/proc/$pid/status" 2>/dev/null) && [[ -n $peak ]] && echo "$peak" >>"$2"
        done
        read -r -t 0.1 <>"$out/never"
    done
}

# One run; prints its wall seconds.
run() {
    "$root/launch_scripts/run.sh" "$@" --logs "$out/logs" 2>"$out/stderr" >"$out/stdout" ||
        { cat "$out/stderr" >&2; exit 1; }
    sed -n 's/^wall time \([0-9.]*\) s.*/\1/p' "$out/stdout"
}

# Several runs; prints least, median and greatest of `expression` over the wall seconds w.
measure() { # WHAT UNIT EXPRESSION FLAG...
    local what=$1 unit=$2 expression=$3 count
    shift 3
    run "$@" >"$out/warm-up"
    for ((count = 0; count < runs; count++)); do run "$@"; done |
        awk "{w = \$1; print $expression}" | sort -g >"$out/values"
    awk -v what="$what" -v unit="$unit" '{v[NR] = $1}
        END {printf "%-64s %10.1f %10.1f %10.1f  %s\n", what, v[1], v[int((NR + 1) / 2)], v[NR], unit}' "$out/values"
}

mkfifo "$out/never"
echo "$(date -u +%Y-%m-%d), $(nproc) cores, $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1), load $(cut -d' ' -f1 /proc/loadavg)"
printf '%-64s %10s %10s %10s\n' "" least median greatest

every_tick=(--agents 10 --size 50 --seed 7 --duration 60 --look-ahead false --set stop_when_explored=false)
measure "barrier: 10 processes asked at every tick, LiDAR off" "ticks/s" "3000 / w" \
    "${every_tick[@]}" --set lidar.period_ticks=1000000
measure "barrier: the same with 5 LiDAR scans a second" "ticks/s" "3000 / w" "${every_tick[@]}"

touch "$out/running"
watch_memory sim_server "$out/server" &
watch_memory agent_node "$out/agent" &
half_hour=(--size 100 --seed 1 --duration 1800 --set stop_when_explored=false --record "$out/run.mcap")
measure "rbw, 10 agents, 100^3, 90 000 ticks, recorded: wall time" "s" "w" --agents 10 "${half_hour[@]}"
measure "rbw, 20 agents, 100^3, 90 000 ticks, recorded: wall time" "s" "w" --agents 20 "${half_hour[@]}"
measure "dsvp, 10 agents, 100^3, 90 000 ticks, recorded: wall time" "s" "w" --agents 10 "${half_hour[@]}" --controller dsvp
rm "$out/running"
wait
ls -l "$out/run.mcap" | awk '{printf "recording of the last run: %.1f MB\n", $5 / 1e6}'
sort -g "$out/server" | tail -1 | awk '{printf "highest resident memory of a server: %.1f MiB\n", $1 / 1024}'
sort -g "$out/agent" | tail -1 | awk '{printf "highest resident memory of an agent: %.1f MiB\n", $1 / 1024}'
