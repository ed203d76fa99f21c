r"""Running statistics of observations, one set per seed.

With count n, mean m and sum of squared deviations q (Welford 1962), an observation x updates

$$ m ← m + (x − m)/n,   q ← q + (x − m_{before})(x − m_{after}), $$

and is then seen by the networks as (x − m)/√(q/n + ε), clipped to ±10.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

CLIP = 10.0  # standard deviations
EPSILON = 1e-8  # keeps a constant observation finite


class RunningNormalizer:
    """Running mean and variance of the observations of S seeds, in float64.

    Args:
        num_seeds: seeds, S.
        obs_dim: numbers of an observation, O.
        dtype: of the observations handed out.

    Example:
        >>> import numpy as np
        >>> normalizer = RunningNormalizer(num_seeds=1, obs_dim=1)
        >>> for x in (1.0, 3.0):
        ...     normalizer.update(np.array([[x]]))
        >>> normalizer(np.array([[5.0]])).tolist()  # mean 2, standard deviation 1
        [[3.0]]
    """

    def __init__(self, num_seeds: int, obs_dim: int, dtype: Any = np.float32) -> None:
        self.count = 0
        self.mean = np.zeros((num_seeds, obs_dim))
        self.squares = np.zeros((num_seeds, obs_dim))
        self.dtype = np.dtype(dtype)

    def update(self, obs: NDArray[Any]) -> None:
        """Take in one observation per seed, `[S, O]`."""
        self.count += 1
        deviation = obs - self.mean
        self.mean += deviation / self.count
        self.squares += deviation * (obs - self.mean)

    def __call__(self, obs: NDArray[Any]) -> NDArray[Any]:
        """Return observations `[S, O]` normalised by the statistics so far, without taking them in."""
        return np.minimum(np.maximum((obs - self.mean) / self.std, -CLIP), CLIP).astype(self.dtype)

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviations `[S, O]` of the observations so far, none of them zero."""
        return np.sqrt(self.squares / max(self.count, 1) + EPSILON)

    def state_dict(self) -> dict[str, Any]:
        """Return everything that the future depends on."""
        return {"count": self.count, "mean": self.mean.copy(), "squares": self.squares.copy()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go back to a state."""
        self.count = state["count"]
        self.mean[:], self.squares[:] = state["mean"], state["squares"]
