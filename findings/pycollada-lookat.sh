#!/usr/bin/env bash
# pycollada 0.9.3: a node placed by `<lookat>` is skewed and stays at the origin (assimp-py 1.1.0
# places it).
#
# Expected: COLLADA 1.4.1 defines lookat by an eye, a point of interest and an up vector: a rotation
# and a translation to the eye.
# Seen: the matrix has the eye in its last row instead of its last column, so that it moves nothing,
# and its upper part is no rotation (determinant 0.6): the vector to the right is not made of unit
# length before it is used. Only for a view straight along an axis it is well.
# So: replace lookat by a matrix before handing the file on.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pycollada==0.9.3 assimp-py==1.1.0
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import assimp_py
import collada
import numpy as np

path = sys.argv[1] + "/a.dae"
open(path, "w").write("""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00Z</created><modified>2020-01-01T00:00:00Z</modified><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array>
<technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/>
</vertices><triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="s"><node><lookat>1 2 3 0 0 0 0 0 1</lookat>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>""")
scene = collada.Collada(path).scene
matrix = scene.nodes[0].transforms[0].matrix
first = next(next(scene.objects("geometry")).primitives()).vertex[0]
other = assimp_py.import_file(path, assimp_py.Process_PreTransformVertices | assimp_py.Process_Triangulate)
second = np.array(list(other.meshes[0].vertices)[:3])
determinant = float(np.linalg.det(matrix[:3, :3]))
print("first corner, eye at (1, 2, 3): pycollada", np.round(first, 3).tolist(), "| assimp", np.round(second, 3).tolist())
print("last row:", matrix[3].tolist(), "| determinant:", round(determinant, 3))
if not np.allclose(first, 0) or matrix[3].tolist() != [1, 2, 3, 1] or not 0.55 < determinant < 0.65:
    sys.exit("changed: the matrix is %s" % matrix)
if not np.allclose(second, [1, 2, 3], atol=1e-5):
    sys.exit("changed: assimp places it at %s" % second)
PY
