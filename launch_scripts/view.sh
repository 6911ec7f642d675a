#!/usr/bin/env bash
# Builds the simulator if needed, and shows a recording or a run in a browser. `maes view` does the
# same, and this script goes with the next version.
#
#   launch_scripts/view.sh                                          runs that are started on the page
#   launch_scripts/view.sh FILE.mcap                                a recording
#   launch_scripts/view.sh SCENARIO.toml [any flag of `maes run`]   a run, which begins paused
set -eu
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
bin=$("$here/build.sh")
echo 'note: `launch_scripts/view.sh` is now `maes view`' >&2
exec "$bin/maes" view "$@"
