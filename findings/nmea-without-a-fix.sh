#!/usr/bin/env bash
# pynmea2 1.19.0 and nmea-simple 3.3.0 (npm): a receiver without a fix is at 0 N, 0 E.
#
# Expected: a GGA or RMC sentence whose position fields are empty (NMEA 0183: data not available)
# has no position: None, null or NaN, as gps 0.9.0 (npm) gives.
# Seen: pynmea2's `latitude` and `longitude` are 0.0, a place in the Gulf of Guinea, beside an
# `altitude` of None in the same message. nmea-simple makes 0 of all that is empty: latitude,
# longitude, altitude, speed and course.
# So: look at `gps_qual` or `status` (`fixType`, "none") before the coordinates; the first seconds
# of a log otherwise put the origin of a local frame there, 5000 km away.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv venv
venv/bin/pip install -q --no-compile --disable-pip-version-check pynmea2==1.19.0
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts nmea-simple@3.3.0 gps@0.9.0 >/dev/null
# shellcheck disable=SC2016
printf '%s\n' '$GPGGA,120000.00,,,,,0,00,99.99,,,,,,*65' '$GPRMC,120000.00,V,,,,,,,191124,,*12' > log.nmea
venv/bin/python - <<'PY'
import sys
import pynmea2

gga, rmc = (pynmea2.parse(line, check=True) for line in open("log.nmea"))
found = [(gga.latitude, gga.longitude, gga.altitude), (rmc.latitude, rmc.longitude)]
print("pynmea2:", found, "quality", gga.gps_qual, "status", rmc.status)
if found != [(0.0, 0.0, None), (0.0, 0.0)]:
    sys.exit("changed: pynmea2 gives %s" % found)
PY
cat > read.cjs <<'JS'
const lines = require('fs').readFileSync('log.nmea', 'utf8').trim().split('\n');
const {parseNmeaSentence} = require('nmea-simple');
const {GPS} = require('gps');
const [gga, rmc] = lines.map(parseNmeaSentence);
const simple = [gga.latitude, gga.longitude, gga.altitudeMeters, rmc.latitude, rmc.longitude, rmc.speedKnots, rmc.trackTrue];
const other = lines.map((line) => GPS.Parse(line)).flatMap(({lat, lon}) => [lat, lon]);
console.log('nmea-simple:', simple.join(' '), 'fix type', gga.fixType, 'status', rmc.status);
console.log('gps:', other.join(' '));
if (simple.some((value) => value !== 0)) throw new Error('changed: nmea-simple gives ' + simple);
if (other.some((value) => value !== null)) throw new Error('changed: gps gives ' + other);
JS
node read.cjs
