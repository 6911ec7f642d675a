#!/usr/bin/env bash
# SciPy 1.17.1: thirteen pairs without any difference have p = 1, fourteen have p = nan.
#
# Expected: the signed-rank test of identical results (two deterministic planners that behave alike
# on all maps) says one thing whatever n is.
# Seen: with zero_method "wilcox" and "pratt", p = 1.0 up to n = 13, where ties are enumerated, and
# nan from 14 on, where the normal approximation divides by a variance of 0; "zsplit" says 1.0 for
# both. One map more turns a table's "no difference" into an empty cell, and `p < 0.05` is false
# for both.
# So: count the pairs that differ before testing; print that count beside p.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check scipy==1.17.1 numpy==2.4.6
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import numpy as np
from scipy.stats import wilcoxon

found = {method: [str(float(wilcoxon(np.zeros(n), zero_method=method).pvalue)) for n in (13, 14)]
         for method in ("wilcox", "pratt", "zsplit")}
for method, values in found.items():
    print(f"{method}: n = 13 {values[0]}, n = 14 {values[1]}")
if found != {"wilcox": ["1.0", "nan"], "pratt": ["1.0", "nan"], "zsplit": ["1.0", "1.0"]}:
    sys.exit("changed: p values are %s" % found)
PY
