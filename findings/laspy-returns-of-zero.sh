#!/usr/bin/env bash
# laspy 2.7.0: points that it creates are return 0 of 0, which no LiDAR has.
#
# Expected: LAS numbers returns from 1; a file made of coordinates alone has single returns, 1 of 1,
# and the header counts them under return 1.
# Seen: return number and number of returns are 0, and the header's fifteen counts are 0 beside a
# point count of 4. Filters disagree: "first returns" (== 1) keeps none, "last returns" (number ==
# count) keeps all, "single returns" (count == 1) none.
# So: set return_number and number_of_returns to 1 when writing clouds of other origin; a reader
# that filters by returns should treat 0 of 0 as 1 of 1.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check laspy==2.7.0
"$dir/venv/bin/python" - <<'PY'
import io
import sys
import laspy
import numpy as np

found = {}
for point_format, version in ((3, "1.2"), (6, "1.4")):
    cloud = laspy.LasData(laspy.LasHeader(point_format=point_format, version=version))
    cloud.x = cloud.y = cloud.z = np.arange(4.0)
    file = io.BytesIO()
    cloud.write(file)
    file.seek(0)
    read = laspy.read(file)
    number, count = np.array(read.return_number), np.array(read.number_of_returns)
    found[point_format] = {"points": read.header.point_count,
                           "counted by return": int(np.sum(read.header.number_of_points_by_return)),
                           "first": int((number == 1).sum()), "last": int((number == count).sum()),
                           "single": int((count == 1).sum())}
    print(f"format {point_format}:", found[point_format])
if any(f != {"points": 4, "counted by return": 0, "first": 0, "last": 4, "single": 0} for f in found.values()):
    sys.exit("changed: it is %s" % found)
PY
