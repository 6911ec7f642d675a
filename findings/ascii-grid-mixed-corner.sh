#!/usr/bin/env bash
# rasterio 1.4.4 (GDAL): an ASCII grid with `xllcorner` and `yllcenter` lies at the origin, and a
# hole of one cell is filled by reading it larger.
#
# Expected: Esri's format names the two lines independently ("xllcenter or xllcorner", "yllcenter or
# yllcorner"); a value of NODATA stays one.
# Seen: two corners or two centres are placed exactly; one of each drops both: the raster is at (0,
# -20) for (100, 200), without a warning, and with cells of the right size. Reading at twice the
# size with bilinear weights leaves no hole: half-cells of NODATA get values of their neighbours.
# So: check the bounds after opening; read the mask as well (`read_masks`) when resampling
# elevation.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rasterio==1.4.4
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
import rasterio
from rasterio.enums import Resampling

def grid(x, y):
    path = f"{sys.argv[1]}/a.asc"
    open(path, "w").write(f"ncols 3\nnrows 2\n{x}\n{y}\ncellsize 10\nNODATA_value -9999\n1 2 3\n4 -9999 6\n")
    return rasterio.open(path)

places = {}
for x, y in (("xllcorner 100", "yllcorner 200"), ("xllcenter 105", "yllcenter 205"), ("xllcorner 100", "yllcenter 205")):
    bounds = grid(x, y).bounds
    places[x, y] = (bounds.left, bounds.bottom)
    print(f"{x}, {y}: corner at {places[x, y]}")
holes = {method.name: int((grid("xllcorner 100", "yllcorner 200").read(1, out_shape=(4, 6), resampling=method) == -9999).sum())
         for method in (Resampling.nearest, Resampling.bilinear)}
print("cells of NODATA at twice the size:", holes)
if list(places.values()) != [(100.0, 200.0), (100.0, 200.0), (0.0, -20.0)]:
    sys.exit("changed: places are %s" % places)
if holes != {"nearest": 4, "bilinear": 0}:
    sys.exit("changed: holes are %s" % holes)
PY
