#!/usr/bin/env bash
# usd-core 26.11: a bounding box is what the file says it is, and a translation without an order is
# none.
#
# Expected: the bounds of a mesh are computed from its points, and an attribute named
# `xformOp:translate` translates.
# Seen: `BBoxCache` believes an authored `extent` of a mesh although its points have moved on (but
# computes that of a cube from its size); `xformOp:translate` without `xformOpOrder` is ignored,
# with no warning.
# So: compute bounds from points after each edit (`UsdGeom.PointBased.ComputeExtent`), as a writer
# author `extent` last, and as a reader warn about ops that no order names.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check usd-core==26.11
"$dir/venv/bin/python" - <<'PY'
import sys
from pxr import Sdf, Usd, UsdGeom

stage = Usd.Stage.CreateInMemory()
mesh = UsdGeom.Mesh.Define(stage, "/Mesh")
mesh.GetPointsAttr().Set([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
mesh.GetFaceVertexCountsAttr().Set([3])
mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2])
mesh.GetExtentAttr().Set([(0, 0, 0), (1, 1, 0)])
mesh.GetPointsAttr().Set([(0, 0, 0), (50, 0, 0), (0, 50, 0)])
bound = lambda prim: UsdGeom.BBoxCache(0, ["default"]).ComputeWorldBound(prim).ComputeAlignedRange().GetSize()[0]
stale, true = bound(mesh.GetPrim()), UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get())[1][0]
moved = UsdGeom.Xform.Define(stage, "/Moved")
moved.GetPrim().CreateAttribute("xformOp:translate", Sdf.ValueTypeNames.Double3).Set((1, 2, 3))
x = moved.GetLocalTransformation().ExtractTranslation()[0]
moved.GetXformOpOrderAttr().Set(["xformOp:translate"])
ordered = moved.GetLocalTransformation().ExtractTranslation()[0]
print("width by BBoxCache:", stale, "| by its points:", true)
print("x of the translation without an order:", x, "| with:", ordered)
if (stale, true) != (1.0, 50.0):
    sys.exit("changed: BBoxCache gives %s" % stale)
if (x, ordered) != (0.0, 1.0):
    sys.exit("changed: x is %s without an order" % x)
PY
