"""Many worlds at once, and the checks of their seeds and actions; `maes.envs` describes them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import EzPickle, seeding

from . import _maes
from ._pictures import of_layer
from .scenarios import Scenario, changes_of, seed_of

Floats = npt.NDArray[np.float64]
Shown = dict[str, npt.NDArray[Any]]
Reward = Callable[[dict[str, Floats]], npt.ArrayLike]

OWN = 12
PLACE = 4
METRES_MAX = np.float32(1e4)
TICK_S = 0.02
# The longest period.
TICKS_MAX = 5000
# The seeds that are drawn leave room for counting on.
DRAWN = 2**62


# The keys of controllers, whose place the actions take.
_OF_CONTROLLERS = ("agents.controller", "agents.set", "energy.return_home", "energy.reserve")


def scenario_of(scenario: Scenario | str | None, keys: dict[str, Any]) -> Scenario:
    """The scenario of worlds; those of files may say what a controller is to do, `keys` may not."""
    for key, _ in changes_of(keys):
        if key.startswith(_OF_CONTROLLERS):
            raise _maes.BadInput(f"{key}: expected no key of a controller, whose place the actions take")
    made = scenario if isinstance(scenario, Scenario) else Scenario(scenario)
    return made.replace(**keys) if keys else made


def ticks_of(period_s: Any) -> int:
    """The ticks of a period, which is a whole number of them from 0.02 to 100 s."""
    try:
        ticks = float(period_s / TICK_S)
    except (TypeError, ValueError, OverflowError):
        ticks = math.nan
    if not (1 <= ticks <= TICKS_MAX + 0.5 and abs(ticks - round(ticks)) < 1e-6):
        raise _maes.BadInput(f"period_s = {period_s!r}: expected a multiple of 0.02 s, 0.02 to 100")
    return round(ticks)


def generator_of(seed: Any) -> tuple[np.random.Generator, int]:
    """A generator with its seed, which is that of the operating system without one."""
    return seeding.np_random(None if seed is None else seed_of(seed))


def world_seed(generator: np.random.Generator) -> int:
    """The seed of the next world."""
    return int(generator.integers(2**31))


def _numbers(actions: Any, name: str) -> npt.NDArray[Any]:
    """Actions as an array of real numbers, or `ValueError`."""
    array = np.asarray(actions)
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} has the type {array.dtype}: expected real numbers")
    return array


def _narrow(array: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Numbers as the worlds take them; what is too large becomes infinite, which they refuse."""
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32)


