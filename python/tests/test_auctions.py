"""The auction of goals in Python controllers: that of the controllers in Rust."""

from pathlib import Path

import numpy as np
import pytest

import maes
from maes import Auction, Command, Motion, WakeCondition
from maes.node import load

EXAMPLES = Path(__file__).resolve().parents[2] / "examples/python"
ClaimedFrontier = load(f"{EXAMPLES}/claimed_frontier.py:ClaimedFrontier")


def in_a_room(folder, agents, decide):
    """Runs a controller with this function as `decide` for a second, where agents stay in contact."""
    walls = np.ones((20, 20, 20), dtype=bool)
    walls[1:-1, 1:-1, 1:-1] = False
    maes.Map(walls, 1.0).save(folder / "room.m3dm")
    own = type("Own", (maes.Controller,), {"decide": decide, "auction": None})
    scenario = f"""
    seed = 1
    duration_s = 1.0
    stop_when_explored = false
    map = {{ kind = "file", file = "{folder / "room.m3dm"}" }}
    agents = {{ count = {agents} }}
    """
    return maes.run(maes.Scenario.from_toml(scenario), controller=own)


def test_claims_reach_the_agents_in_contact_and_the_shorter_path_wins(tmp_path):
    known, outbid = {}, {}

    def decide(self, observation, ctx):
        self.auction = self.auction or Auction(ctx)
        self.auction.receive(observation)
        goal = (5, 5, 5 + ctx.agent)
        if observation.tick < 10:
            self.auction.claim(goal, 4.0 + ctx.agent)
        if observation.tick == 30:
            known[ctx.agent] = [(agent, cell, path_m) for agent, cell, path_m, _ in self.auction.claims]
            outbid[ctx.agent] = self.auction.is_outbid
            assert self.auction.utility_factor(goal, 30.0) < 0.2
            assert self.auction.utility_factor((19, 19, 19), 30.0) > self.auction.utility_factor(goal, 30.0)
            assert self.auction.penalty_m(goal, 30.0) == 80.0
            self.auction.withdraw()
            assert not self.auction.is_outbid
            assert [agent for agent, *_ in self.auction.claims] == [1 - ctx.agent]
        return self.auction.add_to(Command(Motion.stop(), WakeCondition.at(observation.tick + 1)))

    in_a_room(tmp_path, 2, decide)
    assert known == {agent: [(0, (5, 5, 5), 4.0), (1, (5, 5, 6), 5.0)] for agent in (0, 1)}
    assert outbid == {0: False, 1: True}


def test_wrong_use_is_an_exception_that_names_the_thing(tmp_path):
    messages = []

    def decide(self, observation, ctx):
        auction = Auction(ctx, lease_s=5.0)
        wrong = [
            lambda: Auction(ctx, spread_m=-1.0),
            lambda: Auction(ctx, spreads=1.0),
            lambda: auction.claim((99, 0, 0), 1.0),
            lambda: auction.claim((1, 1, 1), float("nan")),
            lambda: auction.penalty_m((1, 1, 1), -1.0),
        ]
        for use in wrong:
            with pytest.raises(ValueError) as raised:
                use()
            messages.append(str(raised.value))
        return Command(Motion.stop(), WakeCondition.at(10**9))

    in_a_room(tmp_path, 1, decide)
    expected = ["from 0.1 to 1000", "`spreads`: unknown", "(20, 20, 20) cells", "path_m = NaN", "path_m = -1"]
    for message, part in zip(messages, expected, strict=True):
        assert part in message


def test_example_explores_with_an_auction_and_repeats():
    keys = {"agents": 5, "size": 60, "seed": 2}
    with_claims = maes.run(controller=ClaimedFrontier, **keys)
    assert with_claims.reason == "explored"
    assert with_claims.digest == maes.run(controller=ClaimedFrontier, **keys).digest
    assert with_claims.counters["messages_sent"] > 0
