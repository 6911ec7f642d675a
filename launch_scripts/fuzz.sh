#!/usr/bin/env bash
# Fuzzes the readers of files and messages, the server and an agent with libFuzzer, and then running
# processes with changed RTPS packets.
#
#   launch_scripts/fuzz.sh [SECONDS_PER_TARGET] [TARGET...]      default: 600 s for each target
#
# Targets: those of testing/fuzz/src/lib.rs, and rtps (tests/mutated_packets.rs), for which the seconds are
# processor time of the attacked processes. Needs stable Rust and a C++ compiler. New inputs that
# reach more code stay under target/fuzz/found/<target>, findings under target/fuzz/findings. Exit
# code 1 if there is a finding.
set -uo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
mapfile -t all < <(sed -n 's/^    ("\([a-z0-9]*\)", [a-z_]*::[a-z_]*),$/\1/p' "$root/testing/fuzz/src/lib.rs")
all+=(rtps)
seconds=${1:-600}
[[ $seconds =~ ^[1-9][0-9]*$ ]] || { echo "error: $seconds: expected seconds for each target, from 1" >&2; exit 2; }
shift
targets=("$@")
(($#)) || targets=("${all[@]}")
for target in "${targets[@]}"; do
    [[ " ${all[*]} " == *" $target "* ]] || { echo "error: $target: expected one of ${all[*]}" >&2; exit 2; }
done
work=${CARGO_TARGET_DIR:-$root/target}/fuzz
triple=$(rustc -vV | sed -n 's/^host: //p')

# Instrumentation for libFuzzer, with stable flags. With --target, build scripts and procedural
# macros have none.
pass=(-Cpasses=sancov-module)
for option in level=4 inline-8bit-counters pc-table trace-compares; do
    pass+=("-Cllvm-args=-sanitizer-coverage-$option")
done
# Branches are not folded, so that each counts.
pass+=(-Cllvm-args=-simplifycfg-branch-fold-threshold=0)
[[ "${targets[*]}" == rtps ]] || (cd "$root" && RUSTFLAGS="${pass[*]}" CARGO_TARGET_DIR=$work \
    cargo build --profile fuzz --locked -p fuzz --features fuzz/libfuzzer --target "$triple") || exit 2
program=$work/$triple/fuzz/fuzz
findings=$work/findings
mkdir -p "$findings"
failed=0

printf '%-10s %12s %10s %10s  %s\n' target executions 'covered' 'inputs' findings
rtps() {
    local log=$work/rtps.log seed=${MAES_FUZZ_RTPS_SEED:-$RANDOM}
    if (cd "$root" && MAES_FUZZ_RTPS_S=$seconds MAES_FUZZ_RTPS_SEED=$seed \
        cargo test --release --locked -p tests --test end_to_end -- --nocapture mutated_packets) >"$log" 2>&1; then
        printf '%-10s %s\n' rtps "$(grep -m 1 ' packets at each of ' "$log")"
    else
        failed=1
        printf '%-10s failed; reproduce: MAES_FUZZ_RTPS_SEED=%s; log: %s\n' rtps "$seed" "$log"
    fi
}

for target in "${targets[@]}"; do
    if [[ $target == rtps ]]; then
        rtps
        continue
    fi
    found=$work/found/$target
    log=$work/$target.log
    mkdir -p "$found"
    rm -f "$findings/$target-"*
    FUZZ_TARGET=$target "$program" "$found" "$root/testing/fuzz/corpus/$target" -max_total_time="$seconds" -max_len=65536 \
        -rss_limit_mb=1536 -malloc_limit_mb=512 -timeout=30 -artifact_prefix="$findings/$target-" -print_final_stats=1 \
        >"$log" 2>&1
    status=$?
    executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    read -r covered inputs < <(sed -n 's/.* cov: \([0-9]*\) .* corp: \([0-9]*\).*/\1 \2/p' "$log" | tail -n 1) || true
    shopt -s nullglob
    files=("$findings/$target-"*)
    shopt -u nullglob
    printf '%-10s %12s %10s %10s  %s\n' "$target" "${executions:-?}" "${covered:-?}" "${inputs:-?}" "${#files[@]}"
    if ((status || ${#files[@]})); then
        failed=1
        grep -m 3 -A 2 -e 'panicked at' -e 'ERROR: libFuzzer' "$log" >&2
        echo "log: $log" >&2
        for file in "${files[@]}"; do printf 'reproduce: FUZZ_TARGET=%s %q %q\n' "$target" "$program" "$file" >&2; done
    fi
done
exit "$failed"
