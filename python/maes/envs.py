"""Environments for learning: worlds that are stepped with an action for every agent.

`Worlds` steps many of them at once in Rust, on all cores. `parallel_env` is one of them with the
interface of PettingZoo, and `ExplorationEnv` has a single agent and that of Gymnasium.

What an agent is shown, as arrays:

- `crop`: uint8, (K, K, K), K = 2 * crop_radius + 1: the states (`CellState`) of the cells around the
  body on its own map, indexed [x, y, z] in the axes of the map; outside the map all is wall.
- `own`: float32, (12,), each from -1 to 1: position / size of the map (3), velocity / greatest speed
  (3, frame `map`), cosine and sine of the heading, turn rate / greatest one, whether a task is under
  way, whether it has collided, known share of the map.
- `contacts`: float32, (agents - 1, 4): position of each agent in contact relative to the own one in
  metres, frame `map`, and 1; zeros for the others.
- `frontiers`: float32, (frontiers, 4): the centres of the nearest frontiers of its map by straight
  distance, relative to the body in metres, and 1; zeros where there are fewer.

Actions, one kind for all agents:

- "velocity": float32, (4,), -1 to 1: velocity along the axes of the body (x forward, y left, z up) as
  a share of its greatest speed, and turn rate as a share of its greatest; limited by the body.
- "waypoint": float32, (3,), -1 to 1: a point relative to the body as a share of `waypoint_m`, to which
  it goes by the shortest known path; it stops where no path is known.
- "frontier": whole number, 0 to frontiers: the index of the frontier to go to; `frontiers` continues.

The reward of a step is the share of the free cells that the agent has seen for the first time
itself; `reward` replaces it.

Seeds are whole numbers from 0 to 2**63 - 1, also those of NumPy. `seed` of a constructor seeds the
first reset, as `reset(seed=...)` does; without either, each environment draws its own from the
operating system. The seed in a scenario is not used.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv

from . import _maes
from .scenarios import Scenario

Floats = npt.NDArray[np.float64]
Reward = Callable[[dict[str, Floats]], npt.ArrayLike]

OWN = 12
PLACE = 4
METRES_MAX = np.float32(1e4)
TICK_S = 0.02
SEED_MAX = 2**63 - 1
# The seeds that are drawn leave room for counting on.
DRAWN = 2**62


def _scenario(scenario: Scenario | str | None, keys: dict[str, Any]) -> Scenario:
    made = scenario if isinstance(scenario, Scenario) else Scenario(scenario)
    return made.replace(**keys) if keys else made


def _seed(given: Any) -> int:
    """A seed as `int`; also of NumPy, whose integers Gymnasium does not take."""
    try:
        seed = operator.index(given)
    except TypeError:
        raise _maes.BadInput(f"seed = {given!r}: expected a whole number from 0 to 2**63 - 1, or None") from None
    if not 0 <= seed <= SEED_MAX:
        raise _maes.BadInput(f"seed = {seed}: expected 0 to 2**63 - 1")
    return seed


def _generator(seed: Any) -> tuple[np.random.Generator, int]:
    """A generator with its seed, which is that of the operating system without one."""
    return seeding.np_random(None if seed is None else _seed(seed))


class Worlds:
    """Worlds of one scenario with different seeds, stepped in Rust on all cores.

    `observe` returns arrays for all agents of all worlds, with two leading axes (worlds, agents);
    the same memory is written again by the next step. A world that has ended begins again with a
    new seed in the same step; what is shown is then its first observation.
    """

    def __init__(
        self,
        count: int,
        scenario: Scenario | str | None = None,
        *,
        seed: int | None = None,
        period_s: float = 0.2,
        actions: str = "velocity",
        crop_radius: int = 5,
        frontiers: int = 16,
        waypoint_m: float = 10.0,
        reward: Reward | None = None,
        **keys: Any,
    ) -> None:
        """`count` worlds with the seeds `seed`, `seed + 1` and so on, counted from a drawn one without
        `seed`; `period_s` is the sim time between two decisions; `keys` change the scenario."""
        first = int(_generator(None)[0].integers(DRAWN)) if seed is None else _seed(seed)
        self.scenario = _scenario(scenario, keys)
        self.count = count
        self.agents = int(self.scenario["agents.count"])
        self.actions = actions
        self.frontiers = frontiers
        self.side = 2 * crop_radius + 1
        self.action_width = {"velocity": 4, "waypoint": 3, "frontier": 1}.get(actions, 0)
        self._reward = reward
        self._next_seed = first + count
        self._native = _maes.Worlds(
            self.scenario._native,
            list(range(first, first + count)),
            ticks_per_step=round(period_s / TICK_S),
            crop_radius=crop_radius,
            frontiers=frontiers,
            actions=actions,
            waypoint_m=waypoint_m,
        )
        shape = (count, self.agents)
        self._arrays: dict[str, npt.NDArray[Any]] = {
            "crop": np.zeros((*shape, self.side, self.side, self.side), np.uint8),
            "own": np.zeros((*shape, OWN), np.float32),
            "contacts": np.zeros((*shape, max(self.agents - 1, 1), PLACE), np.float32),
            "frontiers": np.zeros((*shape, frontiers, PLACE), np.float32),
        }
        # The same memory without axes.
        self._flat = [array.reshape(-1) for array in self._arrays.values()]
        self._show()

    def _show(self) -> None:
        self._native.show(*self._flat)

    def observe(self) -> dict[str, npt.NDArray[Any]]:
        """What all agents are shown now, by name."""
        return self._arrays

    def reset(self, seeds: Sequence[int] | None = None) -> dict[str, npt.NDArray[Any]]:
        """Begin all worlds again with these seeds, or with the next ones."""
        if seeds is None:
            seeds = [self._draw() for _ in range(self.count)]
        if len(seeds) != self.count:
            raise ValueError(f"{len(seeds)} seeds: expected {self.count}")
        self._native.reset(list(enumerate(map(_seed, seeds))))
        self._show()
        return self._arrays

    def _draw(self) -> int:
        self._next_seed += 1
        return self._next_seed - 1

    def step(
        self, actions: npt.ArrayLike, *, begin_again: bool = True
    ) -> tuple[dict[str, npt.NDArray[Any]], Floats, npt.NDArray[np.bool_], npt.NDArray[np.bool_], dict[str, Any]]:
        """Step every world; `actions` has the shape (worlds, agents, numbers of an action).

        Returns observations, rewards (worlds, agents), whether each world is explored, whether its
        time is over, and details: `explored_gain` (share), `distance_m` and `collided`, each
        (worlds, agents), and `explored` (share, by world) before worlds begin again.
        """
        flat = np.ascontiguousarray(actions, np.float32)
        shape = (self.count, self.agents, self.action_width)
        if flat.shape != shape:
            raise ValueError(f"actions has shape {flat.shape}: expected {shape}")
        gains = self._native.step(flat.reshape(-1), *self._flat).reshape(self.count, self.agents, 3)
        shares, explored, over = self._native.status()
        details: dict[str, Any] = {
            "explored_gain": gains[..., 0],
            "distance_m": gains[..., 1],
            "collided": gains[..., 2],
            "explored": shares,
        }
        rewards = gains[..., 0] if self._reward is None else np.asarray(self._reward(details), float)
        if rewards.shape != (self.count, self.agents):
            raise ValueError(f"reward has shape {rewards.shape}: expected {(self.count, self.agents)}")
        over &= ~explored
        ended = np.flatnonzero(explored | over)
        if begin_again and len(ended):
            self._native.reset([(int(world), self._draw()) for world in ended])
            self._show()
        return self._arrays, rewards, explored, over, details

    def poses(self) -> npt.NDArray[np.float32]:
        """True position (m) and heading (rad) of all agents: (worlds, agents, 4)."""
        return self._native.poses().reshape(self.count, self.agents, 4)

    def team_map(self, world: int) -> npt.NDArray[np.uint8]:
        """Which cells of a world the team has seen to be free, indexed [x, y, z]. One copy."""
        x, y, z = self._native.size
        return self._native.team_map(world).reshape(z, y, x).transpose(2, 1, 0)

    def close(self) -> None:
        """Free the worlds; later calls raise."""
        self._native.close()

    def observation_space(self) -> spaces.Dict:
        """The space of what one agent is shown."""
        others = (max(self.agents - 1, 1), PLACE)
        near = (self.frontiers, PLACE)
        return spaces.Dict(
            {
                "crop": spaces.Box(0, 3, (self.side, self.side, self.side), np.uint8),
                "own": spaces.Box(-1, 1, (OWN,), np.float32),
                "contacts": spaces.Box(-METRES_MAX, METRES_MAX, others, np.float32),
                "frontiers": spaces.Box(-METRES_MAX, METRES_MAX, near, np.float32),
            }
        )

    def action_space(self) -> spaces.Space[Any]:
        """The space of the actions of one agent."""
        if self.actions == "frontier":
            return spaces.Discrete(self.frontiers + 1)
        return spaces.Box(-1, 1, (self.action_width,), np.float32)

    def shown(self, agent: int) -> dict[str, npt.NDArray[Any]]:
        """A copy of what an agent of the first world is shown."""
        return {key: array[0, agent].copy() for key, array in self._arrays.items()}

    def action(self, given: Any, agent: str) -> npt.NDArray[np.float32]:
        """The numbers of an action, or `ValueError`."""
        array = np.asarray(given, np.float32).reshape(-1)
        if array.shape != (self.action_width,):
            raise ValueError(f"action of {agent} has shape {np.shape(given)}: expected ({self.action_width},)")
        return array


class ParallelExploration(ParallelEnv[str, dict[str, Any], Any]):
    """A team in one world, as a PettingZoo `ParallelEnv`; agents are "agent_0", "agent_1" and so on.

    A new world is generated at each reset, with a seed that `np_random` draws. `state()` has the true poses of all agents (float32,
    (agents * 4,): x, y, z in metres and heading in rad) for a central critic.
    """

    metadata = {"name": "maes_exploration_v0", "render_modes": []}

    def __init__(self, scenario: Scenario | str | None = None, **arguments: Any) -> None:
        self.np_random, self.np_random_seed = _generator(arguments.get("seed"))
        self._worlds = Worlds(1, scenario, **arguments)
        self.render_mode = None
        self.possible_agents = [f"agent_{agent}" for agent in range(self._worlds.agents)]
        self.agents: list[str] = []
        self._observation_space = {agent: self._worlds.observation_space() for agent in self.possible_agents}
        self._action_space = {agent: self._worlds.action_space() for agent in self.possible_agents}
        count = PLACE * len(self.possible_agents)
        self.state_space = spaces.Box(-METRES_MAX, METRES_MAX, (count,), np.float32)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of what an agent is shown."""
        return self._observation_space[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """The space of its actions."""
        return self._action_space[agent]

    def _shown(self) -> dict[str, dict[str, Any]]:
        return {agent: self._worlds.shown(place) for place, agent in enumerate(self.possible_agents)}

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]]]:
        """Begin with a new world; a seed makes it and those of later resets repeatable."""
        if seed is not None:
            self.np_random, self.np_random_seed = _generator(seed)
        self._worlds.reset([int(self.np_random.integers(2**31))])
        self.agents = list(self.possible_agents)
        return self._shown(), {agent: {} for agent in self.agents}

    def step(self, actions: dict[str, Any]) -> tuple[dict[str, Any], ...]:
        """Step with an action for each agent."""
        if not self.agents:
            raise RuntimeError("the episode is over: call reset before step")
        if missing := [agent for agent in self.agents if agent not in actions]:
            raise ValueError(f"actions: none for {', '.join(missing)}")
        rows = [self._worlds.action(actions[agent], agent) for agent in self.possible_agents]
        _, rewards, explored, over, details = self._worlds.step([rows], begin_again=False)
        agents = list(enumerate(self.possible_agents))
        info = {
            agent: {
                "explored": float(details["explored"][0]),
                "explored_gain": float(details["explored_gain"][0, place]),
                "distance_m": float(details["distance_m"][0, place]),
                "collided": bool(details["collided"][0, place]),
            }
            for place, agent in agents
        }
        if explored[0] or over[0]:
            self.agents = []
        return (
            self._shown(),
            {agent: float(rewards[0, place]) for place, agent in agents},
            {agent: bool(explored[0]) for _, agent in agents},
            {agent: bool(over[0]) for _, agent in agents},
            info,
        )

    def state(self) -> npt.NDArray[np.float32]:
        """True poses of all agents: float32, (agents * 4,)."""
        return self._worlds.poses().reshape(-1)

    def render(self) -> None:
        """There are no pictures here; record a run instead."""

    def close(self) -> None:
        """Free the world; later calls raise."""
        self._worlds.close()


