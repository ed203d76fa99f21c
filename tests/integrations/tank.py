"""A tank with two valves and a box that is symmetric about nothing: small enough to train on in a test."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

LOW, HIGH = np.float32([-2.0, 0.0]), np.float32([8.0, 1.0])
HORIZON = 16


class Tank(gymnasium.Env):
    """x ← 0.8 x + 0.1 a₁ − 0.5 a₂, to be held at 1; truncated after 16 steps. It keeps what was asked of it."""

    observation_space = spaces.Box(-np.inf, np.inf, (2,), np.float32)
    action_space = spaces.Box(LOW, HIGH, dtype=np.float32)

    def __init__(self) -> None:
        self.asked: list[np.ndarray] = []

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[np.ndarray, dict]:
        super().reset(seed=seed)
        self.x, self.elapsed = self.np_random.uniform(-1, 1), 0
        return self._obs(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        self.asked.append(np.array(action))
        self.x = 0.8 * self.x + 0.1 * float(action[0]) - 0.5 * float(action[1])
        self.elapsed += 1
        return self._obs(), -((self.x - 1) ** 2), False, self.elapsed == HORIZON, {}

    def _obs(self) -> np.ndarray:
        return np.float32([self.x, self.elapsed / HORIZON])


class BehindSigmoid(gymnasium.ActionWrapper):
    """The tank for a Gaussian: the sigmoid belongs to the environment, written without the package."""

    def __init__(self) -> None:
        super().__init__(Tank())
        self.action_space = spaces.Box(-50.0, 50.0, (2,), np.float32)  # wide enough never to clip

    def action(self, action: np.ndarray) -> np.ndarray:
        return np.float32(LOW + (HIGH - LOW) / (1 + np.exp(-np.float64(action))))
