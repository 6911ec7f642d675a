#!/usr/bin/env bash
# trimesh 5.2.0: a horizontal cut at the height of a floor gives its outline, at the height of a
# ceiling nothing, by the direction in which the plane looks.
#
# Expected: `mesh.section` of a box from z = -1 to 1 by the planes z = -1 and z = 1 is the same
# square twice, or None twice.
# Seen: with a normal upwards it is a square of perimeter 8 at z = -1 and None at z = 1; with the
# normal downwards the other way round. A nanometre higher or lower changes nothing, inside of the
# box or outside.
# So: floor plans of levels that are cut at the very height of a slab have rooms or none by a sign;
# cut between the slabs.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check trimesh==5.2.0 numpy==2.4.6 scipy==1.17.1 networkx
"$dir/venv/bin/python" - <<'PY'
import sys
import trimesh

box, found = trimesh.creation.box(extents=(2, 2, 2)), {}
for normal in (1, -1):
    for height in (-1 - 1e-9, -1, -1 + 1e-9, 0, 1 - 1e-9, 1, 1 + 1e-9):
        cut = box.section(plane_origin=[0, 0, height], plane_normal=[0, 0, normal])
        found[normal, height] = cut and round(float(cut.length), 6)
    print("normal", normal, {f"{height:.10g}": length for (sign, height), length in found.items() if sign == normal})
if (found[1, -1], found[1, 1], found[-1, -1], found[-1, 1]) != (8.0, None, None, 8.0):
    sys.exit("changed: %s" % found)
PY
