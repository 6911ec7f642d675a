"""SuperSuit: wrappers of observations and actions, and vectors in processes of their own."""

import multiprocessing

import numpy as np
import supersuit
from pettingzoo.test import parallel_api_test

import maes.envs


def test_wrappers_keep_the_interface(cave):
    env = maes.envs.parallel_env(agents=2, observations="flat", **cave)
    env = supersuit.dtype_v0(env, np.float32)
    env = supersuit.frame_stack_v1(env, 2)
    env = supersuit.clip_reward_v0(env)
    env = supersuit.black_death_v3(env)
    parallel_api_test(env, num_cycles=60)


def test_vectors_in_processes_are_those_in_this_one(cave):
    multiprocessing.set_start_method("spawn", force=True)
    env = maes.envs.parallel_env(agents=2, observations="flat", seed=5, **cave)
    env = supersuit.pettingzoo_env_to_vec_env_v1(env)
    here, there = (supersuit.concat_vec_envs_v1(env, 2, num_cpus=cpus, base_class="gymnasium") for cpus in (0, 2))
    try:
        assert np.array_equal(here.reset(seed=3)[0], there.reset(seed=3)[0])
        here.action_space.seed(1)
        for _ in range(20):
            actions = np.stack([here.action_space.sample() for _ in range(here.num_envs)])
            one, other = here.step(actions), there.step(actions)
            assert all(np.array_equal(a, b) for a, b in zip(one[:4], other[:4]))
    finally:
        there.close()
