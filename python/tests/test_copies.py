"""Copies, by `copy` and by pickles in processes that were spawned."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import cloudpickle
import numpy as np
import pytest

import maes
from maes.envs import ExplorationEnv, ExplorationVectorEnv, Worlds, parallel_env

CAVE = {"size": 20, "duration": 20.0, "map__spheres__radius_max": 5}


def pickled(value):
    return pickle.loads(pickle.dumps(value))


def first(env):
    """What the first reset shows, as bytes."""
    shown = env.reset()[0]
    return b"".join(np.asarray(array).tobytes() for array in shown.get("agent_0", shown).values())


COPIES = [copy.copy, copy.deepcopy, pickled, lambda value: cloudpickle.loads(cloudpickle.dumps(value))]


@pytest.mark.parametrize("copied", COPIES)
def test_scenarios_and_maps_copy(copied, tmp_path):
    scenario = maes.Scenario(size=20, seed=4, lidar__range_m=7.3, agents=3)
    assert copied(scenario) == scenario and copied([scenario])[0]["lidar.range_m"] == 7.3
    assert copied(scenario).replace(body={"kind": "aerial"}) == scenario.replace(body={"kind": "aerial"})
    shape = maes.Map.generate(size=(20, 24, 30), cell_m=0.5)
    assert copied(shape) == shape and copied(shape).cell_m == 0.5 and copied(shape).size == (20, 24, 30)
    shape.save(tmp_path / "map.m3dm")
    of_file = maes.Scenario(map={"kind": "file", "file": str(tmp_path / "map.m3dm"), "size": None})
    assert copied(of_file).map() == of_file.map()
    (tmp_path / "beside.toml").write_text(of_file.to_toml().replace(str(tmp_path / "map.m3dm"), "map.m3dm"))
    beside = maes.Scenario(tmp_path / "beside.toml")
    assert copied(beside) == beside and copied(beside).replace(seed=9).map() == of_file.map()


MAKERS = [ExplorationEnv, lambda **keys: parallel_env(agents=2, **keys), lambda **keys: ExplorationVectorEnv(2, **keys)]


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("copied", COPIES[1:])
def test_copy_of_an_environment_has_its_seed(make, copied):
    env = make(seed=7, **CAVE)
    wanted = first(make(seed=7, **CAVE))
    env.reset()
    assert first(copied(env)) == wanted
    # One that was never given a seed draws its own, as do its copies.
    unseeded = make(**CAVE)
    assert len({first(copied(unseeded)) for _ in range(3)} | {first(unseeded)}) == 4


@pytest.mark.parametrize("make", MAKERS[:2])
def test_copy_has_the_seed_of_the_last_reset(make):
    env = make(seed=7, **CAVE)
    env.reset(seed=8)
    assert first(copy.deepcopy(env)) == first(make(seed=8, **CAVE))
    worlds = Worlds(2, agents=1, seed=3, **CAVE)
    worlds.step(np.ones((2, 1, 4)))
    assert (pickled(worlds).observe()["crop"] == Worlds(2, agents=1, seed=3, **CAVE).observe()["crop"]).all()


def test_spawned_processes_take_them():
    scenario = maes.Scenario(size=20, agents=1)
    envs = [ExplorationEnv(scenario, seed=seed) for seed in (1, 2)]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(maes.Scenario.map, scenario).result() == scenario.map()
        there = list(pool.map(ExplorationEnv.reset, envs))
    for env, (shown, _) in zip(envs, there):
        assert all((shown[key] == array).all() for key, array in env.reset()[0].items())
