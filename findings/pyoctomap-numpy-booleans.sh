#!/usr/bin/env bash
# pyoctomap 1.2.2: a hit and a miss that come from an array are other measurements than True and
# False; a miss is none at all.
#
# Expected: `updateNode(point, True)` is a hit and `False` a miss, with the probabilities of the
# sensor model (0.7 and 0.4), and so are the elements of a NumPy array of booleans, which is what
# comparing ranges gives; another type is refused.
# Seen: what is no Python `bool` is taken for log-odds: `numpy.True_` and 1 give 0.73, and both
# `numpy.False_` and 0 add nothing, so the cell is created and stays at 0.5 after any number of
# misses. No error.
# So: write `bool(hit)`; a map that was filled from an array of booleans has no free cells, only
# unknown ones that look observed.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyoctomap==1.2.2
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import pyoctomap

point = np.array([1.05, 1.05, 1.05])
hits = np.array([3.0, 9.0]) < 5

def occupancy(value, times=1):
    tree = pyoctomap.OcTree(0.1)
    for _ in range(times):
        tree.updateNode(point, value)
    return round(tree.search(point).getOccupancy(), 3)

found = {repr(value): occupancy(value) for value in (True, hits[0], 1, False, hits[1], 0)}
for value, probability in found.items():
    print("updateNode(point, %s):" % value, probability)
misses = occupancy(hits[1], 20), occupancy(False, 20)
print("after 20 misses: %s from the array, %s with False" % misses)
if [found["True"], found["False"]] != [0.7, 0.4]:
    sys.exit("changed: the sensor model is %s" % found)
if occupancy(hits[0]) != 0.731 or occupancy(1) != 0.731:
    sys.exit("changed: a hit of NumPy is %s" % occupancy(hits[0]))
if misses[0] != 0.5 or occupancy(0) != 0.5 or misses[1] > 0.2:
    sys.exit("changed: a miss of NumPy counts: %s" % (misses,))
PY
