#!/usr/bin/env bash
# Finds code that does not compile for other systems, without such a system:
#
#   launch_scripts/check_targets.sh [TARGET...]     default: all of the list below
#
# Needs the standard library of each target (`rustup target add TARGET`) or the sources of all
# (`rustup component add rust-src`). Nothing is linked, so C code of dependencies is not compiled.
# Exit code 1 if a target does not compile.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

programs=(-p maes -p sim_server -p agent_node)
without_ros=(-p maes --bin maes --no-default-features)
check() {
    local target=$1 std=()
    shift
    if [[ -z $(find "$(rustc --print target-libdir --target "$target")" -name 'libstd-*' 2>/dev/null) ]]; then
        [[ -d $(rustc --print sysroot)/lib/rustlib/src/rust/library ]] || {
            echo "error: no standard library for $target: rustup target add $target" >&2
            return 1
        }
        export RUSTC_BOOTSTRAP=1
        std=("-Zbuild-std=std,panic_unwind")
    fi
    local name=${target//-/_}
    export "CC_$name=$stand_ins/cc" "CXX_$name=$stand_ins/cc" "AR_$name=$stand_ins/ar"
    echo "$target" >&2
    cargo check --release --locked --target "$target" "${std[@]}" "$@"
}

stand_ins=$(mktemp -d)
trap 'rm -rf "$stand_ins"' EXIT
cat >"$stand_ins/cc" <<'END'
#!/bin/sh
while [ $# -gt 0 ]; do if [ "$1" = -o ]; then : >"$2"; fi; shift; done
END
cat >"$stand_ins/ar" <<'END'
#!/bin/sh
for word; do case $word in *.a) : >>"$word" ;; esac; done
END
chmod +x "$stand_ins"/*
launch_scripts/patched_rustdds.sh >/dev/null

declare -A packages=(
    [aarch64-unknown-linux-gnu]="${programs[*]}"
    [aarch64-apple-darwin]="${programs[*]}"
    [x86_64-pc-windows-gnu]="${without_ros[*]}"
)
(($#)) || set -- "${!packages[@]}"
failed=0
for target; do
    [[ -n ${packages[$target]:-} ]] || {
        echo "error: $target: expected one of ${!packages[*]}" >&2
        exit 2
    }
    read -ra words <<<"${packages[$target]}"
    (check "$target" "${words[@]}") || failed=1
done
exit "$failed"
