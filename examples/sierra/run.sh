#!/usr/bin/env bash
# Compares the controllers rbw and lvd with SIERRA: its stages 1 to 4 for each, then stage 5.
#
#   examples/sierra/run.sh OUT [--flag VALUE ...]
#
# Flags are those of sierra, and replace the values below. Needs sierra and GNU parallel in
# PATH, and maes in PATH or in MAES_BIN_DIR.

set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
out=$(realpath -m "${1:?the folder that SIERRA writes to}")
shift

export SIERRA_PLUGIN_PATH=$here${SIERRA_PLUGIN_PATH:+:$SIERRA_PLUGIN_PATH}

execute() {
    sierra --project maes_sierra.exploration --engine maes_sierra.simulator --execenv hpc.local \
        --expdef expdef.yaml --skip-pkg-checks --sierra-root "$out" --exec-strict \
        --expdef-template "$here/template.yaml" --scenario spheres.50 \
        --batch-criteria population_size.Linear4.C2 --n-runs 4 "$@"
}

for controller in rbw lvd; do
    execute "$@" --controller "explore.$controller" --pipeline 1 2 3 4
done
execute "$@" --pipeline 5 --compare maes_sierra.comparison --things explore.rbw,explore.lvd
