#!/usr/bin/env bash
# lifelines 0.30.3 and statsmodels 0.15.0: the median of n complete times jumps with n, because
# half is sometimes 0.5000000000000001.
#
# Expected: of the times 1 .. n (n even, none censored) half is left after n / 2, exactly; the
# median is n / 2 (lifelines: first time at which at most half is left), or n / 2 + 1 (statsmodels:
# less than half), or the middle between (R's survival, by a tolerance), by one rule for all n.
# Seen: the product is rounded: lifelines says n / 2 for n = 4, 10, 12, and n / 2 + 1 for n = 6, 8,
# 14, 18, 20; statsmodels goes its other way for n = 12 and 18. The difference is a whole time
# step.
# So: with few runs and no censoring take the median of the numbers; a median survival time out of
# a table is good to one step of the data, and two libraries need not agree on it.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check lifelines==0.30.3 statsmodels==0.15.0 scipy==1.17.1 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from lifelines import KaplanMeierFitter
from statsmodels.duration.survfunc import SurvfuncRight

found = {}
for n in range(4, 22, 2):
    times = np.arange(1.0, n + 1)
    fit, other = KaplanMeierFitter().fit(times), SurvfuncRight(times, np.ones(n))
    found[n] = (fit.median_survival_time_ - n / 2, other.quantile(0.5) - n / 2)
    print(f"n = {n}: n/2 is {n // 2}, lifelines {fit.median_survival_time_:g}, statsmodels {other.quantile(0.5):g},",
          "left after n/2 by lifelines:", repr(float(fit.survival_function_.loc[n / 2].iloc[0])))
if {a for a, _ in found.values()} != {0.0, 1.0}:
    sys.exit("changed: lifelines is consistent")
if {b for _, b in found.values()} != {0.0, 1.0}:
    sys.exit("changed: statsmodels is consistent")
PY
