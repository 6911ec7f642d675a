"""Environments: the checks of PettingZoo and Gymnasium, determinism, wrong use, and leaks."""

import multiprocessing
import resource
import threading

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.utils.conversions import parallel_to_aec
from pettingzoo.test import parallel_api_test, parallel_seed_test

import maes
from maes.envs import ExplorationEnv, Worlds, parallel_env

CAVE = {"size": 30, "duration": 20.0, "stop_when_explored": False, "map__spheres__radius_max": 5}


@pytest.mark.parametrize("actions", ["velocity", "waypoint", "frontier"])
def test_pettingzoo_and_gymnasium_accept_them(actions):
    parallel_api_test(parallel_env(agents=3, actions=actions, **CAVE), num_cycles=150)
    parallel_seed_test(lambda: parallel_env(agents=2, actions=actions, **CAVE), num_cycles=50)
    check_env(ExplorationEnv(actions=actions, **CAVE), skip_render_check=True)
    check_env(gymnasium.make("maes/Exploration-v0", actions=actions, observations="flat", **CAVE).unwrapped)


def starts(env, seeds=(None,)):
    """What each reset shows first, as bytes; the maps of different worlds differ in it."""
    shown = (env.reset(**({} if seed is None else {"seed": seed}))[0] for seed in seeds)
    return [b"".join(array.tobytes() for array in (one.get("agent_0", one)).values()) for one in shown]


ENVIRONMENTS = [ExplorationEnv, lambda **keys: parallel_env(agents=2, **keys)]


@pytest.mark.parametrize("make", ENVIRONMENTS)
def test_environments_without_a_seed_are_different_worlds(make):
    assert len({starts(make(**CAVE))[0] for _ in range(6)}) == 6
    assert len(set(starts(make(**CAVE), [None] * 3))) == 3


@pytest.mark.parametrize("make", ENVIRONMENTS)
def test_seeds_of_constructor_and_reset_are_one(make):
    wanted = starts(make(**CAVE), [7, None])
    assert len(set(wanted)) == 2
    for seed in (7, np.int64(7), np.uint8(7)):
        assert starts(make(seed=seed, **CAVE), [None, None]) == wanted
        assert starts(make(**CAVE), [seed, None]) == wanted
    env = make(seed=7, **CAVE)
    assert starts(env, [None, None, 7, None]) == wanted * 2
    assert starts(make(seed=8, **CAVE)) != wanted[:1]
    assert env.np_random_seed == 7 and isinstance(env.np_random, np.random.Generator)
    assert starts(make(seed=0, **CAVE)) == starts(make(**CAVE), [0])
    for wrong in (-1, 2**63, 1.5, "7"):
        with pytest.raises(ValueError, match="seed = .*: expected"):
            make(seed=wrong, **CAVE)
        with pytest.raises(ValueError, match="seed = .*: expected"):
            env.reset(seed=wrong)


def test_worlds_draw_their_first_seed():
    def crops(**seed):
        worlds = Worlds(2, agents=1, **seed, **CAVE)
        shown = [worlds.observe()["crop"].tobytes(), worlds.reset()["crop"].tobytes()]
        return shown + [worlds.poses().tobytes()]

    assert crops(seed=3) == crops(seed=np.int32(3))
    assert len({tuple(crops()) for _ in range(4)}) == 4
    given = Worlds(2, agents=1, **CAVE).reset([np.int64(3), 4])["crop"]
    assert (given == Worlds(2, agents=1, seed=3, **CAVE).observe()["crop"]).all()


def test_vectors_and_turns_have_worlds_of_their_own():
    def vector(seed=None):
        envs = gymnasium.vector.SyncVectorEnv([lambda: ExplorationEnv(**CAVE)] * 4)
        shown = envs.reset(seed=seed)[0]
        return [b"".join(shown[key][place].tobytes() for key in sorted(shown)) for place in range(4)]

    assert len(set(vector() + vector())) == 8
    assert vector(5) == vector([np.int64(seed) for seed in (5, 6, 7, 8)])

    def turns(make, **seed):
        env = parallel_to_aec(make())
        env.reset(**seed)
        return b"".join(array.tobytes() for array in env.observe("agent_0").values())

    unseeded = lambda: parallel_env(agents=2, **CAVE)
    assert len({turns(unseeded) for _ in range(4)}) == 4
    assert turns(lambda: parallel_env(agents=2, seed=7, **CAVE)) == turns(unseeded, seed=7)


