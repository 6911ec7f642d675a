#!/usr/bin/env bash
# cannon-es 0.20.0 (npm): a ray goes through a wall that stops a ball, if the wall got its shape in
# the constructor and its place afterwards.
#
# Expected: `new Body({mass: 0, shape})` and `body.position.set(5, 10, 0)`, the two lines of most
# examples, make a wall for bodies and for rays alike.
# Seen: the box that rays are tested with is computed in the constructor, at the origin, and a body
# that never moves does not compute it again, not in a hundred steps either: a ray at the wall's
# middle finds nothing, while a ball bounces off it. With `position` in the constructor, or the
# shape added by `addShape`, the ray finds the wall at 4 m.
# So: give `position` to the constructor, or call `body.updateAABB()` after each change of place of
# a body without mass; a LiDAR that is simulated with such rays sees a robot and not the walls.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts cannon-es@0.20.0 >/dev/null
cat > rays.cjs <<'JS'
const {Body, Box, RaycastResult, Sphere, Vec3, World} = require('cannon-es');
const box = () => new Box(new Vec3(1, 1, 1));
const walls = {
  'shape, then position.set': () => { const body = new Body({mass: 0, shape: box()}); body.position.set(5, 10, 0); return body; },
  'the same and updateAABB': () => { const body = walls['shape, then position.set'](); body.updateAABB(); return body; },
  'shape and position': () => new Body({mass: 0, shape: box(), position: new Vec3(5, 10, 0)}),
  'addShape, position.set': () => { const body = new Body({mass: 0}); body.addShape(box()); body.position.set(5, 10, 0); return body; },
};
const found = {};
for (const [name, wall] of Object.entries(walls)) {
  const world = new World();
  world.addBody(wall());
  const ball = new Body({mass: 1, shape: new Sphere(0.2), position: new Vec3(0, 10.5, 0)});
  world.addBody(ball);
  ball.velocity.set(5, 0, 0);
  let farthest = 0;
  for (let step = 0; step < 120; step++) {
    world.step(1 / 60);
    farthest = Math.max(farthest, ball.position.x);
  }
  const hit = new RaycastResult();
  world.raycastClosest(new Vec3(0, 9.5, 0), new Vec3(20, 9.5, 0), {}, hit);
  found[name] = hit.hasHit ? hit.distance : null;
  console.log(`${name}: the ray hits at ${found[name]}, the ball comes to x = ${farthest.toFixed(1)} of 10`);
  if (farthest > 4) throw new Error('changed: the ball is not stopped');
}
if (JSON.stringify(Object.values(found)) !== '[null,4,4,4]') throw new Error('changed: rays give ' + JSON.stringify(found));
JS
node rays.cjs
