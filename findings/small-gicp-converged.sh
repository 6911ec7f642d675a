#!/usr/bin/env bash
# small-gicp 1.0.1: two clouds without one correspondence are registered: converged, error 0.
#
# Expected: a scan 100 m away from the map, with a search radius of 1 m, does not converge, or has
# an error that is worse than that of a good match.
# Seen: `converged` is True, `error` is 0.0 (a good match has a larger one) and the transform is the
# initial guess; only `num_inliers`, 0, tells. A loop closure that takes the candidate of the
# smallest error takes this one.
# So: divide by `num_inliers` and ask for a share of the source's points before looking at
# `converged` or `error`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check small-gicp==1.0.1 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import small_gicp

rng = np.random.default_rng(0)
source = rng.random((1000, 3)) * 10
found = {}
for name, offset in {"0.3 m": [0.3, 0, 0], "100 m": [100, 0, 0]}.items():
    target = source + offset + rng.normal(0, 0.005, source.shape)
    result = small_gicp.align(target, source, downsampling_resolution=0.1, max_correspondence_distance=1.0)
    found[name] = result.converged, result.num_inliers, result.error, result.T_target_source[0, 3]
    print(name, "away: converged %s, inliers %d, error %.3g, moved by %.2f m" % found[name])
near, far = found["0.3 m"], found["100 m"]
if not near[0] or near[1] < 500 or abs(near[3] - 0.3) > 0.02:
    sys.exit("changed: the near cloud gives %s" % (near,))
if far != (True, 0, 0.0, 0.0) or not near[2] > 0:
    sys.exit("changed: the far cloud gives %s" % (far,))
PY
