"""Nearest frontier in Python: the controller of the same name, decision by decision.

    python examples/python/nearest_frontier.py               # in this process, over memory
    python -m maes.node examples/python/nearest_frontier.py:NearestFrontier --id 0      # over ROS 2
"""

import maes
from maes import Command, Ctx, EventMask, Motion, Observation, WakeCondition

UNDER_WAY = WakeCondition.on(EventMask.TASK_DONE | EventMask.COLLISION | EventMask.NEW_CELL)


class NearestFrontier(maes.Controller):
    """greedy exploration, by the shortest path to the nearest frontier of its map"""

    name = "nearest-frontier-py"
    stream = "nearest-frontier"  # the random numbers of the original

    def __init__(self, rng, values):
        super().__init__(rng, values)
        self.goal = None
        self.abandoned = set()

    def decide(self, observation: Observation, ctx: Ctx) -> Command:
        if observation.scan_tick is None:
            return Command.keep(WakeCondition.NEXT_TICK)
        if self.goal is not None and observation.events & EventMask.COLLISION:
            self.goal = None
            return ctx.step_aside(self.rng)
        goal = self.goal if self.goal is not None and ctx.map.is_frontier(self.goal) else None
        if goal is not None and observation.is_active:
            return Command.keep(UNDER_WAY)
        if goal is not None and goal == ctx.cell:
            self.abandoned.add(goal)
            goal = None
        self.goal = goal or ctx.nearest_frontier(self.abandoned)
        if self.goal is None:
            maps = WakeCondition.on(EventMask.MESSAGE | EventMask.CONTACTS)
            return Command(Motion.stop(), maps).with_stage("waiting").with_info("knows no frontier")
        x, y, z = self.goal
        motion = ctx.go_to_cell(self.goal)
        if motion is None:
            self.abandoned.add(self.goal)
            return Command(Motion.stop(), WakeCondition.NEXT_TICK)
        return Command(motion, UNDER_WAY).with_stage("relocating").with_info(f"goes to the frontier {x} {y} {z}")


if __name__ == "__main__":
    print(maes.run(size=50, agents=5, controller=NearestFrontier))
