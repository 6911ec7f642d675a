#!/usr/bin/env bash
# pyastar2d 1.1.4: along a straight corridor it returns a zigzag, and it slips between two walls
# that touch.
#
# Expected: with `allow_diagonal=True` a diagonal step costs more than a straight one (1.41 cells),
# or the shortest path of straight steps is preferred; a start in a wall is refused as a goal in one
# is.
# Seen: a step costs what its cell costs, whatever its direction: on an empty strip of 3 x 9 the
# path swings from side to side, 10.5 cells long for 8. It passes between two infinite cells that
# meet at a corner, and out of an infinite start cell.
# So: recompute lengths, smooth the path, and widen walls by one cell before planning with
# diagonals.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyastar2d==1.1.4
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import pyastar2d

def path(costs, start, goal):
    found = pyastar2d.astar_path(costs, start, goal, allow_diagonal=True)
    return None if found is None else found.tolist()

length = lambda cells: round(float(np.linalg.norm(np.diff(cells, axis=0), axis=1).sum()), 1)
strip = path(np.ones((3, 9), np.float32), (1, 0), (1, 8))
corner = np.ones((3, 3), np.float32)
corner[0, 1] = corner[1, 0] = np.inf
between = path(corner, (0, 0), (2, 2))
walled = np.ones((3, 3), np.float32)
walled[0, 0] = np.inf
out, into = path(walled, (0, 0), (2, 2)), path(walled, (2, 2), (0, 0))
print("strip of 8 cells:", length(strip), "cells long:", strip)
print("between two walls:", between, "| out of a wall:", out, "| into it:", into)
if len(strip) != 9 or length(strip) <= 8.0:
    sys.exit("changed: the strip gives %s" % strip)
if between != [[0, 0], [1, 1], [2, 2]] or out is None or into is not None:
    sys.exit("changed: paths are %s, %s and %s" % (between, out, into))
PY
