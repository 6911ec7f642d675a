#!/usr/bin/env bash
# SciPy 1.17.1, OpenCV 5.0.0: how far is the next wall in a map without walls?
#
# Expected: infinity or an error.
# Seen: SciPy's `distance_transform_edt` gives the distances to a cell that does not exist, (-1, 0):
# 1 to 5 in a map of 4 x 4 cells, and its indices name that cell. Its sister
# `distance_transform_cdt` gives -1, OpenCV 3.4e38.
# So: test `walls.any()` first. A first local map of a robot in the open has no wall, and a planner
# keeps away from its left edge.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    scipy==1.17.1 opencv-python-headless==5.0.0.93 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import cv2
import numpy
from scipy import ndimage

free = numpy.ones((4, 4), numpy.uint8)
rows, columns = numpy.mgrid[:4, :4]
distances, indices = ndimage.distance_transform_edt(free, return_indices=True)
of_cdt = sorted(set(ndimage.distance_transform_cdt(free).flat))
of_opencv = cv2.distanceTransform(free, cv2.DIST_L2, 5)
print(distances.round(2))
print("nearest wall:", sorted(set(zip(indices[0].flat, indices[1].flat))), "| cdt:", of_cdt, "| OpenCV:", of_opencv.min())
is_to_the_cell = numpy.allclose(distances, numpy.hypot(rows + 1, columns))
if not is_to_the_cell or of_cdt != [-1] or not of_opencv.min() > 1e38:
    sys.exit("changed: %s" % distances.tolist())
PY
