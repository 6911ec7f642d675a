#!/usr/bin/env bash
# elkai 2.0.1: distances are rounded to whole numbers: a tour in kilometres or in the unit square is
# an arbitrary one.
#
# Expected: `DistanceMatrix` takes lists of floats and `Coordinates2D` tuples of floats, so the tour
# is the best for these; a change of unit does not change the order of the places.
# Seen: LKH below it counts in integers. Of 8 places in a square of 0.3, whose distances all round
# to 0, the tour is longer by half than the shortest one, from the matrix and from the coordinates;
# with the same numbers times 1000 it is the shortest. Nothing is said.
# So: multiply by the precision that is needed, and compute the length from your own matrix.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check elkai==2.0.1
"$dir/venv/bin/python" - <<'PY'
import itertools
import math
import random
import sys
import elkai

random.seed(1)
places = [(random.random() * 0.3, random.random() * 0.3) for _ in range(8)]
def length(tour):
    return sum(math.dist(places[a], places[b]) for a, b in zip(tour, tour[1:]))
best = min(length((0, *rest, 0)) for rest in itertools.permutations(range(1, 8)))
found = {}
for scale in (1, 1000):
    matrix = [[math.dist(a, b) * scale for b in places] for a in places]
    named = {str(index): (x * scale, y * scale) for index, (x, y) in enumerate(places)}
    by_matrix = elkai.DistanceMatrix(matrix).solve_tsp()
    by_place = [int(name) for name in elkai.Coordinates2D(named).solve_tsp()]
    found[scale] = [round(length(tour) / best, 2) for tour in (by_matrix, by_place)]
    print(f"distances times {scale}: length over the shortest, by matrix and by coordinates: {found[scale]}")
if found[1000] != [1, 1] or min(found[1]) < 1.05:
    sys.exit("changed: the tours are %s" % found)
PY
