#!/usr/bin/env bash
# PGM maps with a maximum below 255: Pillow 13.0.0 and OpenCV 5.0.0.93 see different maps, and
# OpenCV two of one, by whether the file is binary.
#
# Expected: `P5` and `P2` are the same picture, binary and as text, and the maximum in the header
# says what white is; 0, 50, 100 of 100 is black, grey and white in both.
# Seen: Pillow scales to 0, 128, 255. OpenCV scales the text file to 0, 127, 255 and leaves the
# binary one at 0, 50, 100. With a maximum of 254, the free value that nav2's maps use, Pillow
# turns 205 and 254 into 206 and 255. With 1000, OpenCV's grey is 0, 1, 3.
# So: with the usual thresholds white of a binary map of maximum 100 is unknown, not free, in a
# tool on OpenCV (occupancy 155 / 255 = 0.61). Write 255, and divide by the header's maximum when
# reading.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pillow==13.0.0 opencv-python-headless==5.0.0.93
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import cv2
import numpy as np
from PIL import Image

def read(name, data):
    path = f"{sys.argv[1]}/{name}.pgm"
    open(path, "wb").write(data)
    pillow = np.asarray(Image.open(path)).ravel().tolist()
    return pillow, cv2.imread(path, cv2.IMREAD_GRAYSCALE).ravel().tolist()

found = {
    "binary of 100": read("a", b"P5\n3 1\n100\n" + bytes([0, 50, 100])),
    "text of 100": read("b", b"P2\n3 1\n100\n0 50 100\n"),
    "binary of 254": read("c", b"P5\n3 1\n254\n" + bytes([0, 205, 254])),
    "binary of 1000": read("d", b"P5\n3 1\n1000\n" + np.array([0, 500, 1000], ">u2").tobytes()),
}
for name, (pillow, opencv) in found.items():
    print(f"{name}: Pillow {pillow} OpenCV {opencv}")
if found != {
    "binary of 100": ([0, 128, 255], [0, 50, 100]),
    "text of 100": ([0, 128, 255], [0, 127, 255]),
    "binary of 254": ([0, 206, 255], [0, 205, 254]),
    "binary of 1000": ([0, 32768, 65535], [0, 1, 3]),
}:
    sys.exit("changed: pictures are %s" % found)
PY
