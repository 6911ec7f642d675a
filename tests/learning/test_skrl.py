"""skrl: IPPO on a team, a policy for each agent."""

import dataclasses

import torch
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
from skrl.multi_agents.torch.ippo import IPPO, IPPO_CFG
from skrl.trainers.torch import SequentialTrainer

import maes.envs


class Policy(GaussianMixin, Model):
    def __init__(self, env, agent):
        observed, acted = env.observation_space(agent), env.action_space(agent)
        Model.__init__(self, observation_space=observed, action_space=acted, device=env.device)
        GaussianMixin.__init__(self, clip_actions=True)
        self.net = torch.nn.Linear(self.num_observations, self.num_actions)
        self.log_std = torch.nn.Parameter(torch.zeros(self.num_actions))

    def compute(self, inputs, role):
        return torch.tanh(self.net(inputs["observations"])), {"log_std": self.log_std}


class Value(DeterministicMixin, Model):
    def __init__(self, env, agent):
        observed, acted = env.observation_space(agent), env.action_space(agent)
        Model.__init__(self, observation_space=observed, action_space=acted, device=env.device)
        DeterministicMixin.__init__(self)
        self.net = torch.nn.Linear(self.num_observations, 1)

    def compute(self, inputs, role):
        return self.net(inputs["observations"]), {}


def test_ippo_trains_a_team(cave, tmp_path):
    env = wrap_env(maes.envs.parallel_env(agents=2, observations="flat", **cave), wrapper="pettingzoo")
    agents = env.possible_agents
    models = {agent: {"policy": Policy(env, agent), "value": Value(env, agent)} for agent in agents}
    before = {agent: models[agent]["policy"].net.weight.detach().clone() for agent in agents}
    settings = IPPO_CFG(rollouts=64, learning_epochs=2, mini_batches=2)
    settings.experiment.directory = str(tmp_path)
    # skrl 2.1.1 takes its own default, no arguments for anyone, for settings that lack the agents.
    for field in dataclasses.fields(settings):
        if getattr(settings, field.name) == {}:
            setattr(settings, field.name, {agent: {} for agent in agents})
    team = IPPO(
        possible_agents=agents,
        models=models,
        memories={agent: RandomMemory(memory_size=64, num_envs=env.num_envs, device=env.device) for agent in agents},
        observation_spaces=env.observation_spaces,
        state_spaces=env.state_spaces,
        action_spaces=env.action_spaces,
        device=env.device,
        cfg=settings,
    )
    SequentialTrainer(env=env, agents=team, cfg={"timesteps": 200, "disable_progressbar": True}).train()
    for agent in agents:
        weight = models[agent]["policy"].net.weight
        assert torch.isfinite(weight).all() and not torch.equal(before[agent], weight)
