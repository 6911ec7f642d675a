#!/usr/bin/env bash
# laspy 2.7.0: the declared minimum and maximum of an extra dimension are both its first value.
#
# Expected: in the Extra Bytes record of LAS 1.4 `min` and `max`, with their bits in `options`,
# bound the dimension; a viewer takes its colour scale from them, a reader skips files by them.
# Seen: for 2, -5, 9, 1 the file says minimum 2 and maximum 2, and that both are valid. Written in
# chunks they are the first values of the chunks: 1, 2 | 10, -3 gives 1 and 10. The values
# themselves are right.
# So: do not trust the range of dimensions in files of this library; compute it, or correct the
# record (`header.vlrs`) after writing.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check laspy==2.7.0
"$dir/venv/bin/python" - <<'PY'
import io
import struct
import sys
import laspy
import numpy as np

def written(*chunks):
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.add_extra_dim(laspy.ExtraBytesParams("temperature", "float64"))
    file = io.BytesIO()
    with laspy.open(file, mode="w", header=header, closefd=False) as writer:
        for values in chunks:
            points = laspy.ScaleAwarePointRecord.zeros(len(values), header=header)
            points["temperature"][:] = values
            writer.write_points(points)
    data = file.getvalue()
    record = data.index(b"temperature") - 4
    options = data[record + 3]
    low, high = struct.unpack_from("<d", data, record + 64)[0], struct.unpack_from("<d", data, record + 88)[0]
    file.seek(0)
    read = np.array(laspy.read(file).temperature).tolist()
    print(f"values {read}: options {options:#05b}, minimum {low}, maximum {high}")
    assert read == [value for chunk in chunks for value in chunk]
    return options & 6, low, high

one, two = written([2.0, -5.0, 9.0, 1.0]), written([1.0, 2.0], [10.0, -3.0])
if one != (6, 2.0, 2.0) or two != (6, 1.0, 10.0):
    sys.exit("changed: declared are %s and %s" % (one, two))
PY
