#!/usr/bin/env bash
# Compares the speed of this checkout with that of a commit: builds both, each in a target folder of
# its own, has them run in turns, and prints ratios.
#
#   launch_scripts/bench_against.sh COMMIT [--scenes] [--rounds N] [--profile NAME] [--only WORDS] [--instructions]
#
#   --scenes          runs of bodies of several cells, in cells of 10 to 25 cm, to the end of their
#                     exploration (the scenarios office, octagon-maze, tunnels and fine-cave)
#   --rounds N        pairs of runs of each kind, after one pair that is not counted (default 5)
#   --profile NAME    the profile of both builds: release (default) or dist
#   --only WORDS      only the kinds whose name has these words
#   --instructions    counts instructions instead, in one short run of each kind in memory on one
#                     thread: the same to about a thousandth whatever else the machine does, so that
#                     changes of 1 % can be seen. Needs valgrind.
#
# Each line: what, the wall seconds of the commit and of this checkout (medians), how many times as
# fast this checkout is, and how many times as much processor time the commit takes: geometric means
# over the pairs with their 95 % intervals (Student's t on the logarithms); and the peak memory of the
# largest process of the commit and of this checkout, MiB (medians). Both runs of a pair must have the
# same digest; exit code 1 if not. With other work on the machine the intervals of wall
# times are wide; those of processor times stay narrow. With --instructions: what, the instructions
# of the commit and of this checkout in millions, the start included, and their ratio.
#
# With BENCH_BIN_DIR and BENCH_OTHER_BIN_DIR, those folders have the binaries and nothing is built.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
fail() {
    printf 'error: %s\n' "$1" >&2
    exit "${2:-2}"
}

usage='launch_scripts/bench_against.sh COMMIT [--scenes] [--rounds N] [--profile release|dist] [--only WORDS] [--instructions]'
[[ $# -gt 0 && $1 != -* ]] || fail "expected a commit: $usage"
commit=$(git -C "$root" rev-parse --short=12 --verify --quiet "$1^{commit}") || fail "$1: expected a commit of this repository"
shift
rounds='' profile=release only='' counts='' scenes=''
while (($#)); do
    [[ $1 == --instructions ]] && { counts=yes && shift && continue; }
    [[ $1 == --scenes ]] && { scenes=yes && shift && continue; }
    [[ $# -gt 1 ]] || fail "$1: a value is missing: $usage"
    case $1 in
    --rounds) rounds=$2 ;;
    --profile) profile=$2 ;;
    --only) only=$2 ;;
    *) fail "$1: $usage" ;;
    esac
    shift 2
done
[[ -z $counts || -z $rounds ]] || fail "--rounds has no meaning with --instructions, which counts once"
rounds=${rounds:-5}
[[ $rounds =~ ^[1-9][0-9]{0,2}$ ]] || fail "--rounds $rounds: expected a number from 1 to 999"
[[ $profile == release || $profile == dist ]] || fail "--profile $profile: expected release or dist"
[[ -z $counts ]] || command -v valgrind >/dev/null || fail "--instructions needs valgrind"

# The binaries of a checkout.
build() { # CHECKOUT TARGET
    "$1/launch_scripts/patched_rustdds.sh" >/dev/null
    (cd "$1" && CARGO_TARGET_DIR=$2 cargo build --locked --profile "$profile" >&2)
    echo "$2/$profile"
}
out=$root/out/bench
mkdir -p "$out"
this=${BENCH_BIN_DIR:-$(build "$root" "$out/target")}
if [[ -n ${BENCH_OTHER_BIN_DIR:-} ]]; then
    other=$BENCH_OTHER_BIN_DIR
else
    checkout=$out/$commit
    [[ -e $checkout/Cargo.toml ]] || git -C "$root" worktree add --quiet --detach "$checkout" "$commit"
    other=$(build "$checkout" "$checkout/target")
fi

work=$(mktemp -d "${TMPDIR:-/tmp}/maes-bench-XXXXXX")
trap 'rm -rf "$work"' EXIT
export ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-77}

# Runs a command and writes the processor seconds of its processes, and the peak memory of the largest
# of them in MiB, to a file.
used='
import resource, subprocess, sys
code = subprocess.run(sys.argv[2:]).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
with open(sys.argv[1], "w") as file:
    print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, file=file)
