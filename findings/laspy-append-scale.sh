#!/usr/bin/env bash
# laspy 2.7.0: a point at 7 m, appended to a LAS file, is read back at 70 m.
#
# Expected: `append_points` takes a scale-aware record, so that metres stay metres; `write_points`
# of the same library rescales a record whose scale differs from the file's.
# Seen: the stored integers are copied and then read with the scale of the file (0.001 against
# 0.01: ten times as far away). No error; the header's bounds follow the wrong value.
# So: compare the scales and offsets of both headers before appending and call `change_scaling`; a
# reader that sees one region of a file ten or a hundred times too far away may look at appending.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check laspy==2.7.0
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import laspy
import numpy as np

def cloud(scale, metres):
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales = np.full(3, scale)
    las = laspy.LasData(header)
    las.x = las.y = las.z = np.array(metres)
    return las

path = sys.argv[1] + "/a.las"
new = cloud(0.001, [7.0])
cloud(0.01, [1.0, 2.0]).write(path)
with laspy.open(path, mode="a") as file:
    file.append_points(new.points)
appended = laspy.read(path)
print("appended:", np.array(appended.x).tolist(), "header says up to", appended.header.maxs[0])
with laspy.open(path, mode="w", header=cloud(0.01, [1.0]).header) as file:
    file.write_points(new.points)
written = laspy.read(path)
print("written: ", np.array(written.x).tolist())
if written.x[0] != 7.0:
    sys.exit("changed: write_points does not rescale")
if appended.x[-1] != 70.0:
    sys.exit("changed: append_points gives %s" % appended.x[-1])
PY
