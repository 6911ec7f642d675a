#!/usr/bin/env bash
# pybullet 3.2.7: the doorway of a wall that is one mesh is closed, for rays and for robots, from
# URDF and from `createCollisionShape`.
#
# Expected: a ray through the opening of the mesh passes, as it does through the picture of the same
# robot file in a viewer, and as rays do in MuJoCo.
# Seen: the mesh is replaced by its convex hull, without a message: the ray ends in the plane of the
# wall. With the flag GEOM_FORCE_CONCAVE_TRIMESH, or `concave="yes"` at the <collision> of the URDF,
# it passes.
# So: give the flag for every building (it must not move then), or cut it into convex parts; an
# exploration of a hull has no rooms.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pybullet==3.2.7 trimesh==5.2.0 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" - <<'PY' >out 2>log || { cat out log; exit 1; }
import sys
import pybullet
import trimesh

boxes = [[[-0.1, -3, 0], [0.1, -0.5, 2.5]], [[-0.1, 0.5, 0], [0.1, 3, 2.5]], [[-0.1, -0.5, 2], [0.1, 0.5, 2.5]]]
trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in boxes]).export("wall.obj")
for concave in ("", ' concave="yes"'):
    with open(f"wall{len(concave)}.urdf", "w") as file:
        file.write(f"""<robot name="w"><link name="l"><inertial><mass value="0"/>
<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>
<collision{concave}><geometry><mesh filename="wall.obj"/></geometry></collision></link></robot>""")
pybullet.connect(pybullet.DIRECT)

def passes(load):
    """Whether a ray passes the doorway, and one at the wall does."""
    body = load()
    hits = [pybullet.rayTest([-4, y, 1], [4, y, 1])[0][0] for y in (0, 2)]
    pybullet.removeBody(body)
    return [hit < 0 for hit in hits]

def shape(**options):
    return lambda: pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName="wall.obj", **options))
found = {
    "URDF": passes(lambda: pybullet.loadURDF("wall0.urdf", useFixedBase=True)),
    "URDF, concave": passes(lambda: pybullet.loadURDF("wall14.urdf", useFixedBase=True)),
    "shape": passes(shape()),
    "shape, concave": passes(shape(flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH)),
}
print("rays that pass the doorway, and the wall:", found)
open_doors = [name for name, (door, _) in found.items() if door]
if open_doors != ["URDF, concave", "shape, concave"] or any(wall for _, wall in found.values()):
    sys.exit("changed: rays pass as %s" % found)
PY
grep -v "^pybullet build" out
