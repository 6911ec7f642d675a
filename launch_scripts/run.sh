#!/usr/bin/env bash
# Builds the simulator if needed, and runs a scenario: a world server, a process for each agent, one
# recording, one exit code.
#
#   launch_scripts/run.sh [SCENARIO.toml] [--agents N] [--controller C] [any flag of `maes run`]
#
# All flags and exit codes: launch_scripts/run.sh --help. With MAES_BIN_DIR set, the binaries of that
# folder run and nothing is built.
set -eu
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
bin=$("$here/build.sh")
exec "$bin/maes" run "$@"
