#!/usr/bin/env bash
# Disturbs runs in full size: one for each of 300 seeds of faults, over ROS 2 with a process for each agent.
#
#   launch_scripts/faults.sh [any flag of `experiments faults`]      for example --seeds 60 --jobs 2 --out DIR
#
# Exit codes: 0 every run was the undisturbed one; 1 one was not, or a failure of the system; 2 bad input; 130 interrupted.
set -eu
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${MAES_BIN_DIR:-}
if [[ -z $bin ]]; then
    (cd "$root" && cargo build --release --quiet)
    bin=${CARGO_TARGET_DIR:-$root/target}/release
fi
seeds=(--seeds 300)
for flag in "$@"; do
    case $flag in
        --seeds | --seeds=* | --seed-only | --seed-only=*) seeds=() ;;
    esac
done
exec "$bin/experiments" faults "${seeds[@]}" "$@"
