#!/usr/bin/env bash
# Measures `maes batch`: what a plan costs beside its bare runs, and how fast one core executes the
# heaviest of the papers' runs.
#
#   launch_scripts/bench_experiments.sh [ROUNDS]      rounds of each, after a warm-up (default 5)
#
# Processor time (user and system) is compared as well as wall time, because a busy machine distorts it less.
set -eu
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
rounds=${1:-5}
bin=$("$root/launch_scripts/build.sh")
out=$(mktemp -d "${TMPDIR:-/tmp}/maes-bench-XXXXXX")
trap 'rm -rf "$out"' EXIT
scenario=$root/launch_scripts/scenarios/default.toml
TIMEFORMAT='%U %S %R'

seeds=4
cat >"$out/plan.toml" <<END
scenario = "$scenario"
seeds = "1..$seeds"
[axes]
"agents.controller" = ["lvd"]
"agents.count" = [5]
"map.size" = [50]
stop_when_explored = [false]
END

bare() {
    for ((seed = 1; seed <= seeds; seed++)); do
        "$bin/maes" run "$scenario" --transport memory --controller lvd --agents 5 --size 50 --seed "$seed" \
            --set stop_when_explored=false --together --threads 1 >/dev/null 2>&1
    done
}
plan() {
    rm -rf "$out/runs"
    "$bin/maes" batch "$out/plan.toml" --out "$out/runs" --jobs 1 >/dev/null 2>&1
}
# Least, median and greatest of a file of numbers.
spread() { sort -g "$1" | awk '{v[NR] = $1} END {printf "%.3f %.3f %.3f\n", v[1], v[int((NR + 1) / 2)], v[NR]}'; }

echo "$(date -u +%Y-%m-%d), $(nproc) cores, $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1), load $(cut -d' ' -f1 /proc/loadavg)"
bare && plan
for ((round = 0; round < rounds; round++)); do
    { time bare; } 2>"$out/a"
    { time plan; } 2>"$out/b"
    paste -d ' ' "$out/a" "$out/b" >>"$out/pairs"
done
awk '{print ($4 + $5) / ($1 + $2)}' "$out/pairs" >"$out/cpu"
awk '{print $6 / $3}' "$out/pairs" >"$out/wall"
echo "a plan of $seeds runs by the same runs one by one (lvd, 5 agents, 50^3, 90 000 ticks): least, median, greatest"
echo "  processor time: $(spread "$out/cpu")"
echo "  wall time:      $(spread "$out/wall")"

for ((round = 0; round <= rounds; round++)); do
    taskset -c 0 "$bin/maes" run "$scenario" --transport memory --controller dsvp --agents 10 --size 100 --seed 2 --together --threads 1 2>/dev/null |
        sed -n 's/^wall time .*, \([0-9.]*\) x real time$/\1/p'
done | tail -n "$rounds" >"$out/speed"
echo "dsvp, 10 agents, 100^3, seed 2, on one core, times real time: $(spread "$out/speed")"
