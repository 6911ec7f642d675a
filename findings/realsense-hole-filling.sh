#!/usr/bin/env bash
# pyrealsense2 2.59.1.11053: the hole-filling filter, set to take the farthest neighbour, fills a
# gap with what is on its left; set to the nearest, it fills nothing.
#
# Expected: mode 1, the default, is "farest from around": a hole between a wall at 1 m and one at 4
# m gets 4 m; mode 2, "nearest from around", gets 1 m.
# Seen: in mode 1 ten columns without depth between 1 m on the left and 4 m on the right all become
# 1 m; with the picture mirrored they become 4 m: pixels to the right do not count as "around". In
# mode 2 the hole stays, in both pictures, since a neighbour without depth is the nearest; it only
# fills single pixels.
# So: leave holes unknown for a map; the filter draws a wall from each left edge of a hole.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyrealsense2==2.59.1.11053 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import pyrealsense2 as rs

WIDTH, HEIGHT = 64, 48
device = rs.software_device()
sensor = device.add_sensor("Depth")
lens = rs.intrinsics()
lens.width, lens.height, lens.ppx, lens.ppy, lens.fx, lens.fy = WIDTH, HEIGHT, 32, 24, 50, 50
lens.model, lens.coeffs = rs.distortion.none, [0.0] * 5
stream = rs.video_stream()
stream.type, stream.index, stream.uid, stream.fmt = rs.stream.depth, 0, 1, rs.format.z16
stream.width, stream.height, stream.fps, stream.bpp, stream.intrinsics = WIDTH, HEIGHT, 30, 2, lens
profile = sensor.add_video_stream(stream)
sensor.add_read_only_option(rs.option.depth_units, 0.001)
queue = rs.frame_queue(10, keep_frames=True)
sensor.open(profile)
sensor.start(queue)
number = 0

def fill(image, mode):
    global number
    number += 1
    frame = rs.software_video_frame()
    frame.pixels, frame.stride, frame.bpp = np.ascontiguousarray(image), WIDTH * 2, 2
    frame.timestamp, frame.frame_number, frame.domain = number * 33.3, number, rs.timestamp_domain.hardware_clock
    frame.profile = profile.as_video_stream_profile()
    sensor.on_video_frame(frame)
    options = [] if mode is None else [mode]
    filled = rs.hole_filling_filter(*options).process(queue.wait_for_frame())
    return np.unique(np.asanyarray(filled.get_data())[24, 20:30]).tolist()

image = np.full((HEIGHT, WIDTH), 4000, np.uint16)
image[:, :20], image[:, 20:30] = 1000, 0
mirrored = np.full((HEIGHT, WIDTH), 1000, np.uint16)
mirrored[:, :20], mirrored[:, 20:30] = 4000, 0
found = {mode: (fill(image, mode), fill(mirrored, mode)) for mode in (None, 1, 2)}
for mode, (plain, mirror) in found.items():
    print(f"mode {mode or 'by default'}: hole between 1 m (left) and 4 m: {plain} mm, mirrored: {mirror} mm")
side = [1000], [4000]
if found != {None: side, 1: side, 2: ([0], [0])}:
    sys.exit("changed: holes are filled by %s" % found)
PY
