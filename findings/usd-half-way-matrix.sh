#!/usr/bin/env bash
# usd-core 26.11: a door that turns by 180 degrees, stored as matrices, shrinks to a line half-way.
#
# Expected: a stage asked between two time samples gives a pose between them; `xformOp:transform` is
# one of the ops for animated rigid bodies.
# Seen: the sixteen numbers are interpolated one by one: half-way between 0 and 180 degrees every
# point is on the axis (determinant 0), half-way to 90 degrees a body has 0.7 of its size. The same
# turn as `xformOp:orient` or `rotateZ` stays rigid.
# So: read matrices only at their own samples (`GetTimeSamples`), or decompose them first; write
# poses as translate and orient.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check usd-core==26.11
"$dir/venv/bin/python" - <<'PY'
import sys
from pxr import Gf, Usd, UsdGeom

stage = Usd.Stage.CreateInMemory()
UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)

def half_way(name, degrees):
    turn = Gf.Rotation((0, 0, 1), degrees)
    body = UsdGeom.Xform.Define(stage, f"/{name}{degrees}")
    if name == "matrix":
        op, values = body.AddTransformOp(), (Gf.Matrix4d(1), Gf.Matrix4d().SetRotate(turn))
    elif name == "orient":
        op, values = body.AddOrientOp(), (Gf.Quatf(1, 0, 0, 0), Gf.Quatf(turn.GetQuat()))
    else:
        op, values = body.AddRotateZOp(), (0, degrees)
    for time, value in zip((0, 10), values):
        op.Set(value, time)
    return round(body.GetLocalTransformation(5).Transform((1, 0, 0)).GetLength(), 3)

found = {name: [half_way(name, degrees) for degrees in (90, 180)] for name in ("matrix", "orient", "rotateZ")}
print("distance of a point at 1 m from the axis, half-way to 90 and 180 degrees:", found)
if found != {"matrix": [0.707, 0.0], "orient": [1.0, 1.0], "rotateZ": [1.0, 1.0]}:
    sys.exit("changed: distances are %s" % found)
PY
