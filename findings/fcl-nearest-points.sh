#!/usr/bin/env bash
# python-fcl 0.7.0.11: the nearest points of a mesh and a sphere are each in the frame of their own
# object, and for other pairs in the order of the other call.
#
# Expected: `DistanceResult.nearest_points` are two points in world coordinates, the first on the
# first object, whatever shapes the two are.
# Seen: a box of 2 m at x = 10 and a sphere at x = 13 give points at x = 11 and 12.5. With the box
# as a mesh they are at 1 and -0.5, each in local coordinates; with a mesh in place of the sphere
# they are in world coordinates and swapped, so that the "point on the box" lies on the other. The
# distance is right in all of these.
# So: between mesh and primitive use the distance alone, or make both of one kind; check that the
# two points are as far apart as the distance says.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check python-fcl==0.7.0.11
"$dir/venv/bin/python" - <<'PY'
import itertools
import sys
import fcl
import numpy as np

def mesh(vertices, faces):
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices, faces)
    model.endModel()
    return model

corners = np.array(list(itertools.product((-1.0, 1), repeat=3)))
quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
box_faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
tips = np.array([[0.5, 0, 0], [-0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0], [0, 0, 0.5], [0, 0, -0.5]])
tip_faces = np.array([[i, j, k] for i in (0, 1) for j in (2, 3) for k in (4, 5)])
boxes = {"box": fcl.Box(2, 2, 2), "box as mesh": mesh(corners, box_faces)}
balls = {"sphere": fcl.Sphere(0.5), "octahedron as mesh": mesh(tips, tip_faces)}

def nearest(first, second):
    place = lambda shape, *at: fcl.CollisionObject(shape, fcl.Transform(np.array(at)))
    result = fcl.DistanceResult()
    distance = fcl.distance(place(first, 10.0, 0.0, 0.0), place(second, 13.0, 0.1, 0.2),
                            fcl.DistanceRequest(enable_nearest_points=True), result)
    return round(distance, 3), [round(float(p[0]), 3) for p in result.nearest_points]

found = {}
for (a, first), (b, second) in itertools.product(boxes.items(), balls.items()):
    found[a, b] = nearest(first, second)
    print(f"{a} at 10, {b} at 13: distance {found[a, b][0]}, x of the nearest points {found[a, b][1]}")
if found != {("box", "sphere"): (1.5, [11.0, 12.5]), ("box", "octahedron as mesh"): (1.5, [12.5, 11.0]),
             ("box as mesh", "sphere"): (1.5, [1.0, -0.5]),
             ("box as mesh", "octahedron as mesh"): (1.5, [11.0, 12.5])}:
    sys.exit("changed: it is %s" % found)
PY
