#!/usr/bin/env bash
# pynmeagps 1.1.8: a position just below 48 degrees is written as 47 degrees and 60 minutes.
#
# Expected: the minutes of a latitude in NMEA 0183 run from 00.00000 to 59.99999; rounding carries
# into the degrees.
# Seen: 47.999999999 degrees become "4760.00000". pynmeagps itself reads that as 48; a receiver that
# checks the range drops the sentence, one that splits the digits as text does not. With one digit
# less (47.99999) it is well, so that only positions within 1 cm of a whole degree fall.
# So: round positions to seven digits of a degree before making sentences in a simulator, and start
# it away from the corner of a grid of degrees.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pynmeagps==1.1.8
"$dir/venv/bin/python" - <<'PY'
import sys
from pynmeagps import NMEAMessage, NMEAReader

def written(latitude, longitude):
    sentence = NMEAMessage("GP", "GGA", 0, lat=latitude, lon=longitude, quality=1).serialize()
    fields = sentence.decode().split(",")
    return fields[2], fields[4], NMEAReader.parse(sentence).lat

found = {place: written(*place) for place in ((47.99999, 8.5), (47.999999999, 8.999999999), (-33.999999999, 8.5))}
for place, (latitude, longitude, read) in found.items():
    print(f"{place}: {latitude} {longitude} | read again: {read}")
if [value[:2] for value in found.values()] != [("4759.99940", "00830.00000"), ("4760.00000", "00860.00000"), ("3360.00000", "00830.00000")]:
    sys.exit("changed: sentences have %s" % found)
PY
