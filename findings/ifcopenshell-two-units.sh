#!/usr/bin/env bash
# ifcopenshell 0.9.0.post1: of one wall the placement is in millimetres and the geometry in metres.
#
# Expected: what the library says of one element, `get_local_placement` and `create_shape`, is in
# one unit, that of the file or metres.
# Seen: a wall at (10, 20) m in a file whose unit is mm, the library's default, has the placement
# (10000, 20000, 0) and vertices from (0, 0, 0) to (5, 0.2, 3). Their sum, the way to put the walls
# of a building together, makes a cloud of walls of kilometres; the matrix that comes with the shape
# is in metres.
# So: multiply placements and quantities by `ifcopenshell.util.unit.calculate_unit_scale(file)`, or
# take the shape's own matrix, or `use-world-coords`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ifcopenshell==0.9.0.post1 numpy==2.4.6
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import ifcopenshell.api.context
import ifcopenshell.api.geometry
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.unit
import ifcopenshell.geom
import ifcopenshell.util.placement
import ifcopenshell.util.unit
import numpy as np

api = ifcopenshell.api
file = api.project.create_file()
api.root.create_entity(file, ifc_class="IfcProject")
api.unit.assign_unit(file)
model = api.context.add_context(file, context_type="Model")
body = api.context.add_context(file, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=model)
wall = api.root.create_entity(file, ifc_class="IfcWall")
shape = api.geometry.add_wall_representation(file, context=body, length=5, height=3, thickness=0.2)
api.geometry.assign_representation(file, product=wall, representation=shape)
pose = np.eye(4)
pose[:2, 3] = 10, 20
api.geometry.edit_object_placement(file, product=wall, matrix=pose)

placement = ifcopenshell.util.placement.get_local_placement(wall.ObjectPlacement)[:3, 3].tolist()
geometry = ifcopenshell.geom.create_shape(ifcopenshell.geom.settings(), wall).geometry
corner = np.reshape(geometry.verts, (-1, 3)).max(axis=0).round(6).tolist()
print("unit of the file in metres:", ifcopenshell.util.unit.calculate_unit_scale(file))
print("placement:", placement, "| far corner of the geometry in it:", corner)
if placement != [10_000, 20_000, 0] or corner != [5, 0.2, 3]:
    sys.exit("changed: placement %s, corner %s" % (placement, corner))
PY
