#!/usr/bin/env bash
# baglab 1.1.0, control 0.10.2 (Python): a step response settles after 56 years.
#
# Expected: `stepinfo(actual, target, t)` of baglab, "Logic follows MATLAB stepinfo /
# python-control step_info", and `step_info(response, t)` give two durations, the rise time and
# the settling time, whatever the first stamp is.
# Seen: in both the rise time is a duration, and the settling time is the stamp at which the
# response has settled. With `t = baglab.stamp_to_sec(df)`, whose default is absolute time, that
# is 1.76e9 s; in a recording that begins 100 s before the step it is 100 s too long.
# So: pass `t - t_step`, or `stamp_to_sec(df, relative=True)` of a slice that begins with the
# step.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check baglab==1.1.0 control==0.10.2 numpy==2.4.6 pandas==3.1.1
"$dir/venv/bin/python" - <<'PY'
import sys
import baglab
import control
import numpy as np
import pandas as pd

since_s = np.arange(0, 10, 0.01)
response = 1 - np.exp(-since_s)
found = {}
for begins_s in (0, 1_764_529_200):
    stamps = pd.DataFrame({"header.stamp.sec": begins_s + since_s.astype(int)})
    stamps["header.stamp.nanosec"] = np.round((since_s % 1) * 1e9).astype(int) % 10**9
    t = baglab.stamp_to_sec(stamps)
    info = baglab.stepinfo(pd.Series(response), 1.0, pd.Series(begins_s + since_s))
    found[begins_s] = {key: info[key] for key in ("rise_time", "settling_time")}
    print(f"first stamp {t.iloc[0]:.0f} s: rises in {info['rise_time']:.2f} s, settles in {info['settling_time']:.2f} s")
    other = control.step_info(response, begins_s + since_s, yfinal=1.0)
    print(f"  python-control: rises in {other['RiseTime']:.2f} s, settles in {other['SettlingTime']:.2f} s")
late_s = other["SettlingTime"]
early, late = found[0], found[1_764_529_200]
if abs(early["rise_time"] - late["rise_time"]) > 0.02 or abs(late["settling_time"] - early["settling_time"] - 1_764_529_200) > 0.02 or abs(
    late_s - late["settling_time"]
) > 0.02:
    sys.exit("changed: %s" % found)
PY
