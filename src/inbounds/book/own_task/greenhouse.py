"""The greenhouse of *Your own environment*: many at once, a rule that runs it, and a planner that knows the day.

    >>> from inbounds.book.own_task import play
    >>> by_rule = play(thermostat(), GreenhouseBatch, range(20)).mean()
    >>> bool(play(constant([3.0, 0.0]), GreenhouseBatch, range(20)).mean() < by_rule < planned(range(20)).mean())
    True

The chapter writes one greenhouse as a plain Gymnasium environment and holds it against this batch. What the policies
that it shows have earned is in `results/greenhouse`; ``python -m
inbounds.book.own_task.greenhouse_runs`` trains them anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from inbounds.book.own_task.comparing import Actor, Floats, constant

__all__ = ["GreenhouseBatch", "constant", "planned", "thermostat"]

LOW, HIGH = np.array([-2, 0], np.float32), np.array([8, 1], np.float32)
"""The box: power of the heat pump [kW], opening of the vent [share]."""
BOX = spaces.Box(LOW, HIGH, dtype=np.float32)
SEEN = spaces.Box(-np.inf, np.inf, (5,), dtype=np.float32)
DAY = 96
"""Quarters of an hour."""
COLD, HOT = 5.0, 35.0
"""Beyond them the crop is lost [°C]."""


def weather(quarter: Any, season: Any, sky: Any) -> tuple[Any, Any]:
    """Return temperature outside [°C] and sun [kW], of a quarter of the day; a day is its season [°C] and its sky."""
    hour = quarter / 4
    outside = season + 6 * np.sin(2 * np.pi * (hour - 9) / 24)
    return outside, 6 * sky * np.maximum(np.sin(np.pi * (hour - 6) / 12), 0)


def a_quarter_later(inside: Any, outside: Any, sun: Any, power: Any, vent: Any) -> Any:
    """Return the temperature [°C] after a quarter of an hour of constant power [kW] and vent, by the exact solution.

    Example:
        >>> round(float(a_quarter_later(20.0, 10.0, 0.0, 3.5, 0.0)), 6)  # 3.5 kW hold 10 °C more than outside
        20.0
    """
    loss = 0.35 + 1.5 * vent
    rest = outside + (power + sun) / loss
    return rest + (inside - rest) * np.exp(-0.25 * loss / 0.8)


def reward_of(inside: Any, power: Any) -> Any:
    """Return growth, a bell around 21 °C, minus 0.02 for each kilowatt."""
    return np.exp(-(((inside - 21) / 6) ** 2)) - 0.02 * np.abs(power)


def observe(inside: Any, quarter: Any, season: Any, sky: Any) -> NDArray[np.float32]:
    """Return what a policy sees: inside, outside [°C], sun [kW], and the hour as a point on a circle."""
    angle = 2 * np.pi * quarter / DAY
    seen = inside, *weather(quarter, season, sky), np.sin(angle), np.cos(angle)
    return np.stack(np.broadcast_arrays(*seen), -1).astype(np.float32)


def draw_day(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return first temperature [°C], season [°C] and clearness of the sky of a new day."""
    return rng.uniform([10, 0, 0.2], [25, 12, 1])


