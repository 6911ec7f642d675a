#!/usr/bin/env bash
# gps 0.9.0 (GPS.js) on a recorded log: the state's time jumps between the day of the log and today,
# and a position that its receiver calls void is the position.
#
# Expected: `state.time` of a log of 23 March 1994 stays on that day: RMC carries the date, GGA and
# GLL that follow carry the time of it. NMEA 0183's status V in RMC means that the data are not
# valid.
# Seen: GGA and GLL are given the date of the computer, so between two sentences of one second the
# clock jumps by decades and back. After RMC with status V `state.lat` and `state.speed` are those
# of the void sentence, and the state has no field that says so.
# So: for a replayed log take the times of RMC and ZDA only, or carry the date over by hand; look at
# `data.status` before using the state.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund gps@0.9.0 >/dev/null
cat > log.js <<'JS'
const GPS = require('gps');
const sentence = (body) => {
  const sum = [...body].reduce((value, letter) => value ^ letter.charCodeAt(0), 0);
  return `$${body}*${sum.toString(16).toUpperCase().padStart(2, '0')}`;
};
const receiver = new GPS();
const days = ['GPRMC,120001.00,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W',
  'GPGGA,120001.00,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,',
  'GPGLL,4807.038,N,01131.000,E,120001.00,A,A',
  'GPRMC,120002.00,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W'].map((body) => {
  receiver.update(sentence(body));
  return receiver.state.time.toISOString().slice(0, 10);
});
const other = new GPS();
other.update(sentence('GPRMC,120001.00,V,4907.038,N,01131.000,E,022.4,084.4,230394,003.1,W'));
const {lat, speed} = other.state;
const told = JSON.stringify(other.state).includes('void');
console.log('days of RMC, GGA, GLL, RMC:', days.join(' '), '| errors:', receiver.state.errors);
console.log('after a void sentence: lat', lat, 'speed', speed, 'said in the state:', told);
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
const today = new Date().toISOString().slice(0, 4);
if (days[0] !== '1994-03-23' || days[3] !== days[0]) changed('RMC is of ' + days[0]);
if (days[1].slice(0, 4) !== today || days[2].slice(0, 4) !== today) changed('GGA and GLL are of ' + days.slice(1, 3));
if (Math.abs(lat - 49.1173) > 1e-6 || !(speed > 41) || told) changed(`void gives ${lat}, ${speed}, ${told}`);
JS
node log.js
