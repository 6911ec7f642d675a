#!/usr/bin/env bash
# OctoMap by pyoctomap 1.2.2: saving a tree as .bt changes the tree in memory.
#
# Expected: writing a file leaves the map as it is; .bt keeps only free or occupied, but that is a
# property of the file.
# Seen: `writeBinary` first turns the tree itself into its maximum-likelihood form. A cell seen
# once (probability 0.7) is at the upper clamp (0.97) after saving, and takes 9 misses instead of 3
# until it is free again. `write` (.ot) leaves the tree alone.
# So: a node that saves .bt snapshots while it maps freezes whatever moved past: save .ot, or a
# copy. In C++ `writeBinaryConst` is the call that means what one expects.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyoctomap==1.2.2
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import numpy as np
import pyoctomap

point = np.array([0.55, 0.05, 0.05])

def seen_once(save):
    tree = pyoctomap.OcTree(0.1)
    tree.updateNode(point, True)
    tree.updateInnerOccupancy()
    save(tree)
    after, misses = round(tree.search(point).getOccupancy(), 3), 0
    while tree.isNodeOccupied(tree.search(point)):
        tree.updateNode(point, False)
        misses += 1
    return after, misses

found = {
    "not saved": seen_once(lambda tree: None),
    "saved as .ot": seen_once(lambda tree: tree.write(sys.argv[1] + "/a.ot")),
    "saved as .bt": seen_once(lambda tree: tree.writeBinary(sys.argv[1] + "/a.bt")),
}
for name, (after, misses) in found.items():
    print(f"{name}: probability {after}, free again after {misses} misses")
if found["not saved"] != (0.7, 3):
    sys.exit("changed: without saving it is %s" % (found["not saved"],))
if found["saved as .ot"] != found["not saved"]:
    sys.exit("changed: .ot leaves %s" % (found["saved as .ot"],))
if found["saved as .bt"] != (0.971, 9):
    sys.exit("changed: .bt leaves %s" % (found["saved as .bt"],))
PY
