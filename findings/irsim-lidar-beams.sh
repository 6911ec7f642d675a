#!/usr/bin/env bash
# ir-sim 2.12.0: a full-circle LiDAR measures one direction twice and straight ahead never, and a
# miss is a wall at the maximum range.
#
# Expected: eight beams over 360 degrees are 45 degrees apart, one of them ahead; a beam without
# return is +Inf (REP 117), which mapping tools take as free.
# Seen: the beams go from -pi to pi with both ends: 51.4 degrees apart, the first and the last
# backwards, none within 25 degrees of ahead. Beams that hit nothing have `ranges` = range_max, the
# same number as a hit there; a second list, `valid`, tells them apart.
# So: ask for an odd number of beams and drop the last; use `valid`, or a map gets a ring of walls.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ir-sim==2.12.0 numpy==2.4.6
cat > "$dir/world.yaml" <<'YAML'
world: {height: 20, width: 20, step_time: 0.1, sample_time: 0.1, control_mode: auto}
robot:
  - kinematics: {name: diff}
    shape: {name: circle, radius: 0.2}
    state: [10, 10, 0]
    goal: [10, 10, 0]
    sensors: [{type: lidar2d, range_min: 0, range_max: 5, angle_range: 6.28319, number: 8, noise: false}]
obstacle:
  - shape: {name: rectangle, length: 1, width: 6}
    state: [13, 10]
YAML
cd "$dir"
MPLBACKEND=Agg "$dir/venv/bin/python" - 2>"$dir/log" <<'PY'
import sys
import irsim
import numpy as np

env = irsim.make("world.yaml", display=False)
env.step(np.zeros((2, 1)))
scan = env.robot.get_lidar_scan()
count = len(scan["ranges"])
angles = np.degrees(scan["angle_min"] + np.arange(count) * scan["angle_increment"]).round(1).tolist()
ranges, valid = np.round(scan["ranges"], 2).tolist(), [bool(v) for v in scan["valid"]]
print("degrees:", angles)
print("ranges: ", ranges)
print("valid:  ", valid)
if abs(angles[0] + 180) > 0.2 or abs(angles[-1] - 180) > 0.2 or min(map(abs, angles)) < 25:
    sys.exit("changed: beams go at %s" % angles)
if [r for r, v in zip(ranges, valid) if not v] != [5.0] * valid.count(False) or not 0 < valid.count(False) < count:
    sys.exit("changed: misses are %s, valid %s" % (ranges, valid))
PY
