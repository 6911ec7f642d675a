#!/usr/bin/env bash
# trajectopy 5.1.2: its absolute trajectory error is a mean, where that of the literature is a root
# mean square.
#
# Expected: `pos_ate` of a trajectory that is right but for one excursion is the figure of evo and
# of the TUM benchmark, the root of the mean squared distance after alignment.
# Seen: it is the mean of the distances: 0.64 for 1.23. The root mean square is there under another
# name, `pos_dev_rms`. Of a steady error both are the same, so a first check does not tell.
# So: report `pos_dev_rms` beside figures of others.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check trajectopy==5.1.2 evo==1.38.1 numpy==2.4.6
cd "$dir"
HOME="$dir" "$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import numpy as np
import trajectopy
from evo.core import metrics, sync
from evo.tools import file_interface

stamps = 1.7e9 + np.arange(200) * 0.1
path = np.c_[10 * np.cos(np.arange(200) / 30), 10 * np.sin(np.arange(200) / 30), np.zeros(200)]
astray = path.copy()
astray[90:100, 2] += 6
for name, points in (("truth.tum", path), ("estimate.tum", astray)):
    with open(name, "w") as file:
        file.writelines("%.9f %.9f %.9f %.9f 0 0 0 1\n" % (stamp, *point) for stamp, point in zip(stamps, points))
truth, estimate = (trajectopy.Trajectory.from_file(name) for name in ("truth.tum", "estimate.tum"))
ours = trajectopy.ate(truth, estimate, trajectopy.ProcessingSettings())
reference, other = sync.associate_trajectories(*map(file_interface.read_tum_trajectory_file, ("truth.tum", "estimate.tum")))
other.align(reference)
ape = metrics.APE(metrics.PoseRelation.translation_part)
ape.process_data((reference, other))
found = {
    "pos_ate": ours.pos_ate, "pos_dev_rms": ours.pos_dev_rms,
    "evo rmse": ape.get_statistic(metrics.StatisticsType.rmse), "evo mean": ape.get_statistic(metrics.StatisticsType.mean),
}
found = {name: round(float(value), 2) for name, value in found.items()}
print("metres:", found)
same = lambda a, b: abs(found[a] - found[b]) < 0.05
if not same("pos_ate", "evo mean") or not same("pos_dev_rms", "evo rmse") or found["pos_ate"] > 0.7 * found["evo rmse"]:
    sys.exit("changed: errors are %s" % found)
PY
