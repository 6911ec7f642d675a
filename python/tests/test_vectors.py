"""What learning libraries take for granted: vectors, registered names, pictures and flat observations."""

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from maes.envs import ExplorationEnv, ExplorationVectorEnv, FlatObservations, Worlds, parallel_env

CAVE = {"size": 20, "duration": 4.0, "stop_when_explored": False, "map__spheres__radius_max": 5}
NAME = "maes/Exploration-v0"


def equal(one, other):
    """Whether two nested values are the same, arrays of NumPy included."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(equal(one[key], other[key]) for key in one)
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(equal, one, other))
    return np.array_equal(one, other)


def details(infos):
    """The details of a step, each with its mask and the values of the environments that have it."""
    result = {}
    for key, value in infos.items():
        if not key.startswith("_"):
            mask = infos[f"_{key}"]
            result[key] = (mask.tolist(), details(value) if isinstance(value, dict) else list(value[mask]))
    return result


@pytest.mark.parametrize(("actions", "observations"), [("velocity", "dict"), ("frontier", "flat")])
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_vector_is_that_of_gymnasium(mode, actions, observations):
    keys = {**CAVE, "actions": actions, "observations": observations}
    ours = ExplorationVectorEnv(3, autoreset_mode=mode, **keys)
    theirs = SyncVectorEnv([lambda: ExplorationEnv(**keys)] * 3, autoreset_mode=mode)
    assert ours.observation_space == theirs.observation_space and ours.action_space == theirs.action_space
    assert ours.metadata["autoreset_mode"] == mode
    assert equal(ours.reset(seed=5)[0], theirs.reset(seed=5)[0])
    ours.action_space.seed(1)
    ended = np.zeros(3, int)
    for _ in range(60):
        chosen = ours.action_space.sample()
        here, there = ours.step(chosen), theirs.step(chosen)
        assert all(equal(one, other) for one, other in zip(here[:4], there[:4]))
        assert equal(details(here[4]), details(there[4]))
        done = here[2] | here[3]
        ended += done
        if mode == AutoresetMode.DISABLED and done.any():
            with pytest.raises(RuntimeError, match=f"episode {done.argmax()} is over: call reset"):
                ours.step(chosen)
            again = [vector.reset(options={"reset_mask": done.copy()})[0] for vector in (ours, theirs)]
            assert equal(*again)
    assert (ended >= 2).all()
    kept, other = (vector.reset(seed=[5, None, 7])[0] for vector in (ours, theirs))
    if observations == "dict":
        kept, other = kept["crop"], other["crop"]
    assert equal(kept[[0, 2]], other[[0, 2]])


def test_ids_are_registered():
    env = gymnasium.make(NAME, actions="frontier", **CAVE)
    assert isinstance(env.unwrapped, ExplorationEnv)
    for how in ("sync", "vector_entry_point"):
        vector = gymnasium.make_vec(NAME, 2, how, **CAVE)
        assert vector.reset(seed=3)[0]["crop"].shape == (2, 11, 11, 11)
        vector.close()
    for mode in AutoresetMode:
        vector = gymnasium.make_vec(NAME, 2, "async", vector_kwargs={"autoreset_mode": mode, "context": "spawn"}, **CAVE)
        assert vector.reset(seed=3)[0]["crop"].shape == (2, 11, 11, 11)
        vector.close()
        assert gymnasium.make_vec(NAME, 2, autoreset_mode=mode, **CAVE).metadata["autoreset_mode"] == mode
    flat = gymnasium.make_vec(NAME, 2, observations="flat", **CAVE)
    assert flat.reset(seed=3)[0].shape == (2, *ExplorationEnv(observations="flat", **CAVE).observation_space.shape)


def test_pictures_are_a_layer():
    env = gymnasium.make(NAME, render_mode="rgb_array", **{**CAVE, "size": 30, "duration": 20.0})
    check_env(env.unwrapped)
    env.reset(seed=4)
    before = env.render()
    for _ in range(10):
        env.step(np.array([1, 0, 0, 0.5], np.float32))
    after = env.render()
    assert before.shape == after.shape == (480, 480, 3) and before.dtype == np.uint8
    light = [(picture == 236).all(-1).mean() for picture in (before, after)]
    assert 0.01 < light[0] < light[1] < 1.0, "more is known"
    # The border of a map is wall, and the disc of the agent is there.
    assert (after[:24] == (40, 40, 48)).all() and (after == (230, 159, 0)).all(-1).sum() > 100
    team = parallel_env(agents=3, render_mode="rgb_array", **CAVE)
    team.reset(seed=4)
    colours = {tuple(colour) for colour in team.render().reshape(-1, 3)}
    assert len(colours - {tuple(colour) for colour in before.reshape(-1, 3)}) >= 1
    vector = ExplorationVectorEnv(2, render_mode="rgb_array", **CAVE)
    vector.reset()
    assert len(vector.render()) == 2
    for make in (ExplorationEnv, lambda **keys: parallel_env(agents=2, **keys)):
        with pytest.raises(ValueError, match="render_mode = 'ansi': expected"):
            make(render_mode="ansi", **CAVE)


@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
def test_window_shows_each_step():
    import matplotlib.pyplot as plt

    env = ExplorationEnv(render_mode="human", **CAVE)
    env.reset(seed=1)
    image = plt.figure("maes").axes[0].images[0]
    before = image.get_array().copy()
    env.step(np.ones(4, np.float32))
    assert env.render() is None and (image.get_array() != before).any()
    env.close()
    assert not plt.fignum_exists("maes")


def test_flat_observations():
    flat, wide = ExplorationEnv(seed=2, observations="flat", **CAVE), ExplorationEnv(seed=2, **CAVE)
    wrapped = gymnasium.wrappers.FlattenObservation(ExplorationEnv(seed=2, **CAVE))
    assert flat.observation_space == wrapped.observation_space and flat.observation_space.dtype == np.float32
    assert equal(flat.reset()[0], wrapped.reset()[0])
    assert equal(gymnasium.spaces.unflatten(wide.observation_space, flat.step(np.ones(4))[0])["crop"], first_step(wide))
    team = FlatObservations(parallel_env(agents=2, seed=2, **CAVE))
    other = parallel_env(agents=2, seed=2, observations="flat", **CAVE)
    assert team.observation_space("agent_1") == other.observation_space("agent_1")
    assert team.observation_spaces.keys() == {"agent_0", "agent_1"} == team.action_spaces.keys()
    assert equal(team.reset()[0], other.reset()[0])
    actions = {agent: np.ones(4) for agent in team.agents}
    assert equal(team.step(actions)[0], other.step(actions)[0])
    many = Worlds(3, agents=2, seed=2, observations="flat", **CAVE)
    assert many.observe().shape == (3, 2, *many.observation_space().shape)
    assert equal(many.reset([2, 3, 4])[1, 1], spaces.flatten(wide_space(), second_agent(3)))
    held = ExplorationVectorEnv(2, observations="flat", copy=False, **CAVE)
    assert np.shares_memory(held.reset(seed=1)[0], held.step(held.action_space.sample())[0])
    for make in (ExplorationEnv, lambda **keys: Worlds(2, **keys), lambda **keys: gymnasium.make_vec(NAME, 2, **keys)):
        with pytest.raises(ValueError, match="observations = 'wide': expected"):
            make(observations="wide", **CAVE)


def wide_space():
    return Worlds(1, agents=2, **CAVE).observation_space()


def second_agent(seed):
    shown = Worlds(1, agents=2, seed=seed, **CAVE).observe()
    return {key: array[0, 1] for key, array in shown.items()}


def first_step(env):
    env.reset()
    return env.step(np.ones(4))[0]["crop"]
