#!/usr/bin/env bash
# kiss-icp 1.3.0 and genz-icp 0.3.2: one scan of a moving LiDAR is motion-corrected to its end or to
# its middle, and times that are not 0 .. 1 fling points away in one of them.
#
# Expected: GenZ-ICP is built on KISS-ICP with the same classes and configuration, so one scan, its
# times and one motion give one corrected scan; times are in any unit, as in the point clouds of
# drivers, or refused.
# Seen: a wall at 10 m that is measured three times while the robot drives 1 m is corrected to
# 9.0, 9.5 and 10 m (the pose is that at the end) or to 9.5, 10 and 10.5 m (in the middle). With
# seconds of one scan (0 .. 0.1) GenZ-ICP corrects by a tenth; with a clock's seconds (100 .. 100.1)
# the wall is at 109.5 m; with nanoseconds it is 100,000 km away. KISS-ICP gives the same
# answer for all four. Neither says anything.
# So: normalise times to 0 .. 1 of the scan before GenZ-ICP, and stamp its poses with the middle of
# the scan and KISS-ICP's with the end; else a comparison measures half a scan of motion.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check kiss-icp==1.3.0 genz-icp==0.3.2
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from genz_icp.preprocess import Preprocessor as Genz
from kiss_icp.preprocess import Preprocessor as Kiss

motion = np.eye(4)
motion[0, 3] = 1.0
wall = np.array([[10.0, 0.0, 0.0]] * 3)
scans = {"0 .. 1": [0, 0.5, 1], "seconds of the scan": [0, 0.05, 0.1],
         "seconds of a clock": [100, 100.05, 100.1], "nanoseconds": [0, 0.5e8, 1e8]}
found = {}
for unit, times in scans.items():
    for name, preprocessor in (("KISS-ICP", Kiss), ("GenZ-ICP", Genz)):
        corrected = preprocessor(100.0, 0.0, True, 1).preprocess(wall, np.array(times, float), motion)
        found[name, unit] = np.round(corrected[:, 0], 2).tolist()
        print("%s, times in %s:" % (name, unit), found[name, unit])
if any(found["KISS-ICP", unit] != [9.0, 9.5, 10.0] for unit in scans):
    sys.exit("changed: KISS-ICP corrects otherwise")
expected = {"0 .. 1": [9.5, 10.0, 10.5], "seconds of the scan": [9.5, 9.55, 9.6], "seconds of a clock": [109.5, 109.55, 109.6]}
if any(found["GenZ-ICP", unit] != answer for unit, answer in expected.items()):
    sys.exit("changed: GenZ-ICP corrects otherwise")
if found["GenZ-ICP", "nanoseconds"][2] < 1e7:
    sys.exit("changed: GenZ-ICP knows nanoseconds")
PY
