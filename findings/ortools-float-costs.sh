#!/usr/bin/env bash
# ortools 9.15.6755: a tour by distances in floats has the cost 0 and any order; an assignment by
# floats is the worst one, and OPTIMAL.
#
# Expected: a callback that returns 0.37, or an array of floats as costs, is optimised as it is, or
# refused, as `RegisterTransitMatrix` refuses a float.
# Seen: each float that a transit callback returns counts as 0, 370.0 too, so the first tour that is
# found is optimal, here half as long again as the shortest; with `int` around it, it is right.
# `SimpleLinearSumAssignment` cuts 0.9 and 0.1 to 0: robots get the farther goal, the status is
# OPTIMAL.
# So: scale and round costs to integers yourself, and recompute the cost of the answer.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ortools==9.15.6755 numpy==2.4.6
"$dir/venv/bin/python" -W ignore - <<'PY'
import itertools
import math
import random
import sys
import numpy as np
from ortools.constraint_solver import pywrapcp
from ortools.graph.python import linear_sum_assignment

random.seed(1)
places = [(random.random(), random.random()) for _ in range(8)]
def length(tour):
    return sum(math.dist(places[a], places[b]) for a, b in zip(tour, tour[1:]))
best = min(length((0, *rest, 0)) for rest in itertools.permutations(range(1, 8)))

def tour(cost_of):
    manager = pywrapcp.RoutingIndexManager(len(places), 1, 0)
    model = pywrapcp.RoutingModel(manager)
    nodes = manager.IndexToNode
    model.SetArcCostEvaluatorOfAllVehicles(
        model.RegisterTransitCallback(lambda a, b: cost_of(math.dist(places[nodes(a)], places[nodes(b)]))))
    solution, index, order = model.Solve(), model.Start(0), []
    while not model.IsEnd(index):
        order.append(nodes(index))
        index = solution.Value(model.NextVar(index))
    return solution.ObjectiveValue(), round(length([*order, 0]) / best, 2)

costs = {"metres": lambda m: m, "1000.0 * metres": lambda m: 1000 * m, "int(1000 * metres)": lambda m: int(1000 * m)}
found = {name: tour(cost_of) for name, cost_of in costs.items()}
for name, (objective, ratio) in found.items():
    print(f"{name}: objective {objective}, length over the shortest {ratio}")
assignment = linear_sum_assignment.SimpleLinearSumAssignment()
assignment.add_arcs_with_cost(np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1]), np.array([0.9, 0.1, 0.2, 0.8]))
status = assignment.solve()
mates = [assignment.right_mate(robot) for robot in range(2)]
print("assignment with costs 0.9 0.1 / 0.2 0.8:", mates, status, "cost", assignment.optimal_cost())
if found["int(1000 * metres)"][1] != 1 or any(found[name][0] != 0 or found[name][1] < 1.1 for name in list(costs)[:2]):
    sys.exit("changed: the tours are %s" % found)
if mates != [0, 1] or status != assignment.OPTIMAL or assignment.optimal_cost() != 0:
    sys.exit("changed: the assignment is %s" % mates)
PY
