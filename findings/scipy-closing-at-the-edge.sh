#!/usr/bin/env bash
# SciPy 1.17.1: `binary_closing` of an occupancy map removes the wall along the map's edge.
#
# Expected: a closing fills gaps and takes nothing away (it is extensive, in every textbook), as
# scikit-image and OpenCV do it.
# Seen: all cells outside of the map count as free in its erosion (`border_value=0`), so that of a
# room whose outer wall is the outermost ring of cells the whole ring is free afterwards, and a
# robot may leave. `border_value=1` is no way out, as it holds for the dilation, too: a map without
# any wall has four afterwards, its corners.
# So: pad the map by as many free cells as the element reaches, close, and crop; or use
# `skimage.morphology.closing`. Compare with the input: no occupied cell may be lost.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    scipy==1.17.1 scikit-image==0.26.0 opencv-python-headless==5.0.0.93
"$dir/venv/bin/python" - <<'PY'
import sys
import cv2
import numpy as np
from scipy.ndimage import binary_closing
from skimage.morphology import closing, diamond

room = np.zeros((6, 10), dtype=np.uint8)
room[[0, -1], :] = room[:, [0, -1]] = 1
room[3, 4] = room[3, 6] = 1
found = {
    "SciPy": binary_closing(room).astype(np.uint8),
    "SciPy, padded": binary_closing(np.pad(room, 1))[1:-1, 1:-1].astype(np.uint8),
    "scikit-image": closing(room, diamond(1)),
    "OpenCV": cv2.morphologyEx(room, cv2.MORPH_CLOSE, diamond(1).astype(np.uint8)),
}
print("before:", int(room.sum()), "cells of wall")
for name, map_ in found.items():
    print(f"{name}: {int(map_.sum())} cells, {int((room & ~map_ & 1).sum())} of the wall lost")
invented = int(binary_closing(np.zeros_like(room), border_value=1).sum())
print("SciPy, border_value=1, of a map without walls:", invented, "cells of wall")
lost = [int((room & ~map_ & 1).sum()) for map_ in found.values()]
if lost != [28, 0, 0, 0] or invented != 4:
    sys.exit("changed: cells lost are %s, invented %s" % (lost, invented))
PY
