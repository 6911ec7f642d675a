#!/usr/bin/env bash
# ompl 2.0.1: in a hall of 100 m an exact solution goes through a closed wall of 0.9 m, and its
# `check()` is true.
#
# Expected: a planner whose state validity checker forbids the wall returns no path to the other
# side; `PathGeometric.check()` finds what is wrong.
# Seen: motions are checked at steps of 1 % of the diameter of the bounds, here 1.4 m, and every
# wall that is thinner may be stepped over: RRTConnect finds an "Exact solution" of 3 to 5 states,
# and `check()`, with the same steps, agrees. The same wall with the resolution at 0.1 % stops it. A
# hall that is declared larger than the building makes its walls thinner.
# So: `setStateValidityCheckingResolution(half the thinnest wall / getMaximumExtent())` whenever the
# bounds are set, and check final paths with a checker of your own.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ompl==2.0.1
"$dir/venv/bin/python" - <<'PY'
import sys
from ompl import base, geometric, util

util.setLogLevel(util.LOG_ERROR)
HALL_M, WALL_M = 100.0, 0.9

def plan(resolution):
    space, bounds = base.RealVectorStateSpace(2), base.RealVectorBounds(2)
    bounds.setLow(0)
    bounds.setHigh(HALL_M)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: abs(state[0] - HALL_M / 2) > WALL_M / 2)
    if resolution:
        setup.getSpaceInformation().setStateValidityCheckingResolution(resolution)
    start, goal = space.allocState(), space.allocState()
    start[0], start[1], goal[0], goal[1] = 25, 50, 75, 50
    setup.setStartAndGoalStates(start, goal)
    setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
    status = setup.solve(2.0)
    return status.asString(), setup.getSolutionPath().check()

coarse = [plan(None) for _ in range(5)]
fine = plan(0.001)
print("default resolution:", coarse, "| 0.1 %:", fine)
if ("Exact solution", True) not in coarse or fine[0] == "Exact solution":
    sys.exit("changed: the answers are %s and %s" % (coarse, fine))
PY