def parallel_env(scenario: Scenario | str | None = None, **arguments: Any) -> ParallelExploration:
    """A PettingZoo environment; the arguments are those of `Worlds`."""
    return ParallelExploration(scenario, **arguments)


class ExplorationEnv(gymnasium.Env[dict[str, Any], Any]):
    """A single agent in one world, as a Gymnasium environment.

    A new world is generated at each reset, with a seed that `np_random` draws.
    """

    metadata = {"render_modes": []}

    def __init__(self, scenario: Scenario | str | None = None, **arguments: Any) -> None:
        if scenario is None:
            arguments.setdefault("agents", 1)
        self._worlds = Worlds(1, scenario, **arguments)
        if self._worlds.agents != 1:
            raise _maes.BadInput(f"agents.count = {self._worlds.agents}: expected 1; parallel_env has teams")
        if (seed := arguments.get("seed")) is not None:
            self._np_random, self._np_random_seed = _generator(seed)
        self.render_mode = None
        self.observation_space = self._worlds.observation_space()
        self.action_space = self._worlds.action_space()
        self._is_over = True

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin with a new world; a seed makes it and those of later resets repeatable."""
        super().reset(seed=None if seed is None else _seed(seed))
        self._worlds.reset([int(self.np_random.integers(2**31))])
        self._is_over = False
        return self._worlds.shown(0), {}

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Step with an action."""
        if self._is_over:
            raise RuntimeError("the episode is over: call reset before step")
        row = self._worlds.action(action, "the agent")
        _, rewards, explored, over, details = self._worlds.step([[row]], begin_again=False)
        self._is_over = bool(explored[0] or over[0])
        info = {"explored": float(details["explored"][0]), "collided": bool(details["collided"][0, 0])}
        return self._worlds.shown(0), float(rewards[0, 0]), bool(explored[0]), bool(over[0]), info

    def close(self) -> None:
        """Free the world; later calls raise."""
        self._worlds.close()
