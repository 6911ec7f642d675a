#!/usr/bin/env bash
# evo 1.38.1: the error per 10 m is that over 12 m of a smooth estimate and over 4 m of a trembling
# one, because the metres are the estimate's own.
#
# Expected: `evo_rpe --delta 10 --delta_unit m` compares poses that are 10 m of ground truth apart,
# as KITTI's odometry benchmark does.
# Seen: the pairs are picked along the estimate. Two estimates of a straight drive of 100 m lose a
# tenth of the way each; one of them also jumps to the left at every second pose. The path of the
# smooth one is shorter than the drive, that of the other more than twice as long: the errors per
# "10 m" are 1.2 m and 0.4 m. With pairs from the reference both are 1.0 m.
# So: set `--pairs_from_reference` whenever estimators are compared; without it noise pays.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check evo==1.38.1
HOME=$dir "$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from evo.core import metrics, trajectory

def drive(scale, jump):
    x = np.arange(101.0)
    places = np.column_stack([scale * x, jump * (np.arange(101) % 2), 0 * x])
    return trajectory.PoseTrajectory3D(places, np.tile([1.0, 0, 0, 0], (101, 1)), x)

truth, found = drive(1, 0), {}
for name, estimate in (("smooth", drive(0.9, 0)), ("trembling", drive(0.9, 2.4))):
    for reference in (False, True):
        rpe = metrics.RPE(metrics.PoseRelation.translation_part, 10, metrics.Unit.meters, pairs_from_reference=reference)
        rpe.process_data((truth, estimate))
        apart = float(np.median(np.diff(rpe.delta_ids)))
        found[name, reference] = apart, round(float(rpe.get_statistic(metrics.StatisticsType.rmse)), 2)
        print(f"{name}, path {estimate.path_length:.0f} m, pairs from {'reference' if reference else 'estimate'}:",
              f"{apart:g} m apart, rmse {found[name, reference][1]:.2f} m")
if found != {("smooth", False): (12.0, 1.2), ("smooth", True): (10.0, 1.0), ("trembling", False): (4.0, 0.4), ("trembling", True): (10.0, 1.0)}:
    sys.exit("changed: pairs and errors are %s" % found)
PY
