"""A small world with an exact arithmetic of its own, so that physics plays no part in a test of learning."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space


class PointEnv(VectorEnv):
    """N points in the plane, drawn to the origin by their policy: x ← 0.9 x + 0.3 a, reward −|x|² − 0.1 |a|².

    It terminates beyond |x| = 1.5 and is truncated after 20 steps, starts anywhere in the unit square, resets in the
    same step and saves its state. ``poisoned`` robots see NaN.
    """

    def __init__(
        self,
        num_envs: int,
        low: tuple[float, ...] = (-1.0, -1.0),
        high: tuple[float, ...] = (1.0, 1.0),
        poisoned: tuple[int, ...] = (),
        saves: bool = True,
        squash: bool = False,
        dtype: Any = np.float64,
    ) -> None:
        self.num_envs, self.poisoned, self.squash, self.saves = num_envs, list(poisoned), squash, saves
        self.single_action_space = gymnasium.spaces.Box(
            np.array(low, dtype), np.array(high, dtype), dtype=dtype
        )
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (3,), np.float64)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        self.generators = [np.random.default_rng(0) for _ in range(num_envs)]
        self.x = np.zeros((num_envs, 2))
        self.elapsed = np.zeros(num_envs, int)
        if saves:
            self.get_state, self.set_state = self._get_state, self._set_state

    def reset(self, *, seed=None, options=None):
        if seed is not None:
            self.generators = [np.random.default_rng(s) for s in seed]
        for i in range(self.num_envs):
            self._start(i)
        return self._obs(), {}

    def step(self, actions):
        a = np.tanh(actions / 2) if self.squash else actions
        self.x = 0.9 * self.x + 0.3 * a
        self.elapsed += 1
        reward = -np.square(self.x).sum(1) - 0.1 * np.square(a).sum(1)
        reward[self.poisoned] = np.nan
        terminated = np.abs(self.x).max(1) > 1.5
        truncated = (self.elapsed >= 20) & ~terminated
        info = {}
        over = terminated | truncated
        if over.any():
            final = np.full(self.num_envs, None, dtype=object)
            for i in np.flatnonzero(over):
                final[i] = self._obs()[i]
                self._start(i)
            info = {"final_obs": final, "_final_obs": over}
        return self._obs(), reward, terminated, truncated, info

    def _start(self, i: int) -> None:
        self.x[i] = self.generators[i].uniform(-1, 1, 2)
        self.elapsed[i] = 0

    def _obs(self) -> np.ndarray:
        obs = np.column_stack([self.x, self.elapsed / 20])
        obs[self.poisoned] = np.nan
        return obs

    def _get_state(self) -> dict[str, Any]:
        states = [g.bit_generator.state for g in self.generators]
        return {"x": self.x.copy(), "elapsed": self.elapsed.copy(), "generators": states}

    def _set_state(self, state: dict[str, Any]) -> None:
        self.x, self.elapsed = state["x"].copy(), state["elapsed"].copy()
        for generator, saved in zip(self.generators, state["generators"], strict=True):
            generator.bit_generator.state = saved
