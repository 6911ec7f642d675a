#!/usr/bin/env bash
# squaternion 2025.3.2: angles of a drone that points straight up are read back as another attitude.
#
# Expected: at a pitch of 90 degrees roll and yaw are not unique, but each answer of `to_euler`
# gives, through `from_euler`, the rotation that was asked about.
# Seen: (0, 90, 30) comes back as (0, 90, 90), 60 degrees off, and (0, 90, 60) as (0, 90, 26.57):
# the yaw is the angle between two rounding errors. At 89.9 degrees it is right.
# So: keep attitudes as quaternions; a round trip through angles is tested at the pole by comparing
# rotations, not angles.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check squaternion==2025.3.2
"$dir/venv/bin/python" - <<'PY'
import math
import sys
from squaternion import Quaternion

def there_and_back(pitch, yaw):
    q = Quaternion.from_euler(0, pitch, yaw, degrees=True)
    angles = q.to_euler(degrees=True)
    p = Quaternion.from_euler(*angles, degrees=True)
    dot = abs(q.w * p.w + q.x * p.x + q.y * p.y + q.z * p.z)
    off = math.degrees(2 * math.acos(min(1.0, dot)))
    print(f"(0, {pitch}, {yaw}) -> {tuple(round(a, 2) for a in angles)}: {off:.1f} degrees off")
    return off

up = [there_and_back(90, yaw) for yaw in (30, 60, -45)]
nearly = [there_and_back(89.9, yaw) for yaw in (30, 60, -45)]
if max(up) < 10 or max(nearly) > 0.1:
    sys.exit("changed: straight up it is %s off, nearly so %s" % (up, nearly))
PY