sys.exit(code)
'

# One run; prints its digest, its wall seconds, its processor seconds and its peak memory.
run() { # FOLDER FLAG...
    local bin=$1
    shift
    MAES_BIN_DIR=$bin python3 -c "$used" "$work/times" "$bin/maes" run "$@" --logs "$work/logs" \
        >"$work/stdout" 2>"$work/stderr" || { cat "$work/stderr" >&2; fail "$bin/maes run $* has failed" 1; }
    awk 'FILENAME ~ /times$/ {used = $0} /^wall time/ {wall = $3} /^digest:/ {print $2, wall, used}' \
        "$work/times" "$work/stdout"
}

compare() { # WHAT FLAG...
    local what=$1 round first second
    shift
    [[ $what == *"$only"* ]] || return 0
    : >"$work/pairs"
    for ((round = 0; round <= rounds; round++)); do
        # Each is first in every other round.
        if ((round % 2)); then
            first=$(run "$other" "$@") second=$(run "$this" "$@")
        else
            second=$(run "$this" "$@") first=$(run "$other" "$@")
        fi
        [[ ${first%% *} == "${second%% *}" ]] || fail "$what: the digests differ: ${first%% *} and ${second%% *}" 1
        ((round == 0)) || echo "${first#* } ${second#* }" >>"$work/pairs"
    done
    awk -v what="$what" '
        # Two-sided 95 % quantiles of the t distribution, by degrees of freedom.
        BEGIN { split("12.706 4.303 3.182 2.776 2.571 2.447 2.365 2.306 2.262 2.228 2.201 2.179 2.160 2.145 2.131 2.120 2.110 2.101 2.093 2.086", t, " ") }
        { old[NR] = $1; new[NR] = $4; wall[NR] = log($1 / $4); cpu[NR] = log($2 / $5); peak[NR] = $3; peak_new[NR] = $6 }
        function median(list,   i, j, swap) {
            for (i = 2; i <= NR; i++)
                for (j = i; j > 1 && list[j] < list[j - 1]; j--) { swap = list[j]; list[j] = list[j - 1]; list[j - 1] = swap }
            return (list[int((NR + 1) / 2)] + list[int(NR / 2) + 1]) / 2
        }
        function ratio(logs,   i, mean, variance, half) {
            mean = 0
            for (i = 1; i <= NR; i++) mean += logs[i] / NR
            if (NR < 2) return sprintf("%6.2f (one pair)    ", exp(mean))
            variance = 0
            for (i = 1; i <= NR; i++) variance += (logs[i] - mean) ^ 2 / (NR - 1)
            half = (NR - 1 > 20 ? 1.96 : t[NR - 1]) * sqrt(variance / NR)
            return sprintf("%6.2f (%.2f to %.2f)", exp(mean), exp(mean - half), exp(mean + half))
        }
        END { printf "%-46s %8.2f %8.2f  %-22s %-22s %6.0f %6.0f\n", what, median(old), median(new), ratio(wall), ratio(cpu), median(peak), median(peak_new) }' \
        "$work/pairs"
}

# The digest of a run, and the instructions that it takes.
instructions() { # FOLDER FLAG...
    local bin=$1
    shift
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$bin/maes" run "$@" >"$work/stdout" 2>"$work/stderr" ||
        { cat "$work/stderr" >&2; fail "$bin/maes run $* has failed" 1; }
    awk '/^digest:/ {digest = $2} /Collected/ {print digest, $NF}' "$work/stdout" "$work/stderr"
}

count() { # WHAT FLAG...
    local what=$1 "then" now
    shift
    [[ $what == *"$only"* ]] || return 0
    set -- "$@" --transport memory --together --threads 1 --size 100 --seed 1 --set stop_when_explored=false
    then=$(instructions "$other" "$@") || exit 1
    now=$(instructions "$this" "$@") || exit 1
    [[ -n ${then%% *} && ${then%% *} == "${now%% *}" ]] || fail "$what: the digests differ: ${then%% *} and ${now%% *}" 1
    awk -v what="$what" -v then="${then#* }" -v now="${now#* }" \
        'BEGIN { printf "%-34s %10.1f %10.1f  %6.3f\n", what, then / 1e6, now / 1e6, then / now }'
}

