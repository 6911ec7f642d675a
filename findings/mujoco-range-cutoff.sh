#!/usr/bin/env bash
# mujoco 4.0.0: with a cut-off of 5 m a wall at 8 m is seen at 5 m, or at 8 m, but not missed.
#
# Expected: a range finder of `cutoff="5"` reports a wall at 7.9 m like the void, -1; of mj_multiRay
# "geoms further than cutoff are ignored".
# Seen: the sensor's cut-off clamps the reading: the wall stands at exactly 5.0, the void stays at
# -1. The cut-off of the rays does nothing to a wall of the world, which is reported at 7.9.
# So: a mapper that fills cells at the end of each non-negative range builds a circle of walls of
# 5 m; leave the cut-off out and compare ranges with the maximum yourself, "at or beyond" included.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mujoco==4.0.0
"$dir/venv/bin/python" - <<'PY'
import sys
import mujoco
import numpy as np

def ranges(cutoff):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody>
    <geom type="box" pos="8 0 1" size="0.1 5 1"/>
    <body pos="0 0 1"><freejoint/><geom size="0.1" mass="1"/>
    <site name="ahead" zaxis="1 0 0"/><site name="behind" zaxis="-1 0 0"/></body></worldbody>
    <sensor><rangefinder site="ahead" {cutoff and f'cutoff="{cutoff}"'}/>
    <rangefinder site="behind" {cutoff and f'cutoff="{cutoff}"'}/></sensor></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    distances, hit = np.zeros(2), np.zeros(2, np.int32)
    rays = np.array([1.0, 0, 0, -1, 0, 0])
    mujoco.mj_multiRay(model, data, np.array([0, 0, 1.0]), rays, None, 1, 1, hit, distances, None, 2,
                       float(cutoff or mujoco.mjMAXVAL))
    return np.round(data.sensordata, 3).tolist(), np.round(distances, 3).tolist()

found = {cutoff: ranges(cutoff) for cutoff in ("", "5", "10")}
for cutoff, (sensor, rays) in found.items():
    print(f"cut-off {cutoff or 'none'}: sensor ahead and behind {sensor}, mj_multiRay {rays}")
plain = [7.9, -1.0]
if found != {"": (plain, plain), "5": ([5.0, -1.0], plain), "10": (plain, plain)}:
    sys.exit("changed: ranges are %s" % found)
PY
