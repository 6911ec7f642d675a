"""Environments for learning: worlds that are stepped with an action for every agent.

`Worlds` steps many of them at once in Rust, on all cores. `parallel_env` is one of them with the
interface of PettingZoo, and `ExplorationEnv` has a single agent and that of Gymnasium, where it is
`gymnasium.make("maes/Exploration-v0")`; `ExplorationVectorEnv` is many of these over one `Worlds`.

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

With `observations="flat"` an environment joins them in one float32 vector, as
`gymnasium.spaces.flatten` does.

Actions, one kind for all agents:

- "velocity": float32, (4,), -1 to 1: velocity along the axes of the body (x forward, y left, z up) as
  a share of its greatest speed, and turn rate as a share of its greatest; limited by the body.
- "waypoint": float32, (3,), -1 to 1: a point relative to the body as a share of `waypoint_m`, to which
  it goes by the shortest known path; it stops where no path is known.
- "frontier": whole number, 0 to frontiers: the index of the frontier to go to; `frontiers` continues.

Shares up to 1/1024 beyond -1 and 1, such as rounding makes, count as -1 and 1; others are refused.

The reward of a step is the share of the free cells that the agent has seen for the first time
itself; `reward` replaces it.

Seeds are whole numbers from 0 to 2**63 - 1, also those of NumPy. `seed` of a constructor seeds the
first reset, as `reset(seed=...)` does; without either, each environment draws its own from the
operating system. Seed and controller in a scenario file are not used.

A world ends when explored, with `stop_when_covered` when covered, with `stop_when_explored = false`
after its duration alone. Keys that have no part in an environment are refused: controllers, base
stations, events.

A copy of an environment, by `copy.deepcopy` or a pickle, is a new one of the same scenario and
arguments, with the seed that was given last. Without a seed each copy draws its own.

`render_mode` "rgb_array" makes `render` return the layer of cells at the height of the first agent
from above, uint8 (height, width, 3): known free cells are light, unknown ones grey, walls dark, and
the agents are discs, rings where they are in another layer. "human" shows it in a window of
matplotlib at each step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import logger, spaces
from gymnasium.utils import EzPickle
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from pettingzoo import ParallelEnv
from pettingzoo.utils import BaseParallelWrapper

from . import _maes
from ._pictures import Window
from ._worlds import METRES_MAX, PLACE, Worlds, generator_of, world_seed
from .scenarios import Scenario, seed_of

__all__ = [
    "ExplorationEnv",
    "ExplorationVectorEnv",
    "FlatObservations",
    "ParallelExploration",
    "Worlds",
    "parallel_env",
]

MODES = ("human", "rgb_array")


def _parts(shown: Any, of: Callable[[npt.NDArray[Any]], Any]) -> Any:
    """A part of each array that is shown, or of the only one."""
    return {key: of(array) for key, array in shown.items()} if isinstance(shown, dict) else of(shown)


class _OneWorld(EzPickle):
    """What environments of one world have in common, whatever library they are for."""

    metadata: dict[str, Any]

    def _prepare(self, scenario: Scenario | str | None, arguments: dict[str, Any]) -> None:
        """Take the arguments of the constructor: those of `Worlds`, and `render_mode`."""
        EzPickle.__init__(self, scenario, **arguments)
        self.render_mode: str | None = arguments.pop("render_mode", None)
        if self.render_mode not in (None, *MODES):
            raise _maes.BadInput(f'render_mode = {self.render_mode!r}: expected None, "human" or "rgb_array"')
        self._worlds = Worlds(1, scenario, **arguments)
        self._window: Window | None = None
        self.metadata = {**self.metadata, "render_fps": max(round(1 / self._worlds.period_s), 1)}

    def _shown(self, agent: int) -> Any:
        """A copy of what an agent is shown."""
        return _parts(self._worlds.observe(), lambda array: array[0, agent].copy())

    def _note_seed(self, seed: int | None) -> None:
        """Keep a seed of `reset` for copies."""
        if seed is not None:
            self._ezpickle_kwargs["seed"] = seed_of(seed)

    def _details(self, details: dict[str, Any], agent: int) -> dict[str, Any]:
        """The details of a step for one agent."""
        return {
            "explored": float(details["explored"][0]),
            "explored_gain": float(details["explored_gain"][0, agent]),
            "distance_m": float(details["distance_m"][0, agent]),
            "collided": bool(details["collided"][0, agent]),
        }

    def _draw_window(self) -> None:
        """Show the world if that is asked for."""
        if self.render_mode == "human":
            self._window = self._window or Window()
            self._window.show(self._worlds.picture(0))

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The picture of `render_mode` "rgb_array"; "human" has shown it already."""
        if self.render_mode == "rgb_array":
            return self._worlds.picture(0)
        if self.render_mode is None:
            logger.warn('render() without a render_mode: expected "human" or "rgb_array" in the constructor')
        return None

    def close(self) -> None:
        """Free the world; later calls raise."""
        if self._window is not None:
            self._window.close()
        self._worlds.close()