class GreenhouseBatch(VectorEnv[Any, Any, Any]):
    """Greenhouses side by side, each with a generator of its own.

    Args:
        num_envs: how many.

    Example:
        >>> envs = GreenhouseBatch(3)
        >>> envs.reset(seed=[0, 1, 2])[0].shape
        (3, 5)
    """

    single_observation_space, single_action_space = SEEN, BOX

    def __init__(self, num_envs: int) -> None:
        self.num_envs = num_envs
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        self.observation_space = batch_space(SEEN, num_envs)
        self.action_space = batch_space(BOX, num_envs)
        self.rngs = [np.random.default_rng() for _ in range(num_envs)]
        self.state = np.zeros((4, num_envs))  # inside, quarter, season, sky

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        """Begin new days, drawn anew where a seed is given; an integer seeds greenhouse i with `seed + i`."""
        if isinstance(seed, int):
            seed = range(seed, seed + self.num_envs)
        for i in range(self.num_envs):
            if seed is not None and seed[i] is not None:
                self.rngs[i], _ = seeding.np_random(seed[i])
            self.begin(i)
        return observe(*self.state), {}

    def begin(self, i: int) -> None:
        """Let the day of one greenhouse begin."""
        inside, season, sky = draw_day(self.rngs[i])
        self.state[:, i] = inside, 0, season, sky

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Go on by a quarter of an hour; a day that is over is followed by the next."""
        inside, quarter, season, sky = self.state  # four views
        power, vent = np.clip(actions, LOW, HIGH).astype(np.float64).T
        inside[:] = a_quarter_later(inside, *weather(quarter, season, sky), power, vent)
        reward = reward_of(inside, power)
        quarter += 1
        terminated = (inside <= COLD) | (inside >= HOT)
        truncated = quarter == DAY
        obs, info = observe(*self.state), {}
        if (over := terminated | truncated).any():
            info = {"final_obs": obs, "_final_obs": over}
            for i in np.flatnonzero(over):
                self.begin(int(i))
            obs = observe(*self.state)  # the first of the new days
        return obs, reward, terminated, truncated, info


def thermostat(aim: float = 21.0, gain: float = 2.0, opens: float = 23.0) -> Actor:
    """Return a rule of two lines: heat in proportion to the cold below the aim, open the vent above a temperature.

    Args:
        aim: [°C].
        gain: [kW per °C].
        opens: where the vent begins to open; it is wide open 2 °C above [°C].

    Example:
        >>> import numpy as np
        >>> thermostat()(np.array([[19.0, 0, 0, 0, 0], [24.0, 0, 0, 0, 0]])).tolist()
        [[4.0, 0.0], [0.0, 0.5]]
    """

    def act(obs: NDArray[Any]) -> NDArray[Any]:
        power = np.clip(gain * (aim - obs[:, 0]), 0, HIGH[0])
        vent = np.clip((obs[:, 0] - opens) / 2, 0, 1)
        return np.stack([power, vent], -1).astype(np.float32)

    return act


def planned(days: Sequence[int], cells: int = 241, steps: int = 33) -> Floats:
    """Return what a planner earns on each of some days `[N]` that knows the day's whole weather beforehand.

    Dynamic programming, from midnight back, over a grid of temperatures, with linear interpolation between them; then
    the plan is played in the exact simulator. Three kinds of action suffice: heat with the vent shut, vent without the
    pump, cool with the vent shut or open.

    Args:
        days: seeds of the resets.
        cells: temperatures of the grid.
        steps: actions of each kind.

    Example:
        >>> bool((planned([0, 1], cells=61, steps=9) > 70).all())
        True
    """
    state = GreenhouseBatch(len(days))
    state.reset(seed=list(days))
    inside, _, season, sky = state.state.copy()
    heat, cool, vent = np.linspace(0, HIGH[0], steps), np.linspace(LOW[0], 0, steps), np.linspace(0, 1, steps)
    none, shut = np.zeros(steps), np.zeros(steps)
    power = np.concatenate([heat, none, cool, cool])  # [K]
    opening = np.concatenate([shut, vent, shut, shut + 1])
    grid = np.linspace(COLD, HOT, cells)
    values = np.zeros((DAY + 1, len(days), cells))

    def worth(quarter: int, temperature: Any) -> Any:
        """Return the worth `[N, ..., K]` of each action at temperatures `[N, ..., 1]`."""
        outside, sun = (x.reshape(-1, *[1] * (temperature.ndim - 1)) for x in weather(quarter, season, sky))
        after = a_quarter_later(temperature, outside, sun, power, opening)
        place = np.clip((after - COLD) / (HOT - COLD) * (cells - 1), 0, cells - 1 - 1e-9)
        left = place.astype(np.int64)
        row = np.arange(len(days)).reshape(-1, *[1] * (temperature.ndim - 1))
        ahead = values[quarter + 1][row, left]
        ahead = ahead + (place - left) * (values[quarter + 1][row, left + 1] - ahead)
        alive = (after > COLD) & (after < HOT)
        return reward_of(after, power) + np.where(alive, ahead, 0.0)

    for quarter in reversed(range(DAY)):
        for cell in range(cells):  # one column at a time: [N, K]
            values[quarter][:, cell] = worth(quarter, np.full((len(days), 1), grid[cell])).max(-1)
    earned, running = np.zeros(len(days)), np.ones(len(days), np.bool_)
    for quarter in range(DAY):
        best = worth(quarter, inside[:, None]).argmax(-1)
        inside = a_quarter_later(inside, *weather(quarter, season, sky), power[best], opening[best])
        earned += np.where(running, reward_of(inside, power[best]), 0.0)
        running &= (inside > COLD) & (inside < HOT)
    return earned
