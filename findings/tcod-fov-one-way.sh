#!/usr/bin/env bash
# tcod 21.2.2: by the default field of view one cell in six sees another that does not see it, and a
# radius of 5 reaches 7.1.
#
# Expected: that two open cells see each other is one fact, whichever asks; `radius=5`, "the maximum
# distance", ends at a distance of 5 cells in every direction.
# Seen: on a map with 15 % walls, of 400 pairs in which at least one sees the other, 65 see only one
# way with the default algorithm and up to 193 with others; FOV_PERMISSIVE and
# FOV_SYMMETRIC_SHADOWCAST are mutual. In the open the default sees a square of 11 by 11 cells, its
# corners included; FOV_SYMMETRIC_SHADOWCAST sees a disc with 9 of the 11 cells of an axis.
# So: take FOV_SYMMETRIC_SHADOWCAST for lines of sight between robots, ask for one cell more and cut
# the distance yourself: a link that exists one way only is a fault of the map, not of the radio.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check tcod==21.2.2 numpy==2.4.6
"$dir/venv/bin/python" -W ignore - <<'PY'
import itertools
import sys
import numpy as np
from tcod import libtcodpy
from tcod.map import compute_fov

free = np.random.default_rng(0).random((30, 30)) < 0.85
cells = np.argwhere(free)
viewers = {tuple(cells[index]) for index in np.random.default_rng(1).integers(len(cells), size=60)}
open_space = np.ones((21, 21), bool)
found = {}
for name in (None, "FOV_SHADOW", "FOV_DIAMOND", "FOV_PERMISSIVE_8", "FOV_SYMMETRIC_SHADOWCAST"):
    options = {"algorithm": getattr(libtcodpy, name)} if name else {}
    views = {viewer: compute_fov(free, viewer, radius=0, **options) for viewer in viewers}
    pairs = [(views[a][b], views[b][a]) for a, b in itertools.combinations(viewers, 2)]
    one_way, any_way = sum(a != b for a, b in pairs), sum(a or b for a, b in pairs)
    disc = compute_fov(open_space, (10, 10), radius=5, **options)
    found[name] = int(one_way), int(disc[10].sum()), bool(disc[15, 15])
    print(f"{name or 'default'}: {one_way} of {any_way} pairs see one way; radius 5: {disc[10].sum()} cells along an axis, corner {disc[15, 15]}")
if found[None][0] < 20 or found[None][1:] != (11, True) or found["FOV_SHADOW"][0] < 20:
    sys.exit("changed: default and shadow are %s" % found)
if found["FOV_SYMMETRIC_SHADOWCAST"] != (0, 9, False) or found["FOV_PERMISSIVE_8"][0] != 0:
    sys.exit("changed: the mutual ones are %s" % found)
PY
