#!/usr/bin/env bash
# statsmodels 0.15.0: a comparison without a p value still costs the others power in Holm's
# correction, and takes all their answers in that of Benjamini and Hochberg.
#
# Expected: `multipletests` of 0.01, nan, 0.04 (one pair of planners could not be tested) corrects
# two tests: 0.02 and 0.04; or raises, as SciPy's false_discovery_control does.
# Seen: "holm" multiplies by 3 and 2: 0.03 and 0.08, so 0.04 is lost; "fdr_bh" answers nan for all
# three. No warning.
# So: drop what is not a number first and put the results back by place; a column of nan in a
# report is often one nan in the input.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check statsmodels==0.15.0 scipy==1.17.1
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import numpy as np
from statsmodels.stats.multitest import multipletests

correct = lambda values, method: [str(round(float(p), 6)) for p in multipletests(values, method=method)[1]]
found = {
    "holm": correct([0.01, np.nan, 0.04], "holm"), "holm of two": correct([0.01, 0.04], "holm"),
    "fdr_bh": correct([0.01, np.nan, 0.04], "fdr_bh"),
}
for name, values in found.items():
    print(name, values)
if found["holm"] != ["0.03", "nan", "0.08"] or found["holm of two"] != ["0.02", "0.04"]:
    sys.exit("changed: holm gives %s" % found)
if found["fdr_bh"] != ["nan"] * 3:
    sys.exit("changed: fdr_bh gives %s" % found["fdr_bh"])
PY
