#!/usr/bin/env bash
# Marching cubes of one occupancy grid (1 is occupied): scikit-image 0.26.0 gives it inside out,
# PyMCubes 0.1.6 does not.
#
# Expected: the mesh of a solid has its faces outwards and a positive volume.
# Seen: the vertices span the same sphere, the volume is +258 by PyMCubes and -258 by scikit-image.
# `gradient_direction="descent"`, its default, is for "object was greater than exterior" and so the
# right one by its name, but "considering the left-hand rule": every mesh format and library takes
# the right hand. The normals that it returns beside the faces point outwards and contradict them.
# A signed distance, negative inside, is outwards by scikit-image and inside out by PyMCubes.
# So: `gradient_direction="ascent"` for occupancy; check the sign of the volume once. A ray caster
# that culls back faces, or a signed distance to such a mesh, is inverted.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    PyMCubes==0.1.6 scikit-image==0.26.0 scipy==1.17.1 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import mcubes
import numpy as np
from skimage.measure import marching_cubes

distance = np.sqrt((np.mgrid[-5:6, -5:6, -5:6] ** 2).sum(0)) - 4

def volume(vertices, faces):
    a, b, c = (np.asarray(vertices, float)[np.asarray(faces, int)[:, at]] for at in range(3))
    return round(float((a * np.cross(b, c)).sum() / 6), 1)

def agreement(vertices, faces, normals):
    a, b, c = (vertices[faces[:, at]] for at in range(3))
    outward = (np.cross(b - a, c - a) * normals[faces].mean(1)).sum(1) > 0
    return float(outward.mean())

high, low = -distance, distance
found = {}
for name, field in (("high inside", high), ("low inside", low)):
    vertices, faces, normals, _ = marching_cubes(field, 0)
    away = float((((vertices - 5) * normals).sum(1) > 0).mean())
    found[name] = [volume(*mcubes.marching_cubes(field, 0)), volume(vertices, faces),
                   volume(*marching_cubes(field, 0, gradient_direction="ascent")[:2]),
                   round(away, 2), round(agreement(vertices, faces, normals), 2)]
    print("%s: PyMCubes %s, scikit-image %s, with ascent %s; normals outwards %s, faces along normals %s"
          % (name, *found[name]))
if found["high inside"] != [258.3, -258.3, 258.3, 1.0, 0.0] or found["low inside"][:3] != [-258.3, 258.3, -258.3]:
    sys.exit("changed: volumes are %s" % found)
PY
