#!/usr/bin/env bash
# permute 0.2: the p value of a permutation test depends on the unit of the data.
#
# Expected: two_sample counts the permutations whose statistic is at least the observed one; with
# one seed the permutations are the same, so runs told in ticks and in seconds have one p value.
# Seen: means are compared as floating-point numbers, and a permutation that only changes the order
# of the sum falls a last digit short of itself: ties are lost. Ticks 3 5 3 3 5 against 4 3 3 3 5
# have p = 0.49, and 0.35 once multiplied by 0.1 s (the exact value, by counting, is 0.5).
# So: hand whole numbers to it (ticks, cells, millimetres), all the more for few or tied values;
# in own code compare with a tolerance, as SciPy does.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check permute==0.2
"$dir/venv/bin/python" - <<'PY'
import sys
from itertools import combinations
import numpy as np
from permute.core import two_sample

x, y = np.array([3, 5, 3, 3, 5]), np.array([4, 3, 3, 3, 5])
sums = [sum(chosen) for chosen in combinations(np.concatenate([x, y]).tolist(), len(x))]
exact = sum(total >= x.sum() for total in sums) / len(sums)
found = [round(float(two_sample(a, b, reps=2000, alternative="greater", seed=1)[0]), 3)
         for a, b in ((x, y), (x * 0.1, y * 0.1))]
print("exact:", exact, "| in ticks:", found[0], "| in seconds:", found[1])
if exact != 0.5 or abs(found[0] - 0.5) > 0.04 or found[1] > 0.4:
    sys.exit("changed: permute gives %s" % found)
PY
