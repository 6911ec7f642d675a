#!/usr/bin/env bash
# perlin-noise 1.14 and vnoise 0.1.0: seed 0 is another terrain each time, "octaves" is a frequency,
# and two caves 256 m apart are the same.
#
# Expected: one seed, 0 as any other, makes one terrain; `octaves=8` adds seven layers of halved
# amplitude, as in every text on noise and in vnoise; noise does not repeat.
# Seen: perlin-noise takes `seed=0` for no seed and draws one: two objects of seed 0 differ, those
# of seed 1 do not. `octaves=8` is one layer at eight times the frequency, equal to the last digit
# to `octaves=1` at eight times the coordinates; at whole numbers (for 8: at eighths) the value is
# 0, as gradient noise is, so that `noise([i, j])` over the cells of a map is a plain. vnoise has a
# period of 256 in each direction.
# So: count seeds from 1, scale coordinates by a step that is no whole number, add layers by hand,
# and keep a world of vnoise below 256 / frequency.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check perlin-noise==1.14 vnoise==0.1.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import vnoise
from perlin_noise import PerlinNoise

one, eight = PerlinNoise(octaves=1, seed=1), PerlinNoise(octaves=8, seed=1)
places = np.random.default_rng(0).random((200, 2))
apart = max(abs(eight([x, y]) - one([8 * x, 8 * y])) for x, y in places)
spread = float(np.std([eight([x, y]) for x, y in places]))
flat = max(abs(eight([i, j])) for i in range(10) for j in range(10))
print("octaves=8 differs from octaves=1 at 8 times the place by %g, spread %.2f" % (apart, spread))
print("the largest value at whole metres: %g" % flat)
seeds = {seed: len({PerlinNoise(seed=seed)([0.3, 0.4]) for _ in range(10)}) for seed in (0, 1)}
print("different terrains of ten by seed:", seeds)
noise = vnoise.Noise(1)
x, y = 100 * places.T
step = {metres: float(np.abs(noise.noise2(x, y, grid_mode=False, octaves=4)
                             - noise.noise2(x + metres, y, grid_mode=False, octaves=4)).max()) for metres in (128, 255, 256)}
print("vnoise, largest difference to the place so many metres on:", {metres: round(value, 6) for metres, value in step.items()})
if apart != 0 or spread < 0.1 or flat != 0:
    sys.exit("changed: apart %s, flat %s" % (apart, flat))
if seeds[0] < 5 or seeds[1] != 1:
    sys.exit("changed: different terrains by seed are %s" % seeds)
if step[256] > 1e-9 or min(step[128], step[255]) < 0.1:
    sys.exit("changed: steps differ by %s" % step)
PY
