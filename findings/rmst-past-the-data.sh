#!/usr/bin/env bash
# lifelines 0.30.3: a restricted mean may be longer than anything was watched.
#
# Expected: the restricted mean up to t is defined as far as the data go; past the last observation
# R's survRM2 refuses, as scikit-survival 0.28.0 does for the survival itself.
# Seen: the last step of the curve is prolonged for ever: five runs watched for 30 s have a
# restricted mean of 17 s at 30, 405 s at 1000, and `inf` at infinity, without a warning;
# `predict(1000)` is 0.4.
# So: two controllers of different watched times must be compared at the smaller one, and the
# library does not say when t is beyond; take t = min over groups of the largest time.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check lifelines==0.30.3 scikit-survival==0.28.0 scipy==1.17.1
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings
import numpy as np
from lifelines import KaplanMeierFitter
from lifelines.utils import restricted_mean_survival_time
from sksurv.nonparametric import SurvivalFunctionEstimator
from sksurv.util import Surv

times, events = np.array([5.0, 8, 12, 20, 30]), np.array([1, 1, 1, 0, 0])
fit = KaplanMeierFitter().fit(times, events)
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    means = {t: round(float(restricted_mean_survival_time(fit, t=t)), 6) for t in (30, 1000, np.inf)}
    later = float(fit.predict(1000))
spoken = [str(w.message) for w in caught]
try:
    SurvivalFunctionEstimator().fit(Surv.from_arrays(events.astype(bool), times)).predict_proba([31.0])
    other = "an answer"
except ValueError as error:
    other = str(error)
print("restricted means:", means, "| survival at 1000:", later, "| warnings:", spoken)
print("scikit-survival at 31:", other)
if means != {30: 17.0, 1000: 405.0, np.inf: np.inf} or later != 0.4 or spoken:
    sys.exit("changed: means are %s, survival %s, warnings %s" % (means, later, spoken))
if "smaller" not in other:
    sys.exit("changed: scikit-survival gives %s" % other)
PY
