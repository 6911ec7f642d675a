#!/usr/bin/env bash
# python-motion-planning 2.1: of the points on the edges between cells every second cell gets two
# and the others none.
#
# Expected: a grid of 1 m has cell i from i to i + 1; an edge belongs to one side, always the same.
# Seen: `Grid.world_to_map` rounds to the nearest centre with Python's round, half to even: 0, 1, 2,
# 3, 4, 5 m fall into cells 0, 0, 2, 2, 4, 4. At 0.5 m from -3 m on it is so with all multiples of
# 0.5 m. Points outside, -3 m or 99 m, are moved into the outermost cell without a word.
# So: waypoints at whole metres, poses of a simulator's tiles and own lattices skip half of the
# cells; use floor((x - origin) / resolution), and check the range before.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check python-motion-planning==2.1
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
from python_motion_planning import Grid

metre = Grid(bounds=[[0, 6], [0, 6]], resolution=1.0)
half = Grid(bounds=[[-3, 3], [-3, 3]], resolution=0.5)
cells = lambda grid, points: [grid.world_to_map((x, 0.25))[0] for x in points]
edges = cells(metre, range(6))
middles = cells(metre, [i + 0.5 for i in range(6)])
halves = cells(half, [i / 2 - 3 for i in range(12)])
outside = cells(metre, (-3, 99))
print("cells of 0 .. 5 m:", edges, "| of their middles:", middles)
print("cells of -3, -2.5 .. 2.5 m at 0.5 m:", halves)
print("cells of -3 m and 99 m:", outside)
if edges != [0, 0, 2, 2, 4, 4] or middles != list(range(6)) or halves != [0, 0, 2, 2, 4, 4, 6, 6, 8, 8, 10, 10]:
    sys.exit("changed: cells are %s, %s and %s" % (edges, middles, halves))
if outside != [0, 5]:
    sys.exit("changed: outside is %s" % outside)
PY
