#!/usr/bin/env bash
# networkx 3.6.1: the axes of a grid of three dimensions are turned round.
#
# Expected: `grid_graph([2, 3, 4])` has the nodes (0, 0, 0) to (1, 2, 3), as `grid_2d_graph(2, 3)`
# has (0, 0) to (1, 2), and NumPy's array of that shape its indices.
# Seen: the last node is (3, 2, 1). The documentation says so in a note; a graph of a voxel map of
# that shape lacks half of its cells, and has others.
# So: give the dimensions in reverse, `grid_graph(reversed(walls.shape))`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check networkx==3.6.1 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import networkx
import numpy

walls = numpy.zeros((2, 3, 4), bool)
cells = set(numpy.ndindex(walls.shape))
as_given, in_reverse = networkx.grid_graph(walls.shape), networkx.grid_graph(walls.shape[::-1])
found = [max(networkx.grid_2d_graph(2, 3)), max(as_given), len(cells - set(as_given)), set(in_reverse) == cells]
print("last node of 2 x 3: %s, of 2 x 3 x 4: %s; cells without a node: %d; in reverse the same: %s" % tuple(found))
if found != [(1, 2), (3, 2, 1), 12, True]:
    sys.exit("changed: %r" % found)
PY
