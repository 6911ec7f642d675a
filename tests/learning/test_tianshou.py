"""Tianshou: DQN over the frontiers of one agent."""

import gymnasium
import torch
from tianshou.algorithm import DQN
from tianshou.algorithm.modelfree.dqn import DiscreteQLearningPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv
from tianshou.utils.net.common import Net
from tianshou.utils.torch_utils import policy_within_training_step

import maes.envs


def test_dqn_updates(cave):
    def env():
        return maes.envs.ExplorationEnv(actions="frontier", observations="flat", **cave)

    envs = DummyVectorEnv([env] * 4)
    space = env().action_space
    assert isinstance(space, gymnasium.spaces.Discrete)
    net = Net(state_shape=env().observation_space.shape, action_shape=int(space.n), hidden_sizes=[32])
    policy = DiscreteQLearningPolicy(model=net, action_space=space, eps_training=0.5)
    algorithm = DQN(policy=policy, optim=AdamOptimizerFactory(lr=1e-3), gamma=0.95)
    buffer = VectorReplayBuffer(2000, 4)
    collector = Collector(algorithm, envs, buffer, exploration_noise=True)
    collector.reset()
    collected = collector.collect(n_step=800, random=True)
    assert collected.n_collected_episodes > 0 and len(buffer) >= 800
    before = torch.nn.utils.parameters_to_vector(net.parameters()).clone()
    with policy_within_training_step(policy):
        for _ in range(5):
            algorithm.update(buffer, sample_size=64)
    after = torch.nn.utils.parameters_to_vector(net.parameters())
    assert torch.isfinite(after).all() and not torch.equal(before, after)
