#!/usr/bin/env bash
# ezdxf 1.4.5: a track of x, y, z becomes a flat line of varying width.
#
# Expected: `add_lwpolyline(points)` takes three numbers per point as x, y, z, as `add_polyline3d`,
# `add_line` and `add_spline` of the same library do, or refuses them.
# Seen: its format is "xyseb": the third number is the width of the line at the start of the
# segment, the fourth at its end, the fifth a bulge. A track from 5 m to 9 m of height lies at z = 0
# and is drawn 5 to 9 m wide; a fifth number, say a speed of 1 m/s, is a bulge: a straight line of
# 20 m is two half circles. Nothing is said, and the file is valid.
# So: `add_polyline3d` for tracks; for floor plans `format="xy"` with the height in
# `dxfattribs={"elevation": z}`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ezdxf==1.4.5
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import ezdxf
from ezdxf.path import make_path

track = [(0, 0, 5), (10, 0, 7), (10, 10, 9)]
drawing = ezdxf.new()
space = drawing.modelspace()
space.add_lwpolyline(track)
space.add_polyline3d(track)
space.add_lwpolyline([(0, 0, 0, 0, 0), (10, 0, 0, 1, 1), (20, 0, 0, 2, 2)])
drawing.saveas(sys.argv[1] + "/track.dxf")
light, spatial, timed = ezdxf.readfile(sys.argv[1] + "/track.dxf").modelspace()
heights = [point.z for point in light.vertices_in_wcs()]
widths = [float(point[2]) for point in light.get_points("xys")]
print("add_lwpolyline: heights", heights, "widths", widths)
spatial_heights = [vertex.dxf.location.z for vertex in spatial.vertices]
print("add_polyline3d: heights", spatial_heights)
beside = max(abs(point.y) for point in make_path(timed).flattening(0.01))
print("a straight line of 20 m with two more numbers per point is up to %.1f m beside itself" % beside)
if heights != [0, 0, 0] or widths != [5, 7, 9] or spatial_heights != [5, 7, 9] or not 4.9 < beside < 5.1:
    sys.exit("changed: %s %s %s %s" % (heights, widths, spatial_heights, beside))
PY
