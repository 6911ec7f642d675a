#!/usr/bin/env bash
# node-mavlink 2.3.0 (npm): a lidar that measured two sectors reports obstacles that touch the
# vehicle in the other seventy.
#
# Expected: OBSTACLE_DISTANCE has 72 distances; a list of two is refused, or filled with UINT16_MAX,
# which common.xml defines as unknown. The fields of a new message are values of the protocol.
# Seen: the list is filled with zeros without a word, and 0 "means that the obstacle is practically
# touching the sensor". A new message has no distances at all and is sent as 72 zeros; its
# enumerations hold words ('LASER', 'GLOBAL') before it is sent and numbers afterwards.
# So: fill the list to 72 with 65535 yourself; the same holds for BATTERY_STATUS, in which a cell
# that does not exist is then one with 0 V.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund node-mavlink@2.3.0 mavlink-mappings@1.0.21-20250824-1 >/dev/null
cat > send.mjs <<'JS'
import {Readable} from 'node:stream';
import mavlink from 'node-mavlink';
import mappings from 'mavlink-mappings';
const {MavLinkPacketParser, MavLinkPacketSplitter, MavLinkProtocolV2} = mavlink;
const {ObstacleDistance, BatteryStatus} = mappings.common;
async function received(message) {
  const bytes = new MavLinkProtocolV2().serialize(message, 1);
  const packets = Readable.from([bytes]).pipe(new MavLinkPacketSplitter()).pipe(new MavLinkPacketParser());
  for await (const packet of packets) return packet.protocol.data(packet.payload, message.constructor);
}
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
const scan = new ObstacleDistance(), battery = new BatteryStatus();
const words = [scan.sensorType, scan.frame];
scan.distances = [100, 200];
scan.maxDistance = 3000;
battery.voltages = [4200, 4100];
const {distances, sensorType, frame} = await received(scan);
const {voltages} = await received(battery);
const zeros = distances.filter((distance) => distance === 0).length;
console.log('distances:', distances.slice(0, 4).join(' '), '...:', zeros, 'of', distances.length, 'are 0 cm');
console.log('a new message has', words.join(' and '), '- received:', sensorType, 'and', frame);
console.log('voltages:', voltages.join(' '));
if (distances.length !== 72 || zeros !== 70) changed(zeros + ' distances are 0');
if (voltages.join(' ') !== '4200 4100 0 0 0 0 0 0 0 0') changed('voltages are ' + voltages);
if (words.join() !== 'LASER,GLOBAL' || sensorType !== 0 || frame !== 0) changed('enumerations are ' + words);
JS
node send.mjs
