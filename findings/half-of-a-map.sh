#!/usr/bin/env bash
# Half the resolution of one map by nearest neighbours: OpenCV 5.0.0.93, Pillow 13.0.0, SciPy 1.17.1
# and scikit-image 0.26.0.
#
# Expected: of 8 columns every second one, the same ones in each library; a column keeps its place.
# Seen: OpenCV takes 0 2 4 6 (the lower corner of each pair), Pillow, scikit-image and OpenCV's
# INTER_NEAREST_EXACT take 1 3 5 7, SciPy's `zoom` 0 2 5 7: it puts the centres of the first and the
# last cell onto each other, so that its step is 7/3 cells and places shift by up to half a cell
# from edge to edge. A wall of one cell in column 4 is there in the first only, one in column 2 in
# two of them.
# So: for occupancy take the maximum of each block (`skimage.measure.block_reduce`), never nearest
# neighbours; for labels name the rule, and pass `grid_mode=True, mode="nearest"` to `zoom`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    scipy==1.17.1 scikit-image==0.26.0 opencv-python-headless==5.0.0.93 pillow==13.0.0
"$dir/venv/bin/python" - <<'PY'
import sys
import cv2
import numpy as np
from PIL import Image
from scipy.ndimage import zoom
from skimage.transform import resize

columns = np.arange(8, dtype=np.uint8)[None].repeat(8, 0)
found = {
    "OpenCV": cv2.resize(columns, (4, 4), interpolation=cv2.INTER_NEAREST),
    "OpenCV, exact": cv2.resize(columns, (4, 4), interpolation=cv2.INTER_NEAREST_EXACT),
    "Pillow": np.array(Image.fromarray(columns).resize((4, 4), Image.Resampling.NEAREST)),
    "scikit-image": resize(columns, (4, 4), order=0, preserve_range=True, anti_aliasing=False),
    "SciPy": zoom(columns, 0.5, order=0),
    "SciPy, grid_mode": zoom(columns, 0.5, order=0, grid_mode=True, mode="nearest"),
}
found = {name: [int(column) for column in half[0]] for name, half in found.items()}
for name, half in found.items():
    print(f"{name}: columns {half}, wall in column 4 is {'there' if 4 in half else 'gone'}")
odd = [1, 3, 5, 7]
if list(found.values()) != [[0, 2, 4, 6], odd, odd, odd, [0, 2, 5, 7], odd]:
    sys.exit("changed: columns are %s" % found)
PY
