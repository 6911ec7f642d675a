#!/usr/bin/env bash
# mujoco 4.0.0: one height field, three ways to give it, two orientations; and heights are
# relative.
#
# Expected: the same rows of numbers make the same terrain, whether they come as `elevation`, as a
# PNG or as MuJoCo's own binary file; an even plateau of height 1 lies at height 1.
# Seen: the first row lies at +y for `elevation` and PNG, and at -y for the binary file. All are
# normalised to 0 .. 1 by their own minimum and maximum and then scaled: a plateau of ones lies at
# 0, and one deeper pixel lifts the rest of the map.
# So: store minimum and maximum beside the heights, set size[2] to their difference and the geom's
# z to the minimum; a test needs a field that is not symmetric in y.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mujoco==4.0.0 pillow==13.0.0
"$dir/venv/bin/python" - <<'PY'
import io
import struct
import sys
import mujoco
import numpy as np
from PIL import Image

def heights(attributes, files):
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><hfield name="h" size="1 1 3 1" {attributes}/></asset>'
        '<worldbody><geom type="hfield" hfield="h"/></worldbody></mujoco>', files)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, np.int32)
    down = np.array([0.0, 0.0, -1.0])
    return [round(5 - mujoco.mj_ray(model, data, np.array([x, y, 5.0]), down, None, 1, -1, hit, None))
            for y in (-0.999, 0.999) for x in (-0.999, 0.999)]

rows = np.array([[0, 1], [2, 3]], np.float32)
png = io.BytesIO()
Image.fromarray((rows * 85).astype(np.uint8)).save(png, "PNG")
found = {
    "elevation": heights('nrow="2" ncol="2" elevation="0 1 2 3"', {}),
    "png": heights('file="a.png"', {"a.png": png.getvalue()}),
    "binary": heights('file="a.hf" content_type="image/vnd.mujoco.hfield"',
                      {"a.hf": struct.pack("<ii", 2, 2) + rows.tobytes()}),
}
plateau = heights('nrow="2" ncol="2" elevation="1 1 1 1"', {})
print("heights at (-x -y), (+x -y), (-x +y), (+x +y):", found)
print("a plateau of ones:", plateau)
if found != {"elevation": [2, 3, 0, 1], "png": [2, 3, 0, 1], "binary": [0, 1, 2, 3]}:
    sys.exit("changed: heights are %s" % found)
if plateau != [0, 0, 0, 0]:
    sys.exit("changed: the plateau lies at %s" % plateau)
PY