class Worlds(EzPickle):
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
        observations: str = "dict",
        **keys: Any,
    ) -> None:
        """`count` worlds with the seeds `seed`, `seed + 1` and so on, counted from a drawn one without
        `seed`; `period_s` is the sim time between two decisions, a multiple of 0.02 s; with
        `observations="flat"` what an agent is shown is one vector; `keys` change the scenario."""
        named = {
            "seed": seed, "period_s": period_s, "actions": actions, "crop_radius": crop_radius,
            "frontiers": frontiers, "waypoint_m": waypoint_m, "reward": reward, "observations": observations,
        }  # fmt: skip
        EzPickle.__init__(self, count, scenario, **named, **keys)
        if observations not in ("dict", "flat"):
            raise _maes.BadInput(f'observations = {observations!r}: expected "dict" or "flat"')
        ticks = ticks_of(period_s)
        first = int(generator_of(None)[0].integers(DRAWN)) if seed is None else seed_of(seed)
        if isinstance(count, int):
            # The last of them.
            seed_of(first + max(count, 1) - 1)
        self.scenario = scenario_of(scenario, keys)
        self.count = count
        self.agents = int(self.scenario["agents.count"])
        self.actions = actions
        self.frontiers = frontiers
        self.side = 2 * crop_radius + 1
        self.action_width = {"velocity": 4, "waypoint": 3, "frontier": 1}.get(actions, 0)
        self.period_s = float(period_s)
        self._action_shape = () if actions == "frontier" else (self.action_width,)
        self._reward = reward
        self._next_seed = first + count
        self._native = _maes.Worlds(
            self.scenario._native,
            list(range(first, first + count)),
            ticks_per_step=ticks,
            crop_radius=crop_radius,
            frontiers=frontiers,
            actions=actions,
            waypoint_m=waypoint_m,
        )
        shape = (count, self.agents)
        self._arrays: Shown = {
            "crop": np.zeros((*shape, self.side, self.side, self.side), np.uint8),
            "own": np.zeros((*shape, OWN), np.float32),
            "contacts": np.zeros((*shape, max(self.agents - 1, 1), PLACE), np.float32),
            "frontiers": np.zeros((*shape, frontiers, PLACE), np.float32),
        }
        # The same memory without axes.
        self._flat = [array.reshape(-1) for array in self._arrays.values()]
        # All of an agent in one vector, in the order of the space.
        self._parts = [self._arrays[key].reshape(*shape, -1) for key in self._dict_space()]
        width = sum(part.shape[-1] for part in self._parts)
        self._joined = np.zeros((*shape, width), np.float32) if observations == "flat" else None
        self._show()

    def _show(self) -> None:
        self._native.show(*self._flat)
        self._join()

    def _join(self) -> None:
        if self._joined is not None:
            np.concatenate(self._parts, axis=-1, out=self._joined)

    def observe(self) -> Any:
        """What all agents are shown now: arrays by name, or one array with `observations="flat"`."""
        return self._arrays if self._joined is None else self._joined

    def reset(self, seeds: Sequence[int] | None = None) -> Any:
        """Begin all worlds again with these seeds, or with the next ones."""
        if seeds is None:
            seeds = [self._draw() for _ in range(self.count)]
        if len(seeds) != self.count:
            raise ValueError(f"{len(seeds)} seeds: expected {self.count}")
        self.begin(enumerate(map(seed_of, seeds)))
        return self.observe()

    def begin(self, seeds: Iterable[tuple[int, int]]) -> None:
        """Begin some worlds again: their numbers, each with a seed."""
        self._native.reset(list(seeds))
        self._show()

    def _draw(self) -> int:
        self._next_seed += 1
        return seed_of(self._next_seed - 1)

    def step(
        self, actions: npt.ArrayLike, *, begin_again: bool = True
    ) -> tuple[Any, Floats, npt.NDArray[np.bool_], npt.NDArray[np.bool_], dict[str, Any]]:
        """Step every world; `actions` has the shape (worlds, agents, numbers of an action).

        Returns observations, rewards (worlds, agents), whether each world is explored (with
        `stop_when_covered`: covered), whether its time is over, and details: `explored_gain` (share),
        `distance_m` and `collided`, each (worlds, agents), and `explored` (share, by world) before
        worlds begin again.
        """
        flat = _narrow(_numbers(actions, "actions"))
        shape = (self.count, self.agents, self.action_width)
        if flat.shape != shape:
            raise ValueError(f"actions has shape {flat.shape}: expected {shape}")
        gains = self._native.step(flat.reshape(-1), *self._flat).reshape(self.count, self.agents, 3)
        self._join()
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
        if not np.isfinite(rewards).all():
            raise ValueError(f"reward is {rewards[~np.isfinite(rewards)][0]}: expected finite numbers")
        over &= ~explored
        ended = np.flatnonzero(explored | over)
        if begin_again and len(ended):
            self.begin((int(world), self._draw()) for world in ended)
        return self.observe(), rewards, explored, over, details

    def poses(self) -> npt.NDArray[np.float32]:
        """True position (m) and heading (rad) of all agents: (worlds, agents, 4)."""
        return self._native.poses().reshape(self.count, self.agents, 4)

    def team_map(self, world: int) -> npt.NDArray[np.uint8]:
        """Which cells of a world the team has seen to be free, indexed [x, y, z]. One copy."""
        x, y, z = self._native.size
        return self._native.team_map(world).reshape(z, y, x).transpose(2, 1, 0)

    def picture(self, world: int) -> npt.NDArray[np.uint8]:
        """The layer at the height of the first agent of a world from above, see `maes.envs`: uint8,
        (height, width, 3)."""
        poses = self.poses()[world].astype(float)
        cell_m = float(self.scenario["map.cell_m"])
        x, y, layers = self._native.size
        layer = min(max(int(poses[0, 2] / cell_m), 0), layers - 1)
        states = self._native.layer(world, layer).reshape(y, x)
        return of_layer(states, layer, poses / np.array([cell_m, cell_m, cell_m, 1.0]))

    def close(self) -> None:
        """Free the worlds; later calls raise."""
        self._native.close()

    def observation_space(self) -> spaces.Space[Any]:
        """The space of what one agent is shown."""
        return self._dict_space() if self._joined is None else spaces.flatten_space(self._dict_space())

    def _dict_space(self) -> spaces.Dict:
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

    def rows(self, given: Any) -> npt.NDArray[np.float32]:
        """The actions of worlds with one agent, (worlds, numbers of an action), or `ValueError`."""
        array = _numbers(given, "actions")
        if self.actions == "frontier" and array.shape == (self.count,):
            array = array[:, None]
        if array.shape != (self.count, self.action_width):
            raise ValueError(f"actions has shape {array.shape}: expected {(self.count, *self._action_shape)}")
        return array.astype(np.float32)

    def action(self, given: Any, agent: str) -> npt.NDArray[np.float32]:
        """The numbers of an action, or `ValueError`."""
        array = _numbers(given, f"action of {agent}")
        is_single = self.actions == "frontier" and array.shape == ()
        if not is_single and array.shape != (self.action_width,):
            raise ValueError(f"action of {agent} has shape {array.shape}: expected {self._action_shape}")
        return _narrow(array).reshape(-1)
