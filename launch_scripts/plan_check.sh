#!/usr/bin/env bash
# Runs a plan, and fails if a variant has become worse than in a stored result:
#
#   launch_scripts/plan_check.sh PLAN.toml BASE.csv OUT [flag of `maes compare`...]
#
# The steps of the GitHub Action in action.yml. OUT gets the runs and the report. A stored result is
# the OUT/runs.csv of an earlier call: without BASE.csv that file is made, to be committed. MAES is
# the command (default: `maes` of the path, or else a build of this checkout). Exit code 1 if a
# variant has become worse or a run fails, 2 if there is no stored result or the input is bad.
set -euo pipefail
(($# >= 3)) || {
    echo "usage: plan_check.sh PLAN.toml BASE.csv OUT [flag of maes compare...]" >&2
    exit 2
}
plan=$1 base=$2 out=$3
shift 3
maes=${MAES:-$(command -v maes)} || maes=$("$(dirname "${BASH_SOURCE[0]}")/build.sh")/maes
summary=${GITHUB_STEP_SUMMARY:-/dev/null}

"$maes" batch "$plan" --out "$out" --report
if [[ ! -f $base ]]; then
    cp "$out/runs.csv" "$base"
    echo "error: $base: there was no stored result; this one is written now: commit it" >&2
    exit 2
fi
code=0
said=$("$maes" compare "$base" "$out" "$@") || code=$?
echo "$said"
printf '%s\n' "### $plan against $base" '```text' "$said" '```' >>"$summary"
exit "$code"
