#!/usr/bin/env bash
# usd-core 26.11: a sublayer in half metres is read as centimetres, a session layer is believed,
# and a reference is not scaled.
#
# Expected: composition takes the strongest opinion from any layer of the stack, as for every
# property, so that `metersPerUnit` of the only layer that has it holds for the stage.
# Seen: stage metadata come from the root and the session layer alone. With the unit in a sublayer
# the stage answers 0.01, y up (the fallbacks), as if nothing were authored; a session layer, which
# no file holds, overrides the root's. A cube of 100 cm referenced into a stage of metres is 100 m.
# So: read metersPerUnit and upAxis of the root layer, say so if they are not authored, and compare
# them with those of every referenced layer; a scene assembled from parts needs a factor per part.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check usd-core==26.11
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
from pxr import Sdf, Usd, UsdGeom

part = Sdf.Layer.CreateAnonymous(".usda")
part.ImportFromString('#usda 1.0\n(\n metersPerUnit = 0.5\n upAxis = "Z"\n)\n')
root = Sdf.Layer.CreateAnonymous(".usda")
root.subLayerPaths.append(part.identifier)
alone = UsdGeom.GetStageMetersPerUnit(Usd.Stage.Open(part))
stage = Usd.Stage.Open(root)
composed = (UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage))
stage.GetSessionLayer().pseudoRoot.SetInfo("metersPerUnit", 2.0)
session = UsdGeom.GetStageMetersPerUnit(stage)
print("the part alone:", alone, "| as a sublayer:", composed, "| with a session layer:", session)

box = Usd.Stage.CreateNew(sys.argv[1] + "/box.usda")
UsdGeom.SetStageMetersPerUnit(box, 0.01)
cube = UsdGeom.Cube.Define(box, "/Box")
cube.GetSizeAttr().Set(100)
box.SetDefaultPrim(cube.GetPrim())
box.Save()
world = Usd.Stage.CreateInMemory()
UsdGeom.SetStageMetersPerUnit(world, 1.0)
prim = world.DefinePrim("/Box")
prim.GetReferences().AddReference(sys.argv[1] + "/box.usda")
size = UsdGeom.BBoxCache(0, ["default"]).ComputeWorldBound(prim).ComputeAlignedRange().GetSize()[0]
print("a cube of 1 m from a file in centimetres, in a world of metres:", size, "m")
if (alone, composed, session) != (0.5, (0.01, "Y"), 2.0):
    sys.exit("changed: units compose otherwise")
if size != 100.0:
    sys.exit("changed: the reference is %s m wide" % size)
PY
