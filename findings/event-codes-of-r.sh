#!/usr/bin/env bash
# Event codes 1 and 2, as R's survival package writes them: lifelines 0.30.3 takes all for dead,
# statsmodels 0.15.0 counts the dead twice.
#
# Expected: a column `status` with 1 for censored and 2 for dead (R's `lung` and `Surv`) is
# understood, or refused, as scikit-survival 0.28.0 does.
# Seen: of three runs with codes 1 2 1 the curve should fall once, to 0.5. lifelines: every
# non-zero is an event, 0.667 0.333 0. statsmodels: a 2 counts as two events, 0.667 0 0. Neither
# warns.
# So: turn codes into booleans first, `status == 2`; of a result file from R count the distinct
# codes.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    lifelines==0.30.3 scikit-survival==0.28.0 statsmodels==0.15.0 scipy==1.17.1
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings
import numpy as np
from lifelines import KaplanMeierFitter
from sksurv.util import Surv
from statsmodels.duration.survfunc import SurvfuncRight

times, codes = np.array([1.0, 2.0, 3.0]), np.array([1, 2, 1])
curve = lambda events: KaplanMeierFitter().fit(times, events).survival_function_.iloc[1:, 0].round(3).tolist()
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    found = {"right": curve(codes == 2), "lifelines": curve(codes),
             "statsmodels": SurvfuncRight(times, codes).surv_prob.round(3).tolist()}
about = [str(w.message) for w in caught if "event" in str(w.message).lower() or "status" in str(w.message).lower()]
try:
    Surv.from_arrays(codes, times)
    found["sksurv"] = "taken"
except ValueError as error:
    found["sksurv"] = str(error)
for name, result in found.items():
    print(name, result)
if found["right"] != [1.0, 0.5, 0.5] or found["lifelines"] != [0.667, 0.333, 0.0]:
    sys.exit("changed: curves are %s" % found)
if found["statsmodels"] != [0.667, 0.0, 0.0] or "0 and 1" not in found["sksurv"] or about:
    sys.exit("changed: %s, warnings %s" % (found, about))
PY
