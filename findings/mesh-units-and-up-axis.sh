#!/usr/bin/env bash
# COLLADA's and 3MF's units: assimp-py 1.1.0 applies one and not the other, trimesh 5.2.0 neither.
#
# Expected: COLLADA's <unit> and <up_axis> and 3MF's `unit` say what the numbers are, so that two
# readers give one size and one orientation.
# Seen: of a z-up file in centimetres trimesh hands out the raw numbers with `units` "0.01 *
# meters" (a string to parse oneself) and nothing at all about the axis; assimp scales to metres
# and turns to y up. Of 3MF assimp ignores the unit: one inch, one millimetre and one metre are all
# 1.0. And trimesh writes Y_UP into every .dae, whatever lies in the scene.
# So: one file has three sizes and two orientations by reader: say after import which extent came
# out in metres; believe Y_UP in a .dae only if its <contributor> is not trimesh's (which writes
# none).
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    assimp-py==1.1.0 trimesh==5.2.0 pycollada==0.9.3 scipy==1.17.1 networkx==3.6 lxml==6.1.3
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import zipfile
import assimp_py
import trimesh

dae = sys.argv[1] + "/a.dae"
open(dae, "w").write('''<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>
<created>2020-01-01T00:00:00Z</created><modified>2020-01-01T00:00:00Z</modified>
<unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="9">0 0 0 100 0 0 0 200 500
</float_array><technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>''')

def three_mf(unit):
    path = f"{sys.argv[1]}/{unit}.3mf"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("[Content_Types].xml", '<?xml version="1.0"?><Types xmlns="http://schemas.openxmlformats.org/'
                      'package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxml'
                      'formats-package.relationships+xml"/><Default Extension="model" ContentType="application/'
                      'vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>')
        file.writestr("_rels/.rels", '<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/'
                      'package/2006/relationships"><Relationship Target="/3D/3dmodel.model" Id="r0" Type="http://'
                      'schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>')
        file.writestr("3D/3dmodel.model", f'<?xml version="1.0"?><model unit="{unit}" xmlns="http://schemas.'
                      'microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1" type="model"><mesh>'
                      '<vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>'
                      '<vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/><triangle '
                      'v1="0" v2="1" v3="3"/><triangle v1="0" v2="3" v3="2"/><triangle v1="1" v2="2" v3="3"/>'
                      '</triangles></mesh></object></resources><build><item objectid="1"/></build></model>')
    parts = assimp_py.import_file(path, assimp_py.Process_PreTransformVertices)
    return max(parts.meshes[0].vertices)

scene = trimesh.load(dae)
by_trimesh = scene.bounds[1].round(6).tolist()
turned = assimp_py.import_file(dae, assimp_py.Process_PreTransformVertices)
corners = list(turned.meshes[0].vertices)
by_assimp = [round(float(c), 6) for c in corners[6:]]
sizes = [three_mf(unit) for unit in ("inch", "millimeter", "meter")]
written = trimesh.exchange.export.export_mesh(trimesh.creation.box(), None, file_type="dae").decode()
axis = written.split("<up_axis>")[1].split("<")[0]
print("corner (0, 200, 500) cm, z up: trimesh", by_trimesh, scene.units, "| assimp", by_assimp)
print("3MF of one inch, millimetre, metre by assimp:", sizes, "| trimesh writes", axis)
if by_trimesh != [100.0, 200.0, 500.0] or scene.units != "0.01 * meters":
    sys.exit("changed: trimesh reads %s %s" % (by_trimesh, scene.units))
if by_assimp != [0.0, 5.0, -2.0]:
    sys.exit("changed: assimp reads %s" % by_assimp)
if sizes != [1.0, 1.0, 1.0] or axis != "Y_UP":
    sys.exit("changed: 3MF sizes are %s, the axis is %s" % (sizes, axis))
PY
