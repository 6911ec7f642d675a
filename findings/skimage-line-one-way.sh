#!/usr/bin/env bash
# scikit-image 0.26.0: the cells of a line from A to B are not those of the line from B to A.
#
# Expected: `skimage.draw.line` draws the segment between two cells, so the order of its ends does
# not matter, and a test of a line of sight along it has one answer for both robots.
# Seen: for 56 of the 169 offsets within 6 cells the two directions take different cells where the
# segment passes exactly between two. With one wall cell there, A sees B, and B does not see A.
# So: order the two ends before drawing (the smaller one first), or walk all cells that the segment
# touches.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check scikit-image==0.26.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
from skimage.draw import line

def cells(a, b):
    return set(zip(*(axis.tolist() for axis in line(*a, *b))))
offsets = [(row, column) for row in range(-6, 7) for column in range(-6, 7)]
different = sum(cells((0, 0), end) != cells(end, (0, 0)) for end in offsets)
there, back = sorted(cells((0, 0), (2, 1))), sorted(cells((2, 1), (0, 0)))
print("(0, 0) to (2, 1):", there, "| back:", back)
print(different, "of", len(offsets), "offsets have other cells on the way back")
if different != 56 or there == back:
    sys.exit("changed: %d offsets differ" % different)
PY