class ParallelExploration(_OneWorld, ParallelEnv[str, Any, Any]):
    """A team in one world, as a PettingZoo `ParallelEnv`; agents are "agent_0", "agent_1" and so on.

    A new world is generated at each reset, with a seed that `np_random` draws. `state()` has the true
    poses of all agents (float32, (agents * 4,): x, y, z in metres and heading in rad) for a central
    critic.
    """

    metadata = {"name": "maes_exploration_v0", "render_modes": list(MODES), "is_parallelizable": True}

    def __init__(self, scenario: Scenario | str | None = None, **arguments: Any) -> None:
        """The arguments are those of `Worlds`, and `render_mode`."""
        self.np_random, self.np_random_seed = generator_of(arguments.get("seed"))
        self._prepare(scenario, arguments)
        self.possible_agents = [f"agent_{agent}" for agent in range(self._worlds.agents)]
        self.agents: list[str] = []
        self.observation_spaces = {agent: self._worlds.observation_space() for agent in self.possible_agents}
        self.action_spaces = {agent: self._worlds.action_space() for agent in self.possible_agents}
        count = PLACE * len(self.possible_agents)
        self.state_space = spaces.Box(-METRES_MAX, METRES_MAX, (count,), np.float32)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of what an agent is shown."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """The space of its actions."""
        return self.action_spaces[agent]

    def _all_shown(self) -> dict[str, Any]:
        return {agent: self._shown(place) for place, agent in enumerate(self.possible_agents)}

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin with a new world; a seed makes it and those of later resets repeatable."""
        if seed is not None:
            self.np_random, self.np_random_seed = generator_of(seed)
        self._note_seed(seed)
        self._worlds.reset([world_seed(self.np_random)])
        self.agents = list(self.possible_agents)
        self._draw_window()
        return self._all_shown(), {agent: {} for agent in self.agents}

    def step(self, actions: dict[str, Any]) -> tuple[dict[str, Any], ...]:
        """Step with an action for each agent."""
        if not self.agents:
            raise RuntimeError("the episode is over: call reset before step")
        if missing := [agent for agent in self.agents if agent not in actions]:
            raise ValueError(f"actions: none for {', '.join(missing)}")
        rows = [self._worlds.action(actions[agent], agent) for agent in self.possible_agents]
        _, rewards, explored, over, details = self._worlds.step([rows], begin_again=False)
        agents = list(enumerate(self.possible_agents))
        info = {agent: self._details(details, place) for place, agent in agents}
        self._draw_window()
        if explored[0] or over[0]:
            self.agents = []
        return (
            self._all_shown(),
            {agent: float(rewards[0, place]) for place, agent in agents},
            {agent: bool(explored[0]) for _, agent in agents},
            {agent: bool(over[0]) for _, agent in agents},
            info,
        )

    def state(self) -> npt.NDArray[np.float32]:
        """True poses of all agents: float32, (agents * 4,)."""
        return self._worlds.poses().reshape(-1)


def parallel_env(scenario: Scenario | str | None = None, **arguments: Any) -> ParallelExploration:
    """A PettingZoo environment; the arguments are those of `Worlds`."""
    return ParallelExploration(scenario, **arguments)


