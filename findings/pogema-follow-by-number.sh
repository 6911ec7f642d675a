#!/usr/bin/env bash
# pogema 1.4.0: whether one agent may follow another into the cell that it leaves depends on their
# numbers.
#
# Expected: in multi-agent path finding an agent may enter a cell in the step in which another
# leaves it (only shared cells and swaps are conflicts), or never may; the names of the agents do
# not matter.
# Seen: with the default collision system, "priority", agents move one after the other: agent 1 may
# follow agent 0, agent 0 behind agent 1 stands still. "block_both" forbids both, "soft" allows
# both.
# So: use `collision_system="soft"` to execute the plans of a solver; compare policies only with the
# same one, since queues flow or stall by the numbering.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pogema==1.4.0 pydantic==1.9.1 numpy==1.26.4
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
from pogema import GridConfig, pogema_v0

RIGHT = 4

def follow(system, columns):
    """Columns moved by each agent when both go right."""
    config = GridConfig(
        map=".....\n.....\n", agents_xy=[[0, column] for column in columns], targets_xy=[[1, 4], [1, 0]], num_agents=2,
        obs_radius=2, observation_type="MAPF", collision_system=system, on_target="nothing")
    env = pogema_v0(grid_config=config)
    before, _ = env.reset()
    after, *_ = env.step([RIGHT, RIGHT])
    return [new["global_xy"][1] - old["global_xy"][1] for old, new in zip(before, after)]

default = GridConfig().collision_system
found = {system: (follow(system, [1, 0]), follow(system, [0, 1])) for system in ("priority", "block_both", "soft")}
print("default:", default)
for system, (ahead, behind) in found.items():
    print(f"{system}: agent 0 ahead, cells moved {ahead}; agent 0 behind {behind}")
if default != "priority" or found != {
    "priority": ([1, 1], [0, 1]), "block_both": ([1, 0], [0, 1]), "soft": ([1, 1], [1, 1])}:
    sys.exit("changed: moves are %s, by default %s" % (found, default))
PY
