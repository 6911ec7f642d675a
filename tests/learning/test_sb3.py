"""stable-baselines3: PPO on dictionaries, and on a vector of SuperSuit that shares the policy of a team."""

import numpy as np
import supersuit
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.env_util import make_vec_env

import maes.envs


def trained(policy, env, steps):
    """A model after some updates, which have changed it."""
    # Without a seed, since vectors of SuperSuit 3.11 have no method `seed`.
    model = PPO(policy, env, n_steps=64, batch_size=64, n_epochs=2, device="cpu")
    before = torch.nn.utils.parameters_to_vector(model.policy.parameters()).clone()
    model.learn(steps)
    after = torch.nn.utils.parameters_to_vector(model.policy.parameters())
    assert torch.isfinite(after).all() and not torch.equal(before, after)
    assert model.num_timesteps >= steps
    return model


def test_one_agent_learns_from_dictionaries(cave):
    check_env(maes.envs.ExplorationEnv(**cave))
    env = make_vec_env("maes/Exploration-v0", n_envs=4, seed=1, env_kwargs=cave)
    model = trained("MultiInputPolicy", env, 1024)
    action, _ = model.predict(env.reset(), deterministic=True)
    assert env.step(action)[1].shape == (4,)
    assert np.isfinite([episode["r"] for episode in model.ep_info_buffer]).all() and model.ep_info_buffer


def test_team_shares_a_policy(cave):
    env = maes.envs.parallel_env(agents=3, actions="frontier", observations="flat", **cave)
    env = supersuit.pettingzoo_env_to_vec_env_v1(env)
    env = supersuit.concat_vec_envs_v1(env, 2, num_cpus=1, base_class="stable_baselines3")
    assert env.num_envs == 6
    trained("MlpPolicy", env, 1024)
