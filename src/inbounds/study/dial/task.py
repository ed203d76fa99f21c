r"""The task: a sign is shown per dimension, and the action should lie at a fraction of the box on that side.

Each of A dimensions shows s_i = ±1, drawn anew in every step. With the executed action u = min(max(a, −1), 1),

$$ r = −(1/A) Σ_i [ (u_i − g s_i)² + c x_i² ],   g = f (1 + c), $$

where x is the executed action u, or the raw action a, as the task charges. Completing the square, what is charged on u
gives

$$ (u − g s)² + c u² = (1 + c) (u − f s)² + g² c / (1 + c) : $$

f is where the best action would lie without a box, in half-ranges: inside below 1, on the edge from 1 on, with a slope
that pulls outwards beyond 1. An episode is one step, so that no discount and no credit over time play a part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

Charged: TypeAlias = Literal["executed", "raw"]


@dataclass(frozen=True)
class DialTask:
    """The knobs, and the returns that they make: of doing nothing, and of the best action.

    Raises:
        ValueError: a fraction that is not positive, a negative cost, no dimension, or another charge.

    Example:
        >>> task = DialTask(fraction=0.5, cost=1.0)
        >>> task.target, task.best, task.idle_return, task.best_return
        (1.0, 0.5, -1.0, -0.5)
        >>> task.score([-1.0, -0.5]).tolist()
        [0.0, 1.0]
    """

    fraction: float
    """f, where the best action would lie without a box, in half-ranges."""
    cost: float = 0.0
    """c, price of a squared action."""
    dims: int = 1
    """A, dimensions of the action."""
    charged: Charged = "executed"
    """Which action pays: the one that is executed, or the one that was drawn."""

    def __post_init__(self) -> None:
        if not self.fraction > 0 or self.cost < 0 or self.dims < 1:
            raise ValueError(
                f"fraction must be positive, cost not negative, dims at least 1; got {self.fraction}, {self.cost}, "
                f"{self.dims}: where the best action is to do nothing, no score is defined"
            )
        if self.charged not in ("executed", "raw"):
            raise ValueError(f"charged must be executed or raw, got {self.charged!r}")

    @property
    def target(self) -> float:
        """The g of the reward: what the task asks for before the cost."""
        return self.fraction * (1 + self.cost)

    @property
    def best(self) -> float:
        """The best action on the side of the sign, in half-ranges."""
        return min(self.fraction, 1.0)

    @property
    def idle_return(self) -> float:
        """Return of the action 0 in every step."""
        return -(self.target**2)

    @property
    def best_return(self) -> float:
        """Return of the best action in every step: no policy earns more."""
        return -((self.best - self.target) ** 2) - self.cost * self.best**2

    def reward(self, action: NDArray[Any], sign: NDArray[Any]) -> NDArray[np.float64]:
        """Return the reward `[...]` of raw actions `[..., A]` under signs `[..., A]`."""
        executed = np.minimum(np.maximum(action, -1), 1)
        paid = action if self.charged == "raw" else executed
        reward: NDArray[np.float64] = -((executed - self.target * sign) ** 2 + self.cost * paid**2).mean(-1)
        return reward

    def score(self, returns: ArrayLike) -> NDArray[np.float64]:
        """Return (R − idle)/(best − idle), `[...]`: 0 is doing nothing, 1 the best."""
        return (np.asarray(returns, np.float64) - self.idle_return) / (self.best_return - self.idle_return)


class DialEnv(VectorEnv[Any, Any, Any]):
    """One dial per seed, in NumPy; each draws its signs from a generator of its own.

    Args:
        task: the knobs.
        num_envs: tasks stepped at once, S.

    Example:
        >>> envs = DialEnv(DialTask(0.5), num_envs=2)
        >>> sign, _ = envs.reset(seed=[3, 4])
        >>> reward = envs.step(0.5 * sign)[1]  # of the best action
        >>> bool((reward == 0).all())
        True
    """

    def __init__(self, task: DialTask, num_envs: int) -> None:
        self.task, self.num_envs = task, num_envs
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (task.dims,), np.float64)
        self.single_observation_space = gymnasium.spaces.Box(-1.0, 1.0, (task.dims,), np.float64)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        self._over, self._cut = np.ones(num_envs, np.bool_), np.zeros(num_envs, np.bool_)
        self._generators = [np.random.default_rng(seed) for seed in range(num_envs)]
        self._draw()

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Show the first signs `[S, A]`; an integer seeds environment i with `seed + i`, a list each with its own.

        Raises:
            ValueError: there are not as many seeds as environments.
        """
        if seed is not None:
            if isinstance(seed, int | np.integer):
                seed = [seed + i for i in range(self.num_envs)]
            seeds = list(seed)
            if len(seeds) != self.num_envs:
                raise ValueError(f"{self.num_envs} environments need {self.num_envs} seeds, got {len(seeds)}")
            for i, one in enumerate(seeds):
                if one is not None:  # None goes on with the generator that is there
                    self._generators[i] = np.random.default_rng(one)
        self._draw()
        return self._signs[0].copy(), {}

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[
        NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:
        """Pay for raw actions `[S, A]`, end all episodes and show the next signs."""
        reward = self.task.reward(actions, self._signs[self._t])
        self._t += 1
        if self._t == len(self._signs):
            self._draw()
        return self._signs[self._t].copy(), reward, self._over.copy(), self._cut.copy(), {}

    def _draw(self) -> None:
        """Draw signs for many steps at once, `[T, S, A]`: a call of a generator costs more than a step."""
        shape = (1024, self.task.dims)
        self._signs = np.stack([2.0 * g.integers(0, 2, shape) - 1 for g in self._generators], 1)
        self._t = 0
