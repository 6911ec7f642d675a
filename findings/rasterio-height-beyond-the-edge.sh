#!/usr/bin/env bash
# rasterio 1.4.4: beyond the edge of a terrain its height is 0, and on two of its four edges, too.
#
# Expected: `sample` at a place that is not in the file is an error, NaN or masked; the border of a
# terrain of 3 m x 3 m belongs to it.
# Seen: a file without a value for "no data" (most height models of a flat area, all that NumPy
# arrays are written to without `nodata`) gives 0.0 for each place outside: 200 m below the terrain,
# without a warning. The western and northern edge are inside, the eastern and southern are not, so
# a square of corners has heights 200, 0, 0 and 0. `sample(masked=True)` masks them; a window over
# the edge is cut to what there is (3 x 1 for 3 x 3), with `boundless=True` filled with 0.
# So: `masked=True` always, or compare with `bounds` first; write `nodata`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rasterio==1.4.4
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import numpy as np
import rasterio
from rasterio.transform import from_origin
from rasterio.windows import Window

path = sys.argv[1] + "/terrain.tif"
with rasterio.open(path, "w", driver="GTiff", height=3, width=3, count=1, dtype="float32",
                   transform=from_origin(0, 3, 1, 1), crs="EPSG:32632") as file:
    file.write(np.full((3, 3), 200, "float32"), 1)
places = {"inside": (1.5, 1.5), "100 m away": (100, 100), "north-west corner": (0, 3), "north-east": (3, 3),
          "south-west": (0, 0), "south-east": (3, 0)}
with rasterio.open(path) as file:
    heights = [float(value[0]) for value in file.sample(places.values())]
    masked = [bool(np.ma.getmaskarray(value)[0]) for value in file.sample(places.values(), masked=True)]
    cut = file.read(1, window=Window(2, 0, 3, 3))
    filled = file.read(1, window=Window(2, 0, 3, 3), boundless=True)
for name, height, hidden in zip(places, heights, masked):
    print(f"{name}: {height} m{', masked' if hidden else ''}")
print("window of 3 x 3 over the edge:", cut.shape, "or boundless", filled[0].tolist())
if heights != [200, 0, 200, 0, 0, 0] or masked != [False, True, False, True, True, True]:
    sys.exit("changed: heights are %s, masked %s" % (heights, masked))
if cut.shape != (3, 1) or filled[0].tolist() != [200, 0, 0]:
    sys.exit("changed: windows are %s and %s" % (cut.shape, filled[0].tolist()))
PY