def test_world_is_that_of_a_run():
    """The same velocities at the same ticks move the same bodies in a run."""
    plan = np.random.default_rng(5).uniform(-1, 1, (60, 2, 4)).astype(np.float32)
    scenario = maes.Scenario(agents=2, agents__share_period_ticks=0, seed=11, **{**CAVE, "duration": 12.0})
    worlds = Worlds(1, scenario, seed=11)
    for actions in plan:
        _, _, _, over, details = worlds.step(actions[None], begin_again=False)
    assert over[0] and 0 < details["explored"][0] < 1

    class Replay(maes.Controller):
        def decide(self, observation, ctx):
            shares = plan[min(observation.tick // 10, 59), ctx.agent].astype(float)
            body = ctx.body
            motion = maes.Motion.velocity(shares[:3] * body["speed_max_m_s"], shares[3] * body["turn_rate_max_rad_s"])
            return maes.Command(motion, maes.WakeCondition.at(observation.tick + 10))

    # A world has looked after its last step, which a run does at its next tick.
    scenario = scenario.replace(duration=12.02)
    result = maes.run(scenario, controller=Replay)
    assert result.tick == 601
    assert result.explored == details["explored"][0]
    assert result.columns("agents")["distance_m"][-2:] == pytest.approx(
        maes.run(scenario, controller=Replay).columns("agents")["distance_m"][-2:]
    )


def episode(worlds, steps=30):
    rng = np.random.default_rng(2)
    rows = []
    for _ in range(steps):
        shown, rewards, *_ = worlds.step(rng.uniform(-1, 1, (worlds.count, worlds.agents, 4)))
        rows.append((shown["crop"].copy(), shown["frontiers"].copy(), rewards.copy()))
    return rows


def test_worlds_do_not_depend_on_each_other():
    many, alone = Worlds(4, agents=2, seed=5, **CAVE), Worlds(1, agents=2, seed=7, **CAVE)
    rng = np.random.default_rng(3)
    for _ in range(40):
        actions = rng.uniform(-1, 1, (4, 2, 4))
        shown, rewards, *_ = many.step(actions, begin_again=False)
        one, reward, *_ = alone.step(actions[2:3], begin_again=False)
        assert all((shown[key][2] == one[key][0]).all() for key in shown)
        assert (rewards[2] == reward[0]).all()


def test_rewards_add_up_to_what_was_seen():
    env = ExplorationEnv(actions="frontier", **CAVE)
    env.reset(seed=1)
    total, over = 0.0, False
    while not over:
        shown, reward, explored, truncated, info = env.step(0)
        total, over = total + reward, explored or truncated
    assert 0.5 < info["explored"] <= 1.0 and total <= info["explored"]
    own = Worlds(1, agents=2, reward=lambda details: -details["collided"], **CAVE)
    assert set(np.unique(own.step(np.ones((1, 2, 4)))[1])) <= {-1.0, 0.0}
    bad = Worlds(1, agents=2, reward=lambda details: 1.0, **CAVE)
    with pytest.raises(ValueError, match="reward has shape"):
        bad.step(np.ones((1, 2, 4)))


PERIODS_REFUSED = [0.0, 0.03, 0.05, 0.07, 0.29, -1, 100.02, float("nan"), float("inf"), "0.2", None]


def test_steps_last_a_period():
    for period_s, steps in ((0.02, 50), (0.06, 17), (np.float64(0.2), 5), (1, 1)):
        worlds = Worlds(1, agents=1, period_s=period_s, **{**CAVE, "duration": 1.0})
        for number in range(1, steps + 1):
            _, _, _, over, _ = worlds.step(np.zeros((1, 1, 4)), begin_again=False)
            assert over[0] == (number == steps), (period_s, number)
        assert worlds.period_s == period_s


def test_worlds_end_by_the_rule_of_their_scenario(tmp_path):
    """All of an empty room is seen at once, and a body at rest covers one cell of it."""
    walls = np.ones((7, 7, 7), bool)
    walls[1:-1, 1:-1, 1:-1] = False
    maes.Map(walls).save(tmp_path / "room.m3dm")
    room = {"agents": 1, "duration": 1.0, "map": {"kind": "file", "file": str(tmp_path / "room.m3dm")}}
    for rule, is_done in (({}, True), ({"stop_when_covered": True}, False), ({"stop_when_explored": False}, False)):
        _, _, done, over, details = Worlds(1, seed=1, **room, **rule).step(np.zeros((1, 1, 4)))
        assert (details["explored"][0], bool(done[0]), bool(over[0])) == (1.0, is_done, False), rule


def test_wrong_use_names_the_thing():
    worlds = Worlds(2, agents=2, **CAVE)
    before = worlds.poses()
    for actions, message in [
        (np.full((2, 2, 4), np.nan), "world 0: action of agent 0: number 0 is NaN: expected -1 to 1"),
        (np.full((2, 2, 4), 2.0), "expected -1 to 1"),
        (np.zeros((2, 2, 3)), r"expected \(2, 2, 4\)"),
        (np.zeros(16), "shape"),
    ]:
        with pytest.raises(ValueError, match=message):
            worlds.step(actions)
    assert (worlds.poses() == before).all()
    # Threads step the worlds: the error is that of the first world, and no other world has moved.
    many = Worlds(16, agents=2, **CAVE)
    before = many.poses()
    actions = np.ones((16, 2, 4))
    actions[5:] = np.nan
    for _ in range(20):
        with pytest.raises(ValueError, match="world 5: action of agent 0: number 0 is NaN"):
            many.step(actions)
    assert (many.poses() == before).all()
    for keys, message in [
        ({"actions": "fly"}, "velocity"),
        *(({"period_s": period_s}, "period_s = .*: expected a multiple of 0.02 s") for period_s in PERIODS_REFUSED),
        ({"crop_radius": 100}, "crop_radius"),
        ({"agents__cmd_vel": [0]}, "cmd_vel"),
        ({"agents": 0}, "agents.count"),
        ({"agents__base_stations": [0]}, "agents.base_stations: expected"),
        ({"agents__mix": [{"controller": "lvd", "ids": [0]}]}, "agents.mix: expected"),
        ({"controller": "dsvp"}, "agents.controller: expected no key of a controller"),
        ({"agents": {"count": 2, "set": {"search_time": "budgeted"}}}, "agents.set.search_time: expected"),
        ({"energy": {"endurance_s": 60.0, "return_home": False}}, "energy.return_home: expected"),
        ({"energy__endurance_s": 60.0, "stop_when_back": True}, "stop_when_back: expected"),
    ]:
        with pytest.raises(maes.BadInput, match=message):
            Worlds(1, **{"agents": 2, **CAVE, **keys})
    with pytest.raises(ValueError, match="3 seeds: expected 2"):
        worlds.reset([1, 2, 3])
    worlds.close()
    for use in (worlds.reset, worlds.poses, lambda: worlds.step(np.zeros((2, 2, 4)))):
        with pytest.raises(RuntimeError, match="closed"):
            use()
    env = parallel_env(agents=2, **CAVE)
    with pytest.raises(RuntimeError, match="call reset"):
        env.step({})
    env.reset()
    with pytest.raises(ValueError, match="none for agent_1"):
        env.step({"agent_0": np.zeros(4)})
    frontier = ExplorationEnv(actions="frontier", **CAVE)
    frontier.reset()
    with pytest.raises(ValueError, match="whole number from 0 to 16"):
        frontier.step(17)


def test_actions_are_shares_up_to_rounding():
    """What a network in single or half precision makes of 1 is 1; anything else is refused."""
    limit = np.float32(1 + 1 / 1024)
    for actions in ("velocity", "waypoint"):
        wanted, rounded = (Worlds(1, agents=2, seed=3, actions=actions, **CAVE) for _ in range(2))
        width = wanted.action_width
        for _ in range(20):
            for worlds, value in ((wanted, 1.0), (rounded, limit)):
                worlds.step(np.full((1, 2, width), value) * [1, -1, 1, -1][:width])
        assert (wanted.poses() == rounded.poses()).all()
        for wrong in (1.01, -1.01, 1e300, np.inf, -np.inf, np.nan):
            given = np.zeros((1, 2, width))
            given[0, 1, 2] = wrong
            with pytest.raises(ValueError, match="world 0: action of agent 1: number 2 is .*: expected -1 to 1"):
                wanted.step(given)


@pytest.mark.parametrize("make", [ExplorationEnv, lambda **keys: parallel_env(agents=1, **keys)])
def test_actions_have_one_shape(make):
    def step(env, action):
        return env.step(action if isinstance(env, ExplorationEnv) else {"agent_0": action})

    env, frontier = make(**CAVE), make(actions="frontier", **CAVE)
    env.reset(), frontier.reset()
    before = env._worlds.poses()
    for wrong in (np.zeros((1, 4)), np.zeros((2, 2)), np.zeros(3), 0.0, np.zeros((4, 1))):
        with pytest.raises(ValueError, match=r"action of .* has shape \(.*\): expected \(4,\)"):
            step(env, wrong)
    for wrong in (np.zeros(4, complex), [1j, 0, 0, 0], ["1", "0", "0", "0"], [None] * 4):
        with pytest.raises(ValueError, match="action of .* has the type .*: expected real numbers"):
            step(env, wrong)
    assert (env._worlds.poses() == before).all()
    for right in (np.zeros(4), [0, 0, 0, 0], (0.0,) * 4, np.zeros(4, np.int8), np.zeros(4, np.float16)):
        step(env, right)
    for right in (0, np.int64(0), np.zeros((), int), [0], np.array([16])):
        step(frontier, right)
    for wrong in (np.zeros((1, 1)), [0, 1]):
        with pytest.raises(ValueError, match=r"has shape .*: expected \(\)"):
            step(frontier, wrong)
    with pytest.raises(ValueError, match="whole number from 0 to 16"):
        step(frontier, 0.5)
    with pytest.raises(ValueError, match=r"actions has the type complex128: expected real numbers"):
        Worlds(1, agents=1, **CAVE).step(np.zeros((1, 1, 4), complex))


def test_threads_have_worlds_of_their_own():
    expected = [rows[2] for rows in episode(Worlds(2, agents=2, seed=9, **CAVE))]
    found = []

    def work():
        found.append([rows[2] for rows in episode(Worlds(2, agents=2, seed=9, **CAVE))])

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 3
    for rewards in found:
        assert all((one == other).all() for one, other in zip(rewards, expected))


def _in_child(worlds, sender):
    shown, rewards, *_ = worlds.step(np.ones((2, 2, 4)))
    sender.send(rewards)


def test_worlds_go_on_after_a_fork():
    worlds, twin = (Worlds(2, agents=2, seed=4, **CAVE) for _ in range(2))
    expected = twin.step(np.ones((2, 2, 4)))[1]
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_in_child, args=(worlds, sender))
    child.start()
    assert receiver.poll(60) and (receiver.recv() == expected).all()
    child.join(60)
    assert child.exitcode == 0


def test_thousand_resets_leak_nothing():
    worlds = Worlds(1, agents=2, **CAVE)

    def resident_kib():
        with open("/proc/self/statm") as statm:
            return int(statm.read().split()[1]) * resource.getpagesize() // 1024

    sizes = []
    for number in range(1000):
        worlds.reset([number])
        worlds.step(np.ones((1, 2, 4)))
        if number in (199, 999):
            sizes.append(resident_kib())
    # One world of 20 cells along each axis takes some 100 KiB: a leak of each would be 80 MiB.
    assert sizes[1] - sizes[0] < 8 * 1024, f"{sizes} KiB"


def test_nearest_frontiers_are_those_of_all():
    few, all_of_them = (Worlds(2, agents=2, size=25, period_s=1.0, frontiers=count, seed=5) for count in (3, 1024))
    actions = np.random.default_rng(1).uniform(-1, 1, (60, 2, 2, 4)).astype(np.float32)
    shown = set()
    for action in actions:
        near, far = (worlds.step(action)[0]["frontiers"] for worlds in (few, all_of_them))
        np.testing.assert_array_equal(near, far[:, :, :3])
        shown.add(near.tobytes())
    assert len(shown) > 30


def test_seeds_and_rewards_have_bounds():
    with pytest.raises(maes.BadInput, match="seed = 9223372036854775808: expected"):
        Worlds(2, seed=2**63 - 1, **CAVE)
    last = Worlds(1, seed=2**63 - 1, **CAVE)
    with pytest.raises(maes.BadInput, match="seed = 9223372036854775808: expected"):
        last.reset()
    env = ExplorationEnv(reward=lambda details: details["distance_m"] * np.nan, **CAVE)
    env.reset()
    with pytest.raises(ValueError, match="reward is nan: expected finite numbers"):
        env.step(np.ones(4))
