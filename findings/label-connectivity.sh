#!/usr/bin/env bash
# SciPy 1.17.1, scikit-image 0.26.0, OpenCV 5.0.0: how many rooms are three cells that meet at
# corners?
#
# Expected: `label` of SciPy and `label` of scikit-image count alike.
# Seen: SciPy counts 3 regions, scikit-image and OpenCV 1: the default of the first is faces alone,
# that of the others corners as well. In three dimensions of a random map of half its cells it is
# hundreds of regions or a few.
# So: give the structure or the connectivity; a body goes through faces.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    scipy==1.17.1 scikit-image==0.26.0 opencv-python-headless==5.0.0.93 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import cv2
import numpy
from scipy import ndimage
from skimage import measure

free = numpy.eye(3, dtype=numpy.uint8)
found = [
    int(ndimage.label(free)[1]),
    int(measure.label(free).max()),
    cv2.connectedComponents(free)[0] - 1,
    int(measure.label(free, connectivity=1).max()),
]
noise = numpy.random.default_rng(1).random((20, 20, 20)) < 0.3
in_space = [int(ndimage.label(noise)[1]), int(measure.label(noise).max())]
print("regions: SciPy %d, scikit-image %d, OpenCV %d, by faces %d;" % tuple(found), "of a random map: %d and %d" % tuple(in_space))
if found != [3, 1, 1, 3] or in_space[0] < 20 * in_space[1]:
    sys.exit("changed: %s, %s" % (found, in_space))
PY
