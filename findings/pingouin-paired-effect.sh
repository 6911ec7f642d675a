#!/usr/bin/env bash
# pingouin 0.7.0: its paired Wilcoxon test reports an effect size that does not know of the pairs.
#
# Expected: the CLES in the row of a paired test is the share of pairs in which the first is better;
# it and the rank-biserial correlation beside it tell one story.
# Seen: of 20 maps, on all of which one planner is 1 s faster while maps differ by 10 s from each
# other, RBC is 1 and p 2e-6, CLES 0.52: "as good as a coin". It compares each value of one with all
# values of the other.
# So: for runs on the same seeds report RBC, or count the pairs; CLES belongs to the unpaired test.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pingouin==0.7.0
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
import pingouin

maps = np.arange(20) * 10.0
slow, fast = maps + 1.0 + np.arange(20) * 1e-3, maps
row = pingouin.wilcoxon(slow, fast).iloc[0]
better = float(np.mean(slow > fast))
print("share of pairs:", better, "| RBC:", round(float(row["RBC"]), 3), "| CLES:", round(float(row["CLES"]), 3), "| p:", float(row["p_val"]))
if better != 1.0 or round(float(row["RBC"]), 3) != 1.0 or row["p_val"] > 1e-5:
    sys.exit("changed: the test gives %s" % row)
if not 0.5 < row["CLES"] < 0.55:
    sys.exit("changed: CLES is %s" % row["CLES"])
PY
