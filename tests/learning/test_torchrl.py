"""TorchRL: specs, batches of environments, and a policy gradient over its collector."""

import torch
from tensordict.nn import TensorDictModule
from tensordict.nn.distributions import NormalParamExtractor
from torchrl.envs import GymWrapper, PettingZooWrapper, SerialEnv
from torchrl.envs.utils import check_env_specs
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import maes.envs


def test_specs_hold(cave):
    check_env_specs(GymWrapper(maes.envs.ExplorationEnv(**cave)))
    team = maes.envs.parallel_env(agents=3, actions="frontier", **cave)
    check_env_specs(PettingZooWrapper(team, use_mask=False))


def test_worlds_of_a_batch_differ_and_ppo_updates(cave):
    env = SerialEnv(4, lambda: GymWrapper(maes.envs.ExplorationEnv(observations="flat", **cave)))
    first = env.reset()["observation"]
    assert len({row.numpy().tobytes() for row in first}) == 4
    width, actions = first.shape[-1], env.action_spec.shape[-1]
    net = torch.nn.Sequential(torch.nn.Linear(width, 2 * actions), NormalParamExtractor())
    actor = ProbabilisticActor(
        TensorDictModule(net, ["observation"], ["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        return_log_prob=True,
    )
    critic = ValueOperator(torch.nn.Linear(width, 1), in_keys=["observation"])
    loss = ClipPPOLoss(actor, critic)
    advantage = GAE(gamma=0.99, lmbda=0.95, value_network=critic)
    optimiser = torch.optim.Adam(loss.parameters(), 1e-3)
    before = net[0].weight.detach().clone()
    for _ in range(3):
        with torch.no_grad():
            rollout = env.rollout(64, actor, break_when_any_done=False)
            advantage(rollout)
        found = loss(rollout)
        total = found["loss_objective"] + found["loss_critic"] + found["loss_entropy"]
        optimiser.zero_grad()
        total.backward()
        optimiser.step()
        assert torch.isfinite(total)
    assert not torch.equal(before, net[0].weight)
