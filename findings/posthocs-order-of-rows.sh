#!/usr/bin/env bash
# scikit-posthocs 0.17.1: Wilcoxon's test for pairs gives p = 0.000002 or 0.9 by the order of the
# table's rows, and `posthoc_ttest` is not for pairs.
#
# Expected: a table in long form, with one row per scenario and planner, has the same p values
# however its rows are sorted; a paired test takes a column that says what is paired, as
# `posthoc_nemenyi_friedman` does (`block_col`).
# Seen: `posthoc_wilcoxon(table, val_col, group_col)` pairs the n-th row of one group with the n-th
# of the other. Of 20 scenarios, each 0.1 s slower with one planner, shuffled rows lose all
# evidence.
# So: sort by scenario before the call, which matters for results that are written as runs end; or
# pivot the table and test its columns with SciPy.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check scikit-posthocs==0.17.1 numpy==2.4.6 pandas==3.1.1 scipy==1.17.1
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import numpy as np
import pandas as pd
import scikit_posthocs

noise = np.random.default_rng(0).normal(0, 0.01, 20)
wide = pd.DataFrame({"scenario": range(20), "ours": np.arange(20.0), "theirs": np.arange(20.0) + 0.1 + noise})
table = wide.melt(id_vars="scenario", var_name="planner", value_name="seconds")
def p_of(rows):
    return float(scikit_posthocs.posthoc_wilcoxon(rows, val_col="seconds", group_col="planner").loc["ours", "theirs"])
ordered = p_of(table)
shuffled = [round(p_of(table.sample(frac=1, random_state=seed)), 2) for seed in range(5)]
print("p of 20 pairs, rows by scenario: %.2g, rows shuffled: %s" % (ordered, shuffled))
if ordered > 1e-4 or min(shuffled) < 0.2:
    sys.exit("changed: p is %s and %s" % (ordered, shuffled))
PY
