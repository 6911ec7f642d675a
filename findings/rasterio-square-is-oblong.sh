#!/usr/bin/env bash
# rasterio 1.4.4 (GDAL): a square of 2 m, burnt into a grid of 1 m, is 2 cells wide and 3 high.
#
# Expected: `features.rasterize` takes the cells whose centre is inside of the shape; where centres
# lie on its edge, one rule holds for both axes, so that a square stays one.
# Seen: of a square from 0.5 to 2.5 m the edges run through the centres of cells. In x the centre on
# the left edge is out and that on the right one in: 2 columns; in y both are in: 3 rows. Two
# such squares side by side share no column, one above the other they share a row, which is counted
# twice. With all_touched it is 3 by 3.
# So: walls and rooms that are drawn on the half metres of a grid grow in one direction; shift the
# grid by half a cell, or the shapes by a thousandth.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rasterio==1.4.4 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from rasterio.features import rasterize
from rasterio.transform import from_origin

def burn(left, bottom, size=2, **how):
    corners = [(left, bottom), (left + size, bottom), (left + size, bottom + size), (left, bottom + size), (left, bottom)]
    return rasterize([{"type": "Polygon", "coordinates": [corners]}], out_shape=(6, 6), transform=from_origin(0, 6, 1, 1), **how)

def extent(cells):
    return int(cells.any(axis=0).sum()), int(cells.any(axis=1).sum())

found = {"0.5 to 2.5": extent(burn(0.5, 0.5)), "1 to 3": extent(burn(1, 1)), "0.501 to 2.501": extent(burn(0.501, 0.501)),
         "all touched": extent(burn(0.5, 0.5, all_touched=True))}
shared = int((burn(0.5, 0.5) & burn(2.5, 0.5)).sum()), int((burn(0.5, 0.5) & burn(0.5, 2.5)).sum())
for name, (columns, rows) in found.items():
    print(f"a square of 2 m, {name}: {columns} columns, {rows} rows")
print("cells that two squares share, side by side and one above the other:", shared)
if found != {"0.5 to 2.5": (2, 3), "1 to 3": (2, 2), "0.501 to 2.501": (2, 2), "all touched": (3, 3)} or shared != (0, 2):
    sys.exit("changed: %s, shared %s" % (found, shared))
PY