class FlatObservations(BaseParallelWrapper[str, Any, Any]):
    """Any PettingZoo `ParallelEnv` with each observation as one vector, as
    `gymnasium.wrappers.FlattenObservation` makes it of Gymnasium's."""

    def __init__(self, env: ParallelEnv[str, Any, Any]) -> None:
        super().__init__(env)
        inner = {agent: env.observation_space(agent) for agent in env.possible_agents}
        self.observation_spaces = {agent: spaces.flatten_space(space) for agent, space in inner.items()}
        self._inner = inner

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of what an agent is shown."""
        return self.observation_spaces[agent]

    def _flat(self, shown: dict[str, Any]) -> dict[str, Any]:
        return {agent: spaces.flatten(self._inner[agent], one) for agent, one in shown.items()}

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """As the wrapped environment does."""
        shown, info = self.env.reset(seed=seed, options=options)
        return self._flat(shown), info

    def step(self, actions: dict[str, Any]) -> tuple[dict[str, Any], ...]:
        """As the wrapped environment does."""
        shown, *rest = self.env.step(actions)
        return self._flat(shown), *rest


def _check_single(worlds: Worlds) -> None:
    if worlds.agents != 1:
        raise _maes.BadInput(f"agents.count = {worlds.agents}: expected 1; parallel_env has teams")


class ExplorationEnv(_OneWorld, gymnasium.Env[Any, Any]):
    """A single agent in one world, as a Gymnasium environment.

    A new world is generated at each reset, with a seed that `np_random` draws.
    """

    metadata = {"render_modes": list(MODES)}

    def __init__(self, scenario: Scenario | str | None = None, **arguments: Any) -> None:
        """The arguments are those of `Worlds`, and `render_mode`."""
        if scenario is None:
            arguments.setdefault("agents", 1)
        self._prepare(scenario, arguments)
        _check_single(self._worlds)
        if (seed := arguments.get("seed")) is not None:
            self._np_random, self._np_random_seed = generator_of(seed)
        self.observation_space = self._worlds.observation_space()
        self.action_space = self._worlds.action_space()
        self._is_over = True

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin with a new world; a seed makes it and those of later resets repeatable."""
        super().reset(seed=None if seed is None else seed_of(seed))
        self._note_seed(seed)
        self._worlds.reset([world_seed(self.np_random)])
        self._is_over = False
        self._draw_window()
        return self._shown(0), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Step with an action."""
        if self._is_over:
            raise RuntimeError("the episode is over: call reset before step")
        row = self._worlds.action(action, "the agent")
        _, rewards, explored, over, details = self._worlds.step([[row]], begin_again=False)
        self._is_over = bool(explored[0] or over[0])
        self._draw_window()
        info = self._details(details, 0)
        return self._shown(0), float(rewards[0, 0]), bool(explored[0]), bool(over[0]), info


class ExplorationVectorEnv(EzPickle, VectorEnv[Any, Any, Any]):
    """Many worlds with a single agent each, as a Gymnasium `VectorEnv` that steps all of them in Rust.

    It has the worlds of a `SyncVectorEnv` of `ExplorationEnv` with the same seeds in `reset`, and the
    same results in every `AutoresetMode`. `seed` of the constructor seeds environment i with
    `seed + i`. Observations are copies unless `copy` is false: then each step overwrites them.
    """

    metadata = {"render_modes": ["rgb_array"]}

    def __init__(
        self,
        num_envs: int,
        scenario: Scenario | str | None = None,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        render_mode: str | None = None,
        seed: int | None = None,
        **arguments: Any,
    ) -> None:
        """Further arguments are those of `Worlds`."""
        named = {"autoreset_mode": autoreset_mode, "copy": copy, "render_mode": render_mode, "seed": seed}
        EzPickle.__init__(self, num_envs, scenario, **named, **arguments)
        if render_mode not in (None, "rgb_array"):
            raise _maes.BadInput(f'render_mode = {render_mode!r}: expected None or "rgb_array"')
        if scenario is None:
            arguments.setdefault("agents", 1)
        self._worlds = Worlds(num_envs, scenario, seed=seed, **arguments)
        _check_single(self._worlds)
        self.num_envs, self.render_mode, self.copy = num_envs, render_mode, copy
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space = self._worlds.observation_space()
        self.single_action_space = self._worlds.action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._generators = [generator_of(None if seed is None else seed + place)[0] for place in range(num_envs)]
        self._has_ended: npt.NDArray[np.bool_] = np.ones(num_envs, bool)

    def _shown(self) -> Any:
        is_copied = self.copy
        return _parts(self._worlds.observe(), lambda array: array[:, 0].copy() if is_copied else array[:, 0])

    def _begin(self, chosen: npt.NDArray[np.bool_]) -> None:
        """Begin these worlds again."""
        self._worlds.begin((int(place), world_seed(self._generators[place])) for place in np.flatnonzero(chosen))

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin all worlds again, or those of `options["reset_mask"]`; `seed` is a whole number, of which
        environment i gets `seed + i`, or a list with a seed or None for each."""
        if seed is None:
            seed = [None] * self.num_envs
        elif np.ndim(seed) == 0:
            seed = [seed_of(seed) + place for place in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{len(seed)} seeds: expected {self.num_envs}")
        chosen = np.asarray((options or {}).get("reset_mask", np.ones(self.num_envs, bool)))
        if chosen.shape != (self.num_envs,) or chosen.dtype != np.bool_:
            given = f"{chosen.dtype} {chosen.shape}"
            raise ValueError(f"options['reset_mask'] is {given}: expected bool ({self.num_envs},)")
        for place, one in enumerate(seed):
            if chosen[place] and one is not None:
                self._generators[place] = generator_of(one)[0]
        self._begin(chosen)
        self._has_ended[chosen] = False
        return self._shown(), {}

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step every world with its action, (num_envs, numbers of an action), or (num_envs,) for
        frontiers."""
        begins = self._has_ended
        if begins.any() and self.autoreset_mode != AutoresetMode.NEXT_STEP:
            raise RuntimeError(f"episode {np.flatnonzero(begins)[0]} is over: call reset before step")
        rows = self._worlds.rows(actions)
        if begins.any():
            # Their action counts for nothing, as in other vectors.
            rows[begins] = 0.0
        _, rewards, explored, over, details = self._worlds.step(rows[:, None], begin_again=False)
        rewards = np.where(begins, 0.0, rewards[:, 0])
        explored, over = explored & ~begins, over & ~begins
        self._has_ended = explored | over
        infos: dict[str, Any] = {}
        at_once = self._has_ended & (self.autoreset_mode == AutoresetMode.SAME_STEP)
        if at_once.any():
            shown = self._shown()
            infos["final_obs"] = np.full(self.num_envs, None, object)
            for place in np.flatnonzero(at_once):
                infos["final_obs"][place] = _parts(shown, lambda array: array[place].copy())
            infos["final_info"] = self._infos(details, at_once)
            infos["_final_obs"] = infos["_final_info"] = at_once
            self._has_ended = self._has_ended & ~at_once
        if (again := at_once | begins).any():
            self._begin(again)
        return self._shown(), rewards, explored, over, {**infos, **self._infos(details, ~again)}

    def _infos(self, details: dict[str, Any], of: npt.NDArray[np.bool_]) -> dict[str, Any]:
        """The details of a step for some environments, each with a mask of those that have it."""
        if not of.any():
            return {}
        columns = {key: details[key][:, 0] for key in ("explored_gain", "distance_m")}
        columns |= {"explored": details["explored"], "collided": details["collided"][:, 0] > 0}
        infos = {key: np.where(of, column, column.dtype.type(0)) for key, column in columns.items()}
        return infos | {f"_{key}": of for key in columns}

    def render(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """The pictures of all worlds, with `render_mode` "rgb_array"."""
        if self.render_mode is None:
            return None
        return tuple(self._worlds.picture(world) for world in range(self.num_envs))

    def close_extras(self, **keys: Any) -> None:
        """Free the worlds; later calls raise."""
        self._worlds.close()


gymnasium.register(
    "maes/Exploration-v0",
    entry_point="maes.envs:ExplorationEnv",
    vector_entry_point="maes.envs:ExplorationVectorEnv",
)
