#!/usr/bin/env bash
# ir-sim 2.12.0: a map with `mdownsample: 2` loses walls of one cell, and the robot drives through.
#
# Expected: a coarser map keeps obstacles, as `get_map` of the same library does it for planners
# ("any obstacle in a block marks the block").
# Seen: every second row and column of cells is taken: a wall across the whole map in column 13 of
# 20 is not there, the LiDAR of a robot 4.5 m before it measures its maximum of 20 m, and it arrives
# behind the wall without a collision. The same wall in column 12 is there, twice as thick. Of the
# full grid the map for planners at 1 m has the wall.
# So: downsample the image by the minimum over blocks (walls are black) before loading it.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ir-sim==2.12.0
cd "$dir"
MPLBACKEND=Agg "$dir/venv/bin/python" - 2>"$dir/log" <<'PY'
import sys
import irsim
import numpy as np
from PIL import Image

def drive(column, downsample):
    image = np.full((20, 20), 255, np.uint8)
    image[:, column] = 0
    Image.fromarray(image).save("map.png")
    with open("world.yaml", "w") as file:
        file.write("""
world: {height: 10, width: 10, step_time: 0.1, obstacle_map: ./map.png, mdownsample: %d}
robot:
  - kinematics: {name: omni}
    shape: {name: circle, radius: 0.2}
    state: [2, 5, 0]
    goal: [9, 5, 0]
    behavior: {name: dash}
    vel_max: [2, 2]
    sensors: [{name: lidar2d, range_max: 20, number: 5, angle_range: 0.2}]
""" % downsample)
    env = irsim.make("world.yaml", display=False, log_level="ERROR")
    ahead = float(np.round(env.get_lidar_scan()["ranges"][2], 2))
    planned = int((env.get_map(1.0).grid > 50).sum())
    for _ in range(60):
        env.step()
    return ahead, round(float(env.robot.state[0, 0]), 1), bool(env.robot.collision), planned

found = {case: drive(*case) for case in ((13, 1), (13, 2), (12, 2))}
for (column, downsample), (ahead, x, collision, planned) in found.items():
    print(f"wall in column {column}, mdownsample {downsample}: {ahead} m ahead, robot ends at x = {x}"
          f"{' in collision' if collision else ''}; cells for planners: {planned}")
whole, gone, thick = found.values()
if whole[0] != 4.5 or not whole[2] or gone != (20.0, 9.0, False, 0) or thick[0] != 4.0 or not thick[2]:
    sys.exit("changed: %s" % found)
PY
