#!/usr/bin/env bash
# A log-rank test when nothing happened: lifelines 0.30.3, scikit-survival 0.28.0, statsmodels
# 0.15.0 and SciPy 1.17.1 give four answers.
#
# Expected: if no run of either controller reached its goal (all censored), the statistic is 0 / 0;
# a test says "nothing to compare" in one way.
# Seen: lifelines p = 1.0, SciPy nan (and compares nan < 0.05, false), scikit-survival ValueError,
# statsmodels LinAlgError "Singular matrix". If all runs end in the same tick, the three that have
# no 1.0 fail or give nan again, and scikit-survival now fails as statsmodels does.
# So: a table of many maps needs this case by hand, before the library: "1.0" reads as "no
# difference", an exception loses the whole table.
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
import scipy.stats
from lifelines.statistics import logrank_test
from sksurv.compare import compare_survival
from sksurv.util import Surv
from statsmodels.duration.survfunc import survdiff

warnings.simplefilter("ignore")

def tests(times, events, groups):
    first = groups == 0
    data = lambda part: scipy.stats.CensoredData(uncensored=times[part & events], right=times[part & ~events])
    for name, test in {
        "lifelines": lambda: logrank_test(times[first], times[~first], events[first], events[~first]).p_value,
        "scipy": lambda: scipy.stats.logrank(data(first), data(~first)).pvalue,
        "sksurv": lambda: compare_survival(Surv.from_arrays(events, times), groups)[1],
        "statsmodels": lambda: survdiff(times, events.astype(int), groups)[1],
    }.items():
        try:
            yield name, str(float(test()))
        except Exception as error:
            yield name, type(error).__name__

groups = np.repeat([0, 1], 4)
nothing = dict(tests(np.arange(1.0, 9), np.zeros(8, bool), groups))
together = dict(tests(np.full(8, 9.0), np.ones(8, bool), groups))
print("no event:    ", nothing)
print("all together:", together)
if nothing != {"lifelines": "1.0", "scipy": "nan", "sksurv": "ValueError", "statsmodels": "LinAlgError"}:
    sys.exit("changed: without events it is %s" % nothing)
if together != {"lifelines": "1.0", "scipy": "nan", "sksurv": "LinAlgError", "statsmodels": "LinAlgError"}:
    sys.exit("changed: all together it is %s" % together)
PY
