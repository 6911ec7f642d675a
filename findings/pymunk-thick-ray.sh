#!/usr/bin/env bash
# pymunk 7.3.1: a ray with a radius of 0.5 m misses a box that it touches, as soon as there is a
# second box anywhere.
#
# Expected: `space.segment_query_first(start, end, radius)` is a robot of that radius driving along
# the line: it is stopped by all that is nearer than the radius, as `shape.segment_query` says.
# Seen: the space first picks the shapes whose bounding boxes the thin line crosses, and only those
# are tested with the radius. A box and a circle that reach to y = 1 stop the ray at y = 1.0 and
# are not there at y = 1.01, 1.2 and 1.4, where the shapes themselves, asked, stop it. If the shape
# is the only one in the space it is tested in any case, so that a first trial looks right.
# So: for clearance query each shape near the line (`space.bb_query` with a box that is larger by
# the radius), or grow the obstacles instead of the ray.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pymunk==7.3.1
"$dir/venv/bin/python" - <<'PY'
import sys
import pymunk

def stopped(make, y, others):
    space = pymunk.Space()
    shape = make(space.static_body)
    space.add(shape, *(pymunk.Circle(space.static_body, 1, (5, 100)) for _ in range(others)))
    by_space = space.segment_query_first((0, y), (10, y), 0.5, pymunk.ShapeFilter())
    by_shape = shape.segment_query((0, y), (10, y), 0.5)
    return [hit and round(10 * hit.alpha, 2) for hit in (by_space, by_shape)]

found = {}
for name, make in (("box", lambda body: pymunk.Poly(body, [(4, -1), (6, -1), (6, 1), (4, 1)])),
                   ("circle", lambda body: pymunk.Circle(body, 1, (5, 0)))):
    for y in (0, 1, 1.01, 1.2, 1.4):
        alone, by_shape = stopped(make, y, 0)
        found[name, y] = alone, stopped(make, y, 1)[0], by_shape
        print(f"{name}, ray at y = {y}: stopped in its space alone at {alone}, with another at {found[name, y][1]}, by the shape at {by_shape}")
if any(by_shape is None or alone != by_shape or two != (by_shape if y <= 1 else None) for (_, y), (alone, two, by_shape) in found.items()):
    sys.exit("changed: %s" % found)
PY
