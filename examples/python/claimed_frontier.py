"""Frontiers by auction: agents in contact claim what they go to, and leave it to the best bid.

    python examples/python/claimed_frontier.py             # beside nearest-frontier, on ten seeds

`maes.Auction` is the auction of `dsvp-auction` in Rust. Here the goal is the frontier with the
least sum of path length and penalty, which frontiers have that another agent will reach sooner.
"""

from statistics import mean

import numpy as np

import maes
from maes import Auction, Command, Ctx, EventMask, Motion, Observation, WakeCondition

UNDER_WAY = WakeCondition.on(EventMask.TASK_DONE | EventMask.COLLISION | EventMask.NEW_CELL | EventMask.CONTACTS | EventMask.MESSAGE)
CANDIDATES = 64


class ClaimedFrontier(maes.Controller):
    """exploration by the cheapest frontier, with an auction of goals among the agents in contact"""

    name = "claimed-frontier"

    def __init__(self, rng, values):
        super().__init__(rng, values)
        self.auction = None
        self.goal = None
        self.abandoned = set()

    def decide(self, observation: Observation, ctx: Ctx) -> Command:
        self.auction = self.auction or Auction(ctx)
        self.auction.receive(observation)
        if observation.scan_tick is None:
            return Command.keep(WakeCondition.NEXT_TICK)
        if self.goal is not None and observation.events & EventMask.COLLISION:
            self.goal = None
            self.auction.withdraw()
            return ctx.step_aside(self.rng)
        is_held = self.goal is not None and ctx.map.is_frontier(self.goal) and not self.auction.is_outbid
        if is_held and observation.is_active:
            command = Command.keep(UNDER_WAY)
            # A reply to every message would be answered for ever.
            return self.auction.add_to(command) if observation.events & EventMask.CONTACTS else command
        if is_held and self.goal == ctx.cell:
            self.abandoned.add(self.goal)
        self.auction.withdraw()
        self.goal, path_m = self.cheapest(ctx)
        if self.goal is None:
            command = Command(Motion.stop(), WakeCondition.on(EventMask.MESSAGE | EventMask.CONTACTS)).with_stage("waiting")
            return command.with_info("knows no frontier")
        motion = ctx.go_to_cell(self.goal)
        if motion is None:
            self.abandoned.add(self.goal)
            return Command(Motion.stop(), WakeCondition.NEXT_TICK)
        self.auction.claim(self.goal, path_m)
        if self.auction.is_outbid:
            # All frontiers are near better bids: it goes there without a claim.
            self.auction.withdraw()
        return self.auction.add_to(Command(motion, UNDER_WAY))

    def cheapest(self, ctx: Ctx):
        """The frontier with the least sum of path length and penalty, and the length; or None."""
        frontiers = ctx.map.frontiers
        lengths_m = ctx.path_lengths_m(frontiers)
        nearest = np.argsort(lengths_m, kind="stable")[:CANDIDATES]
        candidates = [(tuple(frontiers[n].tolist()), float(lengths_m[n])) for n in nearest if np.isfinite(lengths_m[n])]
        candidates = [one for one in candidates if one[0] not in self.abandoned]
        if not candidates:
            return None, 0.0
        return min(candidates, key=lambda one: (one[1] + self.auction.penalty_m(*one), one[0]))


if __name__ == "__main__":
    for controller in ("nearest-frontier", ClaimedFrontier):
        runs = [maes.run(agents=5, controller=controller, size=60, seed=seed) for seed in range(1, 11)]
        print(runs[0].metrics["controller"], f"explores in {mean(run.end_s for run in runs):.0f} s on average")
