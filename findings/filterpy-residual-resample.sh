#!/usr/bin/env bash
# filterpy 2.0.0: residual_resample never draws the particles whose weight is below 1 / N.
#
# Expected: residual resampling (Liu and Chen 1998) keeps floor(N w) copies of each particle and draws
# the rest by the fractions N w - floor(N w), so that each is kept N w times on average, as the two
# other methods of the module do.
# Seen: it draws the rest by w - floor(N w), normalised: negative where copies were kept. Of weights
# 0.35, 0.05, 0.55 and 0.05 the two small ones, 0.2 copies each on average, are never kept, and the
# third is kept 2.7 times instead of 2.2. A filter loses its unlikely hypotheses at the first step.
# So: use systematic_resample or stratified_resample, whose means are N w.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check filterpy==2.0.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from filterpy.monte_carlo import residual_resample, stratified_resample, systematic_resample

weights = np.array([0.35, 0.05, 0.55, 0.05])
np.random.seed(1)
means = {}
for resample in (residual_resample, stratified_resample, systematic_resample):
    kept = sum(np.bincount(resample(weights), minlength=4) for _ in range(5000))
    means[resample.__name__] = kept / 5000
    print(f"{resample.__name__}: copies {np.round(means[resample.__name__], 2)}, expected {4 * weights}")
wrong = means.pop("residual_resample")
if wrong[1] != 0 or wrong[3] != 0 or abs(wrong[2] - 2.7) > 0.05:
    sys.exit(f"changed: residual_resample keeps {wrong}")
if any(np.abs(mean - 4 * weights).max() > 0.05 for mean in means.values()):
    sys.exit(f"changed: the others keep {means}")
PY
