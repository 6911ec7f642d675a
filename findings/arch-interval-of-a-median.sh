#!/usr/bin/env bash
# arch 8.0.0: the bootstrap's interval of the median of six positive times is negative, by default.
#
# Expected: `IIDBootstrap(times).conf_int(np.median)` encloses the median, within what was measured.
# Seen: for times of 0.01 to 2 s, median 0.025, it is -0.98 to 0.04: the default method, "basic",
# mirrors the percentiles at the estimate, so a long tail to the right becomes one to the left.
# "percentile" and "bca" stay within the data. (SciPy's default is BCa.)
# So: name the method, `method="bca"`, for times, distances, ratios and all else with a tail or a
# bound.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check arch==8.0.0 numpy==2.4.6
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import numpy as np
from arch.bootstrap import IIDBootstrap

times = np.array([0.01, 0.02, 0.02, 0.03, 0.05, 2.0])
found = {}
for method in (None, "basic", "percentile", "bca"):
    options = {"method": method} if method else {}
    found[method] = IIDBootstrap(times, seed=1).conf_int(np.median, 2000, **options).ravel().round(3).tolist()
    print(f"{method or 'by default'}: {found[method]}, the median is {np.median(times)}")
if found[None] != found["basic"] or found[None][0] > -0.5 or min(found["percentile"][0], found["bca"][0]) < 0.01:
    sys.exit("changed: intervals are %s" % found)
PY
