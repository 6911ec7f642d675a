#!/usr/bin/env bash
# Disturbs 300 runs over ROS 2, each with the faults of its seed, and a process for each agent.
#
#   launch_scripts/faults.sh [any flag of `maes faults`]      for example --seeds 60 --jobs 2 --out DIR
#
# Exit codes: 0 every run was the undisturbed one; 1 one was not, or a failure of the system; 2 bad
# input; 130 interrupted.
set -eu
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=$("$root/launch_scripts/build.sh")
seeds=(--seeds 300)
for flag in "$@"; do
    case $flag in
        --seeds | --seeds=* | --seed-only | --seed-only=*) seeds=() ;;
    esac
done
exec "$bin/maes" faults "${seeds[@]}" "$@"
