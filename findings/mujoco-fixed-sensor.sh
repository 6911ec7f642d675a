#!/usr/bin/env bash
# mujoco 4.0.0: a rangefinder that is fixed to the world sees through all walls that are.
#
# Expected: a sensor on a post measures the distance to the wall, and so it does on a robot.
# Seen: geoms of the sensor's own body are left out (documented, so that a robot does not see
# itself), and the world is a body too: a site in <worldbody> measures the moving ball behind the
# wall and not the wall, and -1 where there is no ball. The same site in a body of its own, with no
# joint, measures the wall.
# So: wrap fixed sensors in a <body>; `mj_ray` with bodyexclude 0 does the same to a world of
# static geoms, -1 is "exclude nothing".
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mujoco==4.0.0
"$dir/venv/bin/python" - <<'PY'
import sys
import mujoco

model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
<geom type="box" size="0.1 5 5" pos="2 0 0"/>
<body pos="4 0 0"><freejoint/><geom type="sphere" size="0.5" mass="1"/></body>
<site name="fixed" zaxis="1 0 0"/><site name="aside" pos="0 2 0" zaxis="1 0 0"/>
<body><site name="post" zaxis="1 0 0"/></body>
</worldbody><sensor><rangefinder site="fixed"/><rangefinder site="aside"/><rangefinder site="post"/></sensor>
</mujoco>""")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
fixed, aside, post = (round(float(r), 3) for r in data.sensordata)
print("wall at 1.9 m, ball behind it at 3.5 m: site of the world", fixed, "| beside the ball", aside, "| site of a body", post)
if (fixed, aside, post) != (3.5, -1.0, 1.9):
    sys.exit("changed: ranges are %s" % ((fixed, aside, post),))
PY
