#!/usr/bin/env bash
# The concordance of one prediction is 0.9 in lifelines 0.30.3 and 0.1 in scikit-survival 0.28.0.
#
# Expected: an index of one name, of runs' times and predicted values, is one number.
# Seen: lifelines' `concordance_index` takes larger values for longer times, scikit-survival's
# `concordance_index_censored` for higher risk; with the same two arrays they give 0.9 and 0.1. The
# order of arguments differs as well (times, values, events against events, times, values), and
# swapped arrays of 0 and 1 are accepted.
# So: below 0.5 means upside down before it means bad; hand a predicted time to the first and its
# negative to the second.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check lifelines==0.30.3 scikit-survival==0.28.0 scipy==1.17.1
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
from lifelines.utils import concordance_index
from sksurv.metrics import concordance_index_censored

times, events = np.array([10.0, 20, 30, 40, 50]), np.ones(5, bool)
predicted = np.array([12.0, 18, 35, 33, 60])
first = round(float(concordance_index(times, predicted, events)), 3)
second = round(float(concordance_index_censored(events, times, predicted)[0]), 3)
negated = round(float(concordance_index_censored(events, times, -predicted)[0]), 3)
swapped = float(concordance_index(times, events.astype(float), predicted))
print("lifelines:", first, "| scikit-survival:", second, "| of the negative:", negated, "| lifelines, arguments swapped:", swapped)
if (first, second, negated) != (0.9, 0.1, 0.9) or not 0 <= swapped <= 1:
    sys.exit("changed: indices are %s, %s and %s" % (first, second, negated))
PY
