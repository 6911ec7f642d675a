"""RLlib: its PPO with the default networks, on one agent and on a team with one policy."""

import math

import pytest
import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

import maes.envs


@pytest.fixture(scope="module", autouse=True)
def cluster(tmp_path_factory):
    ray.init(num_cpus=1, include_dashboard=False, _temp_dir=str(tmp_path_factory.mktemp("ray")), log_to_driver=False)
    yield
    ray.shutdown()


def settings(name):
    config = PPOConfig().environment(name).env_runners(num_env_runners=0, rollout_fragment_length=64)
    return config.training(train_batch_size_per_learner=256, minibatch_size=64, num_epochs=2)


def assert_trains(config):
    algorithm = config.build_algo()
    try:
        results = [algorithm.train() for _ in range(2)]
    finally:
        algorithm.stop()
    losses = [learner["total_loss"] for name, learner in results[-1]["learners"].items() if name != "__all_modules__"]
    assert losses and all(map(math.isfinite, losses))
    assert math.isfinite(results[-1]["env_runners"]["episode_return_mean"])


def test_one_agent_trains(cave):
    register_env("one", lambda _: maes.envs.ExplorationEnv(observations="flat", **cave))
    assert_trains(settings("one"))


def test_team_trains_one_policy(cave):
    team = {"agents": 2, "observations": "flat", **cave}
    register_env("team", lambda _: ParallelPettingZooEnv(maes.envs.parallel_env(**team)))
    assert_trains(settings("team").multi_agent(policies={"all"}, policy_mapping_fn=lambda *_, **__: "all"))
