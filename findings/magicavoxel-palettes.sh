#!/usr/bin/env bash
# MagicaVoxel files in py-vox-io 0.1 and midvoxio 0.1.6: colours shift by one, or a legal file is
# refused.
#
# Expected: voxel value i has colour i - 1 of the RGBA chunk (the format's README), and a file
# without that chunk has the default palette; x, y, z stay x, y, z.
# Seen: py-vox-io's `to_dense_rgba` takes entry i of a palette that it read, the neighbour of the
# right one (with the default palette it is right, which has a spare first entry); its dense array
# is ordered y, downward z, x. midvoxio gives the right colours, but a file without RGBA ends in a
# numpy error.
# So: index a palette from such a file with i - 1 yourself; write RGBA always; test importers with
# a model of three different side lengths and a palette whose neighbours differ.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    py-vox-io==0.1 midvoxio==0.1.6 numpy==2.4.6 matplotlib==3.11.2
"$dir/venv/bin/python" - "$dir" <<'PY'
import struct
import sys
import numpy as np
from midvoxio.voxio import vox_to_arr
from pyvox.parser import VoxParser

def chunk(name, content, children=b""):
    return name + struct.pack("<ii", len(content), len(children)) + content + children

def file(name, *more):
    path = f"{sys.argv[1]}/{name}.vox"
    voxels = struct.pack("<iBBBB", 1, 1, 2, 3, 9)
    body = chunk(b"SIZE", struct.pack("<iii", 2, 3, 4)) + chunk(b"XYZI", voxels) + b"".join(more)
    open(path, "wb").write(b"VOX " + struct.pack("<i", 150) + chunk(b"MAIN", b"", body))
    return path

palette = chunk(b"RGBA", b"".join(bytes([i, 100, 200, 255]) for i in range(256)))  # entry 8 begins with 8
coloured, plain = file("coloured", palette), file("plain")
dense = VoxParser(coloured).parse().to_dense_rgba()
at = [int(i) for i in np.argwhere(dense[..., 3])[0]]
red = int(dense[tuple(at)][0])
right = round(float(vox_to_arr(coloured)[1, 2, 3, 0]) * 255)
try:
    vox_to_arr(plain)
    refusal = None
except ValueError as error:
    refusal = str(error)[:40]
print("voxel (1, 2, 3) of value 9, red 8: py-vox-io shape", dense.shape, "at", at, "red", red, "| midvoxio red", right)
print("midvoxio on a file without a palette:", refusal)
if (dense.shape, at, red) != ((3, 4, 2, 4), [2, 0, 1], 9):
    sys.exit("changed: py-vox-io gives %s %s %s" % (dense.shape, at, red))
if right != 8 or refusal is None:
    sys.exit("changed: midvoxio gives %s, %s" % (right, refusal))
PY
