#!/usr/bin/env bash
# Distance to one box from inside and outside: three libraries, three rules of sign.
#
# Expected: negative inside, as distance fields of robotics (ESDF) and of graphics have it; and a
# box stays a box if its triangles are listed the other way round.
# Seen: trimesh 5.2.0 is positive inside, Open3D 0.20.0 and pyvista 0.49.1 (VTK) negative. With
# the triangles turned round trimesh and VTK, which go by normals, change their signs; Open3D, which
# counts crossings, keeps its own.
# So: of each library test one point that is known to be inside, on the mesh at hand; meshes of CAD
# and of mirrored parts are often inside out.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    open3d==0.20.0 trimesh==5.2.0 rtree==1.4.1 pyvista==0.49.1 scipy==1.17.1
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import open3d as o3d
import pyvista
import trimesh

points = np.array([[0.3, 0.1, 0.2], [3.0, 0.1, 0.2]])  # 0.7 m inside, 2 m outside

def distances(mesh):
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh.vertices.astype(np.float32)), o3d.core.Tensor(mesh.faces.astype(np.uint32)))
    surface = pyvista.PolyData.from_regular_faces(np.array(mesh.vertices), np.array(mesh.faces))
    return {name: [round(float(d), 3) for d in values] for name, values in {
        "trimesh": trimesh.proximity.signed_distance(mesh, points),
        "Open3D": scene.compute_signed_distance(o3d.core.Tensor(points.astype(np.float32))).numpy(),
        "pyvista": pyvista.PolyData(points).compute_implicit_distance(surface)["implicit_distance"]}.items()}

box = trimesh.creation.box((2, 2, 2))
turned = trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False)
outward, inward = distances(box), distances(turned)
print("0.7 m inside, 2 m outside:", outward)
print("triangles turned round:   ", inward)
if outward != {"trimesh": [0.7, -2.0], "Open3D": [-0.7, 2.0], "pyvista": [-0.7, 2.0]}:
    sys.exit("changed: distances are %s" % outward)
if inward != {"trimesh": [-0.7, 2.0], "Open3D": [-0.7, 2.0], "pyvista": [0.7, -2.0]}:
    sys.exit("changed: turned round they are %s" % inward)
PY
