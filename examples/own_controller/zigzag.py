"""A controller of your own: straight on until a collision, then a turn to a random side.

    python zigzag.py                                 # in this process
    python -m maes.node zigzag.py:Zigzag --id 0      # a ROS 2 node, beside `maes run --external 0`
"""

import math

import maes
from maes import Command, Ctx, Motion, Observation, WakeCondition


class Zigzag(maes.Controller):
    """straight on, and a turn to a random side at each obstacle"""

    name = "zigzag"
    settings = {"turn_rad": (2.0, 0.1, 3.0)}

    def decide(self, observation: Observation, ctx: Ctx) -> Command:
        if observation.is_active:
            return Command.keep(WakeCondition.TASK_DONE)
        if observation.collision is not None:
            side = 1.0 if self.rng.random() < 0.5 else -1.0
            return Command(Motion.turn(side * self.values["turn_rad"]), WakeCondition.TASK_DONE)
        return Command(Motion.straight(0.0, math.inf), WakeCondition.TASK_DONE)


if __name__ == "__main__":
    print(maes.run(size=50, agents=5, controller=Zigzag, record="run.mcap"))
