#!/usr/bin/env bash
# filterpy 2.0.0: a kinematic_kf of two or three dimensions measures the sum of the positions.
#
# Expected: its documentation says "H is assigned assuming the measurement is position, one per dimension":
# two rows for two dimensions. A filter of a body at rest at (3, 5) settles there.
# Seen: H is one row, with a 1 at each position, in either order of the state; with dim_z=2 that row is
# there twice. Given (3, 5) the filter raises; given the sum, 8, it settles at x = y = 4.
# So: set dim_z to the number of dimensions and H by hand, or take a filter for each dimension.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check filterpy==2.0.0 numpy==2.4.6
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import numpy as np
from filterpy.common import kinematic_kf

by_dimension = kinematic_kf(dim=2, order=1)
interleaved = kinematic_kf(dim=2, order=1, order_by_dim=False)
twice = kinematic_kf(dim=2, order=1, dim_z=2)
print("H of x, x', y, y':", by_dimension.H.tolist())
print("H of x, y, x', y':", interleaved.H.tolist())
print("H with dim_z=2:", twice.H.tolist())
try:
    kinematic_kf(dim=2, order=1).update(np.array([[3.0], [5.0]]))
    takes_two = True
except ValueError as error:
    print("of (3, 5):", error)
    takes_two = False
by_dimension.P *= 100.0
by_dimension.Q *= 0.0
for _ in range(500):
    by_dimension.predict()
    by_dimension.update(8.0)
settled = np.round(by_dimension.x.ravel(), 2).tolist()
print("state after 500 measurements of 8:", settled)
if takes_two or by_dimension.H.tolist() != [[1, 0, 1, 0]] or interleaved.H.tolist() != [[1, 1, 0, 0]]:
    sys.exit(f"changed: H is {by_dimension.H.tolist()} and {interleaved.H.tolist()}")
if twice.H.tolist() != 2 * [[1, 0, 1, 0]] or not np.allclose(settled, [4, 0, 4, 0], atol=0.05):
    sys.exit(f"changed: H is {twice.H.tolist()}, the state {settled}")
PY
