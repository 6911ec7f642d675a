#!/usr/bin/env bash
# scikit-image 0.26.0: ten calls of `medial_axis` on one map give ten skeletons.
#
# Expected: a function of the map. A topological map or a roadmap made of it is the same in each
# run, `numpy.random.seed` at the start of the program or not.
# Seen: cells of equal distance are taken in the order of random numbers from a generator that is
# seeded anew by the system in each call (`rng=None`), so that of a room of 16 x 36 cells the
# skeletons differ in each of ten calls. `numpy.random.seed(0)` before each call changes nothing;
# `rng=0` makes them equal, and `skeletonize` has no random numbers.
# So: pass `rng`; a graph of junctions and corridors that differs between two runs of one bag may
# come from here.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check scikit-image==0.26.0 scipy==1.17.1
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from skimage.morphology import medial_axis, skeletonize

room = np.zeros((20, 40), dtype=bool)
room[2:18, 2:38] = True

def seeded(_):
    np.random.seed(0)
    return medial_axis(room)

ways = {"medial_axis": lambda _: medial_axis(room), "after numpy.random.seed(0)": seeded,
        "rng=0": lambda _: medial_axis(room, rng=0), "skeletonize": lambda _: skeletonize(room)}
found = {name: len({way(at).tobytes() for at in range(10)}) for name, way in ways.items()}
for name, different in found.items():
    print(f"{name}: {different} different skeletons of 10")
many, seeded_too, one, other = found.values()
if many < 5 or seeded_too < 5 or (one, other) != (1, 1):
    sys.exit("changed: different skeletons are %s" % found)
PY
