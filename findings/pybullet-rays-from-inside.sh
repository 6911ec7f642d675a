#!/usr/bin/env bash
# pybullet 3.2.7: what a ray from inside of a box reports depends on how the box is stored.
#
# Expected: a 2 m box is a 2 m box, as GEOM_BOX, as the convex hull of its corners and as a
# triangle mesh; a sensor pushed against or into it reports something near 0, or at least the same
# in all three.
# Seen: from inside the box and the hull nothing is hit (-1, the ray goes through the wall to the
# free side), the mesh reports its far side from within, 0.99 m. From exactly on a face and inwards
# the box answers 0, the hull nothing, and the mesh the opposite wall at 2 m. The hull is also 1 mm
# thicker.
# So: a range sensor that touches an obstacle reads "free". Begin rays outside of the body by its
# own radius, and treat a contact of the body as a hit.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import pybullet

pybullet.connect(pybullet.DIRECT)
corners = [[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
faces = [0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4, 1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7]
shapes = {
    "box": pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[1, 1, 1]),
    "hull": pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=corners),
    "mesh": pybullet.createCollisionShape(
        pybullet.GEOM_MESH, vertices=corners, indices=faces, flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH),
}

def ray(x, start, end):
    hit, _, fraction, *_ = pybullet.rayTest([x, 0.1, start], [x, 0.1, end])[0]
    return None if hit < 0 else round(fraction * abs(end - start), 3) + 0.0

found = {}
for number, (name, shape) in enumerate(shapes.items()):
    x = 10 * number
    pybullet.createMultiBody(0, shape, basePosition=[x, 0, 0])
    found[name] = [ray(x, 5, -5), ray(x, 0.01, 5), ray(x, 1, -5)]
    print(f"{name}: from 4 m above {found[name][0]} | from inside {found[name][1]} | from the face inwards {found[name][2]}")
if found != {"box": [4.0, None, 0.0], "hull": [3.999, None, None], "mesh": [4.0, 0.99, 2.0]}:
    sys.exit("changed: rays report %s" % found)
PY
