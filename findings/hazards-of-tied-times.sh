#!/usr/bin/env bash
# Times that tie, as times in ticks do: lifelines 0.30.3 against scikit-survival 0.28.0 and
# statsmodels 0.15.0.
#
# Expected: one cumulative hazard (Nelson-Aalen) and one hazard ratio (Cox) for one set of runs.
# Seen: of 5 runs 3 end in tick 5. lifelines' NelsonAalenFitter rises by 1/5 + 1/4 + 1/3 = 0.78,
# scikit-survival by 3/5; the former calls it `nelson_aalen_smoothing`, and it is on. For Cox,
# lifelines knows only Efron's way of ties, the two others take Breslow's unless told: on 20 runs in
# whole seconds the coefficients are -0.101 and -0.085. On times without ties all agree.
# So: write down how ties are taken, and pass it (`ties="efron"`, `nelson_aalen_smoothing=False`);
# a check of one library by another needs ties in its data.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    lifelines==0.30.3 scikit-survival==0.28.0 statsmodels==0.15.0 scipy==1.17.1
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
import pandas as pd
from lifelines import CoxPHFitter, NelsonAalenFitter
from sksurv.linear_model import CoxPHSurvivalAnalysis
from sksurv.nonparametric import nelson_aalen_estimator
from sksurv.util import Surv
from statsmodels.duration.hazard_regression import PHReg

times, events = np.array([5, 5, 5, 5, 8]), np.array([1, 1, 1, 0, 1])
last = lambda **options: float(NelsonAalenFitter(**options).fit(times, events).cumulative_hazard_.iloc[1, 0])
hazards = [round(value, 3) for value in (
    last(), last(nelson_aalen_smoothing=False), nelson_aalen_estimator(events.astype(bool), times)[1][0])]
print("hazard at tick 5: lifelines", hazards[0], "| without smoothing", hazards[1], "| scikit-survival", hazards[2])

times = np.array([3, 3, 3, 5, 5, 7, 7, 9, 9, 9, 4, 4, 6, 6, 6, 8, 8, 8, 10, 10.0])
events = np.array([1, 1, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1])
group = np.array([0, 1] * 10)

def coefficients(times):
    table = pd.DataFrame({"time": times, "event": events, "group": group})
    column, runs = group[:, None].astype(float), Surv.from_arrays(events.astype(bool), times)
    return [round(float(value), 3) for value in (
        CoxPHFitter().fit(table, "time", "event").params_.iloc[0],
        PHReg(times, column, status=events).fit().params[0],
        CoxPHSurvivalAnalysis().fit(column, runs).coef_[0],
        PHReg(times, column, status=events, ties="efron").fit().params[0],
        CoxPHSurvivalAnalysis(ties="efron").fit(column, runs).coef_[0])]

tied, apart = coefficients(times), coefficients(times + np.arange(20) / 100)
for name, values in (("with ties", tied), ("without ties", apart)):
    print(name, dict(zip(("lifelines", "statsmodels", "scikit-survival", "both told Efron", ""), values)))
if hazards != [0.783, 0.6, 0.6]:
    sys.exit("changed: hazards are %s" % hazards)
if tied != [-0.101, -0.085, -0.085, -0.101, -0.101] or max(apart) - min(apart) > 0.001:
    sys.exit("changed: coefficients are %s and %s" % (tied, apart))
PY
