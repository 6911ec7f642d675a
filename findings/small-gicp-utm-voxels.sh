#!/usr/bin/env bash
# small-gicp 1.0.1: downsampled in UTM coordinates, a whole cloud is one point.
#
# Expected: `voxelgrid_sampling` keeps one point per occupied cell wherever the cloud lies; a cloud
# that it cannot grid is an error.
# Seen: cell numbers have 21 bits, so with cells of 0.25 m all points beyond 262 km, as any northing
# is, are left out or put together: of 1000 points in 50 m, 1000 remain at the origin and 1 at
# (462000, 5249000). The library writes a line per point to stderr and returns the cloud of one
# point, without an exception or a flag.
# So: subtract a local origin before any downsampling or registration.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check small-gicp==1.0.1 numpy==2.4.6
"$dir/venv/bin/python" - 2>"$dir/log" <<'PY' || { tail -n 1 "$dir/log"; exit 1; }
import sys
import numpy as np
import small_gicp

cloud = np.random.default_rng(0).random((1000, 3)) * 50
found = {
    name: small_gicp.voxelgrid_sampling(cloud + origin, 0.25).size()
    for name, origin in {"local": [0, 0, 0], "30 km": [30_000, 0, 0], "UTM": [462_000, 5_249_000, 400]}.items()
}
print("points kept of 1000 in cells of 0.25 m:", found)
if found != {"local": 1000, "30 km": 1000, "UTM": 1}:
    sys.exit("changed: points are %s" % found)
PY
