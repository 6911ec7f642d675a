#!/usr/bin/env bash
# pyopenvdb 10.0.1 (Debian 12): a voxel grid from a transposed array has its walls elsewhere.
#
# Expected: `copyFromArray` puts the element [i, j, k] of a numpy array at (i, j, k), for each array
# of three dimensions; how it lies in memory is numpy's affair.
# Seen: the memory is read as if it were in C order. Of a map kept as [z, y, x] and handed over as
# `map.transpose(2, 1, 0)`, or kept in Fortran order as MATLAB files are, the one wall of cell
# (1, 2, 1) is found at (0, 2, 3) and (3, 1, 1); the shape is right, so nothing looks wrong from
# outside. `copyToArray` into such an array fills other elements as well.
# So: hand over `numpy.ascontiguousarray(array)`, always; a test needs three different side lengths
# and one cell off the diagonal.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" python3-openvdb=10.0.1-2 >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack PYTHONPATH=$dir/root/usr/lib/python3/dist-packages
/usr/bin/python3 - <<'PY'
import sys
import numpy as np
import pyopenvdb as vdb

def wall(array):
    grid = vdb.FloatGrid()
    grid.copyFromArray(array)
    return [tuple(item.min) for item in grid.citerOnValues()]

array = np.zeros((4, 3, 2), np.float32)
array[1, 2, 1] = 1
turned = np.zeros((4, 3, 2), np.float32)
turned[1, 2, 1] = 1
found = {"C order": wall(array), "Fortran order": wall(np.asfortranarray(array)),
         "transposed": wall(turned.transpose(2, 1, 0)), "transposed, copied": wall(np.ascontiguousarray(turned.transpose(2, 1, 0)))}
print("numpy says:", np.argwhere(array).tolist(), "and, transposed,", np.argwhere(turned.transpose(2, 1, 0)).tolist())
for name, cells in found.items():
    print(f"{name}: {cells}")
grid = vdb.FloatGrid()
grid.copyFromArray(array)
back = np.zeros((4, 3, 2), np.float32, order="F")
grid.copyToArray(back)
print("copied back into Fortran order:", np.argwhere(back).tolist())
if found["C order"] != [(1, 2, 1)] or found["transposed, copied"] != [(1, 2, 1)]:
    sys.exit("changed: contiguous arrays give %s" % found)
if found["Fortran order"] != [(3, 1, 1)] or found["transposed"] != [(0, 2, 3)]:
    sys.exit("changed: %s" % found)
if np.argwhere(back).tolist() == [[1, 2, 1]]:
    sys.exit("changed: copying back is right")
PY
