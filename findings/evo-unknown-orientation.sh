#!/usr/bin/env bash
# evo 1.38.1: poses without an orientation, quaternion 0 0 0 0, have a rotation error of 0 degrees.
#
# Expected: a quaternion of norm 0 is no rotation; `check()` of the trajectory calls it invalid, so
# evo_ape stops, or leaves these poses out.
# Seen: `evo_ape tum` does not call the check: zero quaternions become the identity and too long
# ones are normalised. An estimate that knows no orientation has a perfect rotation error as long
# as the truth does not turn.
# So: run `evo_traj --full_check` first; a planner without orientations writes the heading of its
# path, not zeros; a comparison looks at the norms of both files.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check evo==1.38.1
for i in 0 1 2 3; do
    echo "$i $i 0 0 0 0 0 1" >> "$dir/true.tum"
    echo "$i $i 0 0 0 0 0 0" >> "$dir/none.tum"
done
export HOME=$dir
"$dir/venv/bin/evo_ape" tum "$dir/true.tum" "$dir/none.tum" -r angle_deg | tee "$dir/out" | grep -E 'max|rmse'
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
from evo.tools import file_interface

valid, details = file_interface.read_tum_trajectory_file(sys.argv[1] + "/none.tum").check()
rmse = [line.split()[-1] for line in open(sys.argv[1] + "/out") if "rmse" in line]
print("check():", valid, details["quaternions"])
if valid or [float(value) for value in rmse] != [0.0]:
    sys.exit("changed: check is %s, the error %s" % (valid, rmse))
PY
