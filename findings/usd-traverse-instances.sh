#!/usr/bin/env bash
# usd-core 26.11: walking over a stage misses the walls that are instanced and finds one that is
# nowhere.
#
# Expected: `stage.Traverse()` visits what is in the world; the bounding box agrees with it.
# Seen: of ten instances of a wall the walk finds ten empty transforms and no wall; of a point
# instancer it finds the prototype alone, once, at a place where nothing is drawn. `BBoxCache` has
# all of them. A map made by the walk has no walls where the scene is repetitive.
# So: traverse with `Usd.TraverseInstanceProxies()`, and take point instancers from
# `ComputeInstanceTransformsAtTime`, not from their children.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check usd-core==26.11
"$dir/venv/bin/python" - <<'PY'
import sys
from pxr import Usd, UsdGeom

def width(stage):
    box = UsdGeom.BBoxCache(0, ["default"]).ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    return round(box.GetSize()[0], 3)

def walls(prims):
    return sum(prim.IsA(UsdGeom.Cube) for prim in prims)

instanced = Usd.Stage.CreateInMemory()
instanced.CreateClassPrim("/_wall")
UsdGeom.Cube.Define(instanced, "/_wall/cube")
for index in range(10):
    place = UsdGeom.Xform.Define(instanced, f"/wall{index}")
    place.AddTranslateOp().Set((5.0 * index, 0, 0))
    place.GetPrim().GetReferences().AddInternalReference("/_wall")
    place.GetPrim().SetInstanceable(True)
points = Usd.Stage.CreateInMemory()
instancer = UsdGeom.PointInstancer.Define(points, "/walls")
UsdGeom.Cube.Define(points, "/walls/cube")
instancer.CreatePrototypesRel().AddTarget("/walls/cube")
instancer.CreatePositionsAttr([(100.0 + 5 * index, 0, 0) for index in range(10)])
instancer.CreateProtoIndicesAttr([0] * 10)
found = {name: (walls(stage.Traverse()), walls(stage.Traverse(Usd.TraverseInstanceProxies())), width(stage))
         for name, stage in (("instances", instanced), ("point instancer", points))}
for name, (walked, proxies, size) in found.items():
    print(f"{name}: {walked} of 10 walls walked over, {proxies} with proxies, {size} wide")
if found != {"instances": (0, 10, 47.0), "point instancer": (1, 1, 47.0)}:
    sys.exit("changed: it is %s" % found)
PY
