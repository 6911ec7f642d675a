#!/usr/bin/env bash
# Repeats the tests that attack running processes: the view, the network, commands, files, limits.
#
#   launch_scripts/attacks.sh [ROUNDS]      default: 10
#
# Each test asserts that its attack has no effect: digest and files of the run, and less than 300 MB
# of memory. Builds as `cargo test` does. Exit code 1 if a round fails; its output is shown.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
rounds=${1:-10}
[[ $rounds =~ ^[1-9][0-9]*$ ]] || { echo "error: $rounds: expected a number of rounds, from 1" >&2; exit 2; }
attacks=(view_attacks network_attacks forged_commands file_attacks process_limits hostile_agents)

cd "$root"
cargo test --release --locked -p tests --test end_to_end --no-run
log=$(mktemp)
trap 'rm -f "$log"' EXIT
for ((round = 1; round <= rounds; round++)); do
    if ! RUST_TEST_THREADS=${RUST_TEST_THREADS:-4} \
        cargo test --release --locked -p tests --test end_to_end -- "${attacks[@]}" >"$log" 2>&1; then
        cat "$log" >&2
        echo "error: round $round of $rounds has failed" >&2
        exit 1
    fi
    printf 'round %d of %d: %s\n' "$round" "$rounds" "$(sed -n 's/^test result: //p' "$log")"
done
