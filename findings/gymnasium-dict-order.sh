#!/usr/bin/env bash
# gymnasium 1.4.0: one Dict space, written in two ways, flattens into two vectors; agent_10 comes
# before agent_2.
#
# Expected: spaces that are equal (`==`) flatten one observation into one vector.
# Seen: a plain dict is sorted by name as text, while keyword arguments, pairs and an OrderedDict
# keep their order. Both spaces are equal, both contain the observation, and `flatten` gives 0.1
# 0.9 for the one and 0.9 0.1 for the other.
# So: a policy trained on one spelling runs on the other without an error, with its inputs
# exchanged. Build Dict spaces in one place, give agents numbers of fixed width, and compare
# `list(space.spaces)` on loading.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check gymnasium==1.4.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from gymnasium import spaces

unit = spaces.Box(0, 1, (1,), np.float32)
by_dict, by_keywords = spaces.Dict({"speed": unit, "height": unit}), spaces.Dict(speed=unit, height=unit)
observation = {"speed": np.array([0.1], np.float32), "height": np.array([0.9], np.float32)}
vectors = [[round(float(v), 1) for v in spaces.flatten(space, observation)] for space in (by_dict, by_keywords)]
names = list(spaces.Dict({f"agent_{i}": unit for i in (1, 2, 10)}).spaces)
print("equal:", by_dict == by_keywords, "| both contain it:", observation in by_dict and observation in by_keywords)
print("by dict:", vectors[0], "| by keywords:", vectors[1], "| agents:", names)
if not (by_dict == by_keywords and observation in by_dict and observation in by_keywords):
    sys.exit("changed: the spaces are not equal")
if vectors != [[0.9, 0.1], [0.1, 0.9]]:
    sys.exit("changed: vectors are %s" % vectors)
if names != ["agent_1", "agent_10", "agent_2"]:
    sys.exit("changed: agents are %s" % names)
PY
