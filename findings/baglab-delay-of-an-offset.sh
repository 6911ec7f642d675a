#!/usr/bin/env bash
# baglab 1.1.0 (Python): the delay of a signal that does not end where it began is 0.
#
# Expected: `delay_estimate(cmd, response, t)` ("Estimate dead time / transport delay using
# cross-correlation") gives 0.5 s if the response is the command half a second later.
# Seen: that is so for a pulse and, to a sample or so, for a sine around 0. For a step from 0 to
# 1, for a pulse on a speed of 1 m/s, and for a sine around 2 the delay is 0.0 s: the mean is not
# taken off before the correlation, which is then greatest where the two records overlap most. A
# response that answers with the opposite sign is as wrong, half a period late. Nothing warns.
# So: subtract the means, or better difference both signals, before the call.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check baglab==1.1.0 scipy==1.17.1 numpy==2.4.6 pandas==3.1.1
"$dir/venv/bin/python" - <<'PY'
import sys
import baglab
import numpy as np
import pandas as pd

t = pd.Series(np.arange(0, 20, 0.02))
signals = {
    "pulse": lambda x: 1.0 * ((x > 5) & (x < 6)),
    "sine": np.sin,
    "step from 0 to 1": lambda x: 1.0 * (x > 5),
    "pulse on 1 m/s": lambda x: 1 + 0.2 * ((x > 5) & (x < 6)),
    "sine around 2": lambda x: 2 + np.sin(x),
}
found = {}
for name, signal in signals.items():
    command, response = pd.Series(signal(t)), pd.Series(signal(t - 0.5))
    given = baglab.delay_estimate(command, response, t)
    slopes = baglab.delay_estimate(command.diff().fillna(0), response.diff().fillna(0), t)
    found[name] = round(given, 2)
    print(f"{name}, 0.5 s later: {given:.2f} s; of its slopes {slopes:.2f} s")
if [abs(found[name] - 0.5) < 0.05 for name in signals] != [True, True, False, False, False] or found["step from 0 to 1"]:
    sys.exit("changed: %s" % found)
PY
