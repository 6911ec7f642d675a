#!/usr/bin/env bash
# SciPy 1.17.1: one unknown cell (NaN) of a height map makes all heights NaN when it is resampled,
# and is filled by a filter of maxima.
#
# Expected: a NaN spoils the samples beside it, as far as the interpolation reaches (two cells each
# way for cubic splines).
# Seen: `zoom`, `shift`, `rotate` and `map_coordinates` filter the whole array into spline
# coefficients first (`order=3` is the default), and that filter has no end: of 50 x 50 cells with
# one NaN, `zoom` by 2 gives 10000 of 10000 NaN, a rotation every sample that lies on the map. With
# `order=1` 16 are NaN. `uniform_filter` (a running sum) loses all cells behind it in both
# directions, where 9 use it, while `maximum_filter` gives a map without NaN.
# So: `order=1` for maps with unknown cells, or fill them and resample a mask beside the heights.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check scipy==1.17.1
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from scipy import ndimage

heights = np.zeros((50, 50)) + np.arange(50)
heights[25, 25] = np.nan
found = {
    "zoom": ndimage.zoom(heights, 2),
    "zoom, order=1": ndimage.zoom(heights, 2, order=1),
    "shift by half a cell": ndimage.shift(heights, 0.5),
    "rotate by 10 degrees": ndimage.rotate(heights, 10, reshape=False),
    "map_coordinates at (2, 2)": ndimage.map_coordinates(heights, [[2], [2]]),
    "uniform_filter of 3": ndimage.uniform_filter(heights, 3),
    "maximum_filter of 3": ndimage.maximum_filter(heights, 3),
}
counts = {name: int(np.isnan(values).sum()) for name, values in found.items()}
for name, count in counts.items():
    print(f"{name}: {count} of {found[name].size} are NaN")
if list(counts.values()) != [10000, 16, 2401, 2268, 1, 676, 0]:
    sys.exit("changed: NaN are %s" % counts)
PY
