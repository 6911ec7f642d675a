#!/usr/bin/env bash
# laspy 2.7.0: converting point format 3 to 6 loses the scan angles and keeps a class that no
# longer exists.
#
# Expected: LAS 1.4 renames `scan_angle_rank` (degrees) to `scan_angle` (0.006 degrees) and turns
# class 12, overlap, of formats 0 to 5 into a flag of formats 6 to 10 where 12 is reserved; a
# converter carries both over, or says that it does not.
# Seen: all scan angles are 0, class 12 stays 12 and the overlap flag stays 0. No warning. The way
# back loses an overlap flag just as silently.
# So: after `laspy.convert` set scan_angle and overlap yourself; a reader of format 6 and above
# takes class 12 for overlap, although the standard has no such class there.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check laspy==2.7.0
"$dir/venv/bin/python" - <<'PY'
import sys
import laspy
import numpy as np

old = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
old.x = old.y = old.z = np.zeros(3)
old.classification = np.array([2, 12, 7])
old.scan_angle_rank = np.array([-10, 15, 90])
new = laspy.convert(old, point_format_id=6)
found = {name: np.array(new[name]).tolist() for name in ("classification", "overlap", "scan_angle")}
print("format 3: classes [2, 12, 7], angles [-10, 15, 90] degrees")
print("format 6:", found)
new.overlap = np.array([0, 1, 0])
new.classification = np.array([2, 1, 7])
back = laspy.convert(new, point_format_id=3, file_version="1.2")
print("and back: classes", np.array(back.classification).tolist())
if found["scan_angle"] != [0, 0, 0]:
    sys.exit("changed: scan angles are converted")
if found["classification"] != [2, 12, 7] or found["overlap"] != [0, 0, 0]:
    sys.exit("changed: class 12 becomes an overlap flag")
if np.array(back.classification).tolist() != [2, 1, 7]:
    sys.exit("changed: an overlap flag becomes class 12")
PY