load=$(cut -d' ' -f1 /proc/loadavg)
if [[ -n $counts ]]; then
    echo "$(date -u +%Y-%m-%d), $(valgrind --version), profile $profile, against $commit"
    printf '%-34s %10s %10s  %6s\n' "millions of instructions" "then" now ratio
    count "rbw, 10 agents, 60 s" --agents 10 --controller rbw --duration 60
    count "lvd, 10 agents, 20 s" --agents 10 --controller lvd --duration 20
    count "dsvp, 10 agents, 60 s" --agents 10 --controller dsvp --duration 60
    count "dsvp-team, 10 agents, 20 s" --agents 10 --controller dsvp-team --duration 20
    count "rbw, 100 agents, 10 s" --agents 100 --controller rbw --duration 10
    count "dsvp, 100 agents, 10 s" --agents 100 --controller dsvp --duration 10
    exit
fi
echo "$(date -u +%Y-%m-%d), $(nproc) cores, load $load, profile $profile, $rounds pairs, against $commit"
printf '%-46s %8s %8s  %-22s %-22s %s\n' "" "then, s" "now, s" "times as fast" "processor time" "peak, MiB"
if [[ -n $scenes ]]; then
    one_thread=(--transport memory --threads 1 --together)
    scenario() { # NAME
        echo "$root/launch_scripts/scenarios/$1.toml"
    }
    compare "memory, one thread: office" "$(scenario office)" "${one_thread[@]}"
    compare "memory, one thread: office, dsvp-auction" "$(scenario office)" "${one_thread[@]}" --controller dsvp-auction
    compare "memory, one thread: octagon-maze" "$(scenario octagon-maze)" "${one_thread[@]}"
    compare "memory, one thread: tunnels" "$(scenario tunnels)" "${one_thread[@]}"
    compare "memory, one thread: fine-cave" "$(scenario fine-cave)" "${one_thread[@]}"
    active=(--size 100 --seed 1 --controller dsvp-team)
    compare "memory, one thread: 10 in 100^3 of 1 m" "${active[@]}" --agents 10 "${one_thread[@]}"
    compare "ROS 2: 10 in 100^3 of 1 m" "${active[@]}" --agents 10
    compare "Unix sockets: 10 in 100^3 of 1 m" "${active[@]}" --agents 10 --unix-sockets
    compare "ROS 2: 20 in 100^3 of 1 m" "${active[@]}" --agents 20
    compare "ROS 2, recorded: office" "$(scenario office)" --record "$work/run.mcap"
    compare "ROS 2, recorded: octagon-maze" "$(scenario octagon-maze)" --record "$work/run.mcap"
    compare "ROS 2, recorded: tunnels" "$(scenario tunnels)" --record "$work/run.mcap"
    exit
fi
cave=(--size 100 --seed 1 --set stop_when_explored=false --record "$work/run.mcap")
five_minutes=("${cave[@]}" --duration 300)
compare "memory, one thread: dsvp, 10 agents, 300 s" "${five_minutes[@]}" --transport memory --agents 10 --controller dsvp --threads 1 --together
compare "memory, all cores: dsvp, 10 agents, 300 s" "${five_minutes[@]}" --transport memory --agents 10 --controller dsvp
compare "memory, all cores: dsvp, 100 agents, 60 s" "${cave[@]}" --duration 60 --transport memory --agents 100 --controller dsvp
compare "memory, all cores: rbw, 100 agents, 60 s" "${cave[@]}" --duration 60 --transport memory --agents 100 --controller rbw
compare "ROS 2: dsvp, 10 agents, 1800 s" "${cave[@]}" --duration 1800 --agents 10 --controller dsvp
compare "ROS 2: rbw, 100 agents in 10 processes, 60 s" "${cave[@]}" --duration 60 --agents 100 --agents-per-process 10 --controller rbw
