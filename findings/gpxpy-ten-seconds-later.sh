#!/usr/bin/env bash
# gpxpy 1.6.2: the place of a track at 1 s is that at 10 s, and so is the time of it.
#
# Expected: `get_location_at(time)` of a track with points at 0, 10 and 20 s is between its
# neighbours, or the nearest.
# Seen: it is the next point, with the next point's time, however far away: at 1 s the robot is
# where it was at 10 s, at 11 s where it was at 20 s. Before the start and after the end there is
# none. It comes as a list, since several tracks may have one.
# So: interpolate yourself between the two points around the time; aligning images or scans by this
# call shifts them by up to one period, half a period on average, always forwards.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check gpxpy==1.6.2
"$dir/venv/bin/python" - <<'PY'
import sys
from datetime import datetime, timedelta, timezone
import gpxpy

start = datetime(2024, 1, 1, tzinfo=timezone.utc)
points = "".join(f'<trkpt lat="48" lon="{11 + i / 1000}"><time>2024-01-01T00:00:{10 * i:02d}Z</time></trkpt>' for i in range(3))
track = gpxpy.parse(f'<gpx version="1.1" creator="t"><trk><trkseg>{points}</trkseg></trk></gpx>').tracks[0]
found = {}
for seconds in (-1, 0, 1, 9, 10, 11, 21):
    places = track.get_location_at(start + timedelta(seconds=seconds)) or []
    found[seconds] = [((place.time - start).seconds, round(place.longitude, 3)) for place in places]
    print(f"at {seconds} s: seconds and longitude {found[seconds]}")
if found != {-1: [], 0: [(0, 11.0)], 1: [(10, 11.001)], 9: [(10, 11.001)], 10: [(10, 11.001)], 11: [(20, 11.002)], 21: []}:
    sys.exit("changed: %s" % found)
PY
