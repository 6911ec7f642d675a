#!/usr/bin/env bash
# coal 3.0.3: a robot in the middle of a solid block collides with it, or is 0.9 m away from it, by
# how the block is stored.
#
# Expected: a closed mesh of a box and the box itself are one obstacle; a small sphere at its centre
# collides with both, and its distance is negative with both.
# Seen: with `Box` it collides, at -1.1 m; with `BVHModelOBBRSS` of the same twelve triangles it
# does not, and the distance is +0.9 m: meshes are surfaces. A planner that samples states finds the
# inside of every wall and of every pillar free.
# So: use `buildConvexHull` for convex parts, or add a test of inside and outside; check each motion
# along its way, not its states alone.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check coal==3.0.3 trimesh==5.2.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import coal
import trimesh

here, robot = coal.Transform3s.Identity(), coal.Sphere(0.1)
triangles = trimesh.creation.box((2, 2, 2)).triangles
mesh = coal.BVHModelOBBRSS()
mesh.beginModel(len(triangles), 3 * len(triangles))
for triangle in triangles:
    mesh.addTriangle(*triangle)
mesh.endModel()
found = {}
for name, block in {"box": coal.Box(2, 2, 2), "mesh": mesh}.items():
    hit = coal.collide(block, here, robot, here, coal.CollisionRequest(), coal.CollisionResult())
    distance = coal.distance(block, here, robot, here, coal.DistanceRequest(), coal.DistanceResult())
    found[name] = bool(hit), round(distance, 3)
    print(f"{name}: collides {found[name][0]}, distance {found[name][1]} m")
if found != {"box": (True, -1.1), "mesh": (False, 0.9)}:
    sys.exit("changed: it is %s" % found)
PY
