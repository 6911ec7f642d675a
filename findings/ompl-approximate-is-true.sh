#!/usr/bin/env bash
# ompl 2.0.1: `if setup.solve(1.0):` is taken though the goal was not reached.
#
# Expected: the condition of OMPL's own tutorials tells a solved problem from an unsolved one.
# Seen: behind a closed wall the status is "Approximate solution", which is true as a bool, and
# `getSolutionPath()` hands out a path that ends at the wall, 30 m short; `check()` of it is true.
# So: ask `status.asString() == "Exact solution"` or `setup.haveExactSolutionPath()`; a success rate
# that counts the bool is near 100 % on any map.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ompl==2.0.1
"$dir/venv/bin/python" - <<'PY'
import sys
from ompl import base, geometric, util

util.setLogLevel(util.LOG_ERROR)
space, bounds = base.RealVectorStateSpace(2), base.RealVectorBounds(2)
bounds.setLow(0)
bounds.setHigh(100)
space.setBounds(bounds)
setup = geometric.SimpleSetup(space)
setup.setStateValidityChecker(lambda state: abs(state[0] - 50) > 5)
start, goal = space.allocState(), space.allocState()
start[0], start[1], goal[0], goal[1] = 25, 50, 75, 50
setup.setStartAndGoalStates(start, goal)
setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
status = setup.solve(0.5)
path = setup.getSolutionPath()
end = path.getState(path.getStateCount() - 1)[0]
print("status:", status.asString(), "| as a bool:", bool(status), "| the path ends at x = %.1f of 75" % end, "| check:", path.check())
print("haveExactSolutionPath:", setup.haveExactSolutionPath())
if status.asString() != "Approximate solution" or not bool(status) or not end < 46 or not path.check() or setup.haveExactSolutionPath():
    sys.exit("changed: the status is %s" % status.asString())
PY
