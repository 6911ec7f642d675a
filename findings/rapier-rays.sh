#!/usr/bin/env bash
# @dimforge/rapier3d-compat 0.21.0 (npm): rays are stopped by sensor volumes, and see the walls of
# the last step.
#
# Expected: a sensor, which has no contacts and is there to notice who passes, is no obstacle to a
# ray of a laser; a wall that was created, disabled or enabled is there, or is not, at once.
# Seen: a ray hits the sensor at 1 m and not the wall behind it at 4 m. A wall that was just made or
# enabled is not seen until `step()`, one that was just disabled still is. A wall at exactly the
# maximum distance is missed.
# So: pass `QueryFilterFlags.EXCLUDE_SENSORS`, and cast rays after the step that follows a change:
# after loading a map, after a door opened.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts @dimforge/rapier3d-compat@0.21.0 >/dev/null
cat > rays.mjs <<'JS'
import RAPIER from '@dimforge/rapier3d-compat';
await RAPIER.init();
const {ColliderDesc, QueryFilterFlags, Ray, World} = RAPIER;
const world = new World({x: 0, y: 0, z: 0});
const ray = new Ray({x: 0, y: 0, z: 0}, {x: 1, y: 0, z: 0});
const range = (flags, max = 100) => world.castRay(ray, max, true, flags)?.timeOfImpact ?? null;
const found = {};
const wall = world.createCollider(ColliderDesc.cuboid(1, 1, 1).setTranslation(5, 0, 0));
found['new wall at 4 m, before the step'] = range();
world.step();
found['after it'] = range();
found['with a maximum of 4 m'] = range(undefined, 4);
world.createCollider(ColliderDesc.cuboid(1, 1, 1).setTranslation(2, 0, 0).setSensor(true));
world.step();
found['sensor at 1 m before it'] = range();
found['sensors excluded'] = range(QueryFilterFlags.EXCLUDE_SENSORS);
wall.setEnabled(false);
found['wall disabled, before the step'] = range(QueryFilterFlags.EXCLUDE_SENSORS);
world.step();
found['disabled, after it'] = range(QueryFilterFlags.EXCLUDE_SENSORS);
wall.setEnabled(true);
found['enabled, before the step'] = range(QueryFilterFlags.EXCLUDE_SENSORS);
world.step();
found['enabled, after it'] = range(QueryFilterFlags.EXCLUDE_SENSORS);
console.log(found);
if (JSON.stringify(Object.values(found)) !== '[null,4,null,1,4,4,null,null,4]') {
  console.error('changed: ranges are ' + JSON.stringify(found));
  process.exit(1);
}
JS
node rays.mjs 2>"$dir/log"
