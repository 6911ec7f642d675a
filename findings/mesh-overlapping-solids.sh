#!/usr/bin/env bash
# Two overlapping boxes in one mesh: trimesh 5.2.0 and Open3D 0.20.0 see a hole where they overlap,
# pyvista 0.49.1 does not.
#
# Expected: a wall built of two boxes that reach into each other, as CAD and simulator worlds are
# made, is solid throughout; each box is closed, and so is the mesh (`is_watertight`).
# Seen: trimesh's `contains` and Open3D's `compute_occupancy` count crossings: two layers deep is
# outside (even), and Open3D's signed distance is positive there. VTK's `select_interior_points`
# says inside. And the volume by trimesh counts the overlap twice.
# So: unite solids before voxelising, or test per component and join; a winding number is the right
# measure.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    open3d==0.20.0 trimesh==5.2.0 pyvista==0.49.1 scipy==1.17.1 rtree==1.4.1 networkx==3.6
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import numpy as np
import open3d
import pyvista
import trimesh

points = np.array([[0.5, 0.01, 0.02], [-0.5, 0.01, 0.02]])  # in both boxes, in the first alone

def inside(size):
    first, second = trimesh.creation.box((2, 2, 2)), trimesh.creation.box(size)
    second.apply_translation([1, 0, 0])
    mesh = trimesh.util.concatenate([first, second])
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(open3d.core.Tensor(mesh.vertices.astype(np.float32)), open3d.core.Tensor(mesh.faces.astype(np.uint32)))
    query = open3d.core.Tensor(points.astype(np.float32))
    surface = pyvista.PolyData(mesh.vertices, np.c_[np.full(len(mesh.faces), 3), mesh.faces])
    marked = pyvista.PolyData(points).select_interior_points(surface).point_data
    found = {
        "trimesh": mesh.contains(points).tolist(),
        "open3d": scene.compute_occupancy(query).numpy().astype(bool).tolist(),
        "pyvista": np.array(marked[list(marked.keys())[-1]]).astype(bool).tolist(),
    }
    return found, bool(mesh.is_watertight), round(float(mesh.volume), 3)

apart, closed, volume = inside((2, 1.5, 1.2))
print("in both, in one:", apart, "| watertight", closed, "| volume", volume, "of", 8 + 3.6 - 1.8)
if apart != {"trimesh": [False, True], "open3d": [False, True], "pyvista": [True, True]}:
    sys.exit("changed: inside are %s" % apart)
if not closed or volume != 11.6:
    sys.exit("changed: watertight %s, volume %s" % (closed, volume))
PY
