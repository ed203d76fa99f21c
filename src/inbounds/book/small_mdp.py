r"""A decision process small enough to know everything about it, with one bounded action.

N states, one action a in [−1, 1]. Both the dynamics and the reward are polynomials in the action,

$$ P(s' | s, a) = (1 − w) L(s, s') + w R(s, s'),  w = (1 + a)/2,   r(s, a) = r_0(s) + r_1(s) a + r_2(s) a², $$

so that a policy enters through two numbers per state, E[a] and E[a²], whatever its family. With them value,
return and the policy gradient are sums and linear systems: the truth that estimates are held against. A row of L or R
may sum to less than one; what is missing is the probability that the episode ends.

The process itself is here, and the answers of linear algebra. What is *estimated* from samples is the chapters'
business.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from inbounds.distributions import quadrature

__all__ = ["Episodes", "SmallMDP", "ledge", "slope", "squashed_moments"]

_RULE = quadrature.trapezoid(101)


class Episodes(NamedTuple):
    """E episodes, padded to T steps with zeros; arrays `[E, T]`, or `[..., E, T]` for a batch of policies.

    Example:
        >>> import numpy as np
        >>> from inbounds.book.small_mdp import ledge
        >>> episodes = ledge().sample(lambda cell: (0.0 * cell, 0.0 * cell), (2,), 50, np.random.default_rng(0))
        >>> episodes.reward.shape, bool(episodes.alive[:, 0].all())
        ((2, 50), True)
    """

    state: NDArray[np.int64]
    """The cell before the step."""
    latent: NDArray[np.float64]
    """What the policy drew."""
    action: NDArray[np.float64]
    """What was executed, in [−1, 1]."""
    reward: NDArray[np.float64]
    """r(s, a)."""
    next_state: NDArray[np.int64]
    """The cell after the step; −1 where the episode ended."""
    alive: NDArray[np.bool_]
    """Whether the step was taken: false after the end."""


@dataclass(frozen=True)
class SmallMDP:
    """The process. All functions take leading axes, so that many policies are judged at once.

    Args:
        left: `[N, N]` transition probabilities under a = −1; rows sum to at most one.
        right: `[N, N]` under a = +1.
        reward: `[N, 3]` coefficients of 1, a, a².
        start: `[N]` probabilities of the first state.
        gamma: discount.

    Raises:
        ValueError: shapes do not fit, probabilities are none, or the discount is not in [0, 1).

    Example:
        >>> import torch
        >>> from inbounds.book.small_mdp import ledge
        >>> rover = ledge()
        >>> still = torch.zeros(6, dtype=torch.float64)
        >>> round(rover.performance(still, still).item(), 3)  # it never steers, and drifts
        -0.578
    """

    left: Tensor
    right: Tensor
    reward: Tensor
    start: Tensor
    gamma: float

    def __post_init__(self) -> None:
        states = len(self.start)
        if self.left.shape != (states, states) or self.right.shape != (states, states):
            raise ValueError(f"left and right must be [{states}, {states}], one row and column per state")
        if self.reward.shape != (states, 3):
            raise ValueError(f"reward must be [{states}, 3]: coefficients of 1, a and a²")
        for name in ("left", "right", "start"):
            rows = getattr(self, name)
            if not ((rows >= 0).all() and (rows.sum(-1) <= 1 + 1e-12).all()):
                raise ValueError(f"{name} must hold probabilities, each row summing to at most one")
        if self.start.sum() < 1 - 1e-12:
            raise ValueError(
                f"start must sum to one, got {self.start.sum().item()}: an episode begins somewhere"
            )
        if not 0 <= self.gamma < 1:
            raise ValueError(f"gamma must be in [0, 1), got {self.gamma}")

    @property
    def num_states(self) -> int:
        """N."""
        return len(self.start)

    def dynamics(self, mean: Tensor, square: Tensor) -> tuple[Tensor, Tensor]:
        """Return what a policy makes of the process: transitions `[..., N, N]` and rewards `[..., N]`.

        Args:
            mean: `[..., N]` E[a] in each state.
            square: `[..., N]` E[a²].
        """
        weight = ((1 + mean) / 2).unsqueeze(-1)
        transitions = (1 - weight) * self.left + weight * self.right
        constant, linear, quadratic = self.reward.T
        return transitions, constant + linear * mean + quadratic * square

    def values(self, mean: Tensor, square: Tensor, gamma: float | None = None) -> Tensor:
        """Return V `[..., N]`, the solution of V = r + γ P V.

        Args:
            mean: `[..., N]` E[a].
            square: `[..., N]` E[a²].
            gamma: discount in place of the process's own; 1 where every episode ends.
        """
        transitions, reward = self.dynamics(mean, square)
        gamma = self.gamma if gamma is None else gamma
        return torch.linalg.solve(self._identity - gamma * transitions, reward)

    def performance(self, mean: Tensor, square: Tensor, gamma: float | None = None) -> Tensor:
        """Return the expected return `[...]` from the first state on; arguments as for `values`."""
        return self.values(mean, square, gamma) @ self.start

    def occupancy(self, mean: Tensor, gamma: float | None = None) -> Tensor:
        """Return d `[..., N]`, d(s) = Σ_t γ^t P(s_t = s): the solution of d = start + γ Pᵀ d.

        Args:
            mean: `[..., N]` E[a].
            gamma: discount in place of the process's own; with 1, expected visits per episode.
        """
        transitions, _ = self.dynamics(mean, torch.zeros_like(mean))
        gamma = self.gamma if gamma is None else gamma
        system = (self._identity - gamma * transitions).mT
        return torch.linalg.solve(system, self.start.expand(mean.shape))

    def action_values(self, values: Tensor) -> Tensor:
        """Return Q(s, a) = r(s, a) + γ Σ P(s' | s, a) V(s') as coefficients of 1, a, a²: `[..., N, 3]`.

        Args:
            values: `[..., N]` V.
        """
        after_left, after_right = (values @ matrix.T for matrix in (self.left, self.right))
        ahead = torch.stack([after_left + after_right, after_right - after_left, 0 * values], -1)
        return self.reward + self.gamma / 2 * ahead

    def sample(
        self,
        draw: Callable[[NDArray[np.int64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
        shape: tuple[int, ...],
        steps: int,
        rng: np.random.Generator,
    ) -> Episodes:
        """Play episodes, all at once.

        Args:
            draw: the policy: from cells `shape` to latents and actions of the same shape.
            shape: `(E,)`, or `(..., E)` for a batch of policies.
            steps: T, after which episodes still under way are cut off.
            rng: for starts and transitions.

        Returns:
            The episodes, arrays `[..., E, T]`.
        """
        cumulative = np.stack([matrix.numpy().cumsum(1) for matrix in (self.left, self.right)])
        reward = self.reward.numpy()
        state = np.searchsorted(self.start.numpy().cumsum(), rng.random(shape), side="right")
        state = np.minimum(state, self.num_states - 1)
        alive = np.ones(shape, np.bool_)
        columns = []
        for _ in range(steps):
            latent, action = draw(state)
            pushed = (rng.random(shape) < (1 + action) / 2).astype(np.int64)
            after = (rng.random((*shape, 1)) >= cumulative[pushed, state]).sum(-1)
            after = np.where(after == self.num_states, -1, after)
            paid = (reward[state] * np.stack([np.ones(shape), action, action**2], -1)).sum(-1)
            columns.append((state, latent, action, np.where(alive, paid, 0.0), after, alive))
            alive = alive & (after >= 0)
            state = np.where(alive, after, 0)
        return Episodes(*(np.stack(column, -1) for column in zip(*columns, strict=True)))

    def with_gamma(self, gamma: float) -> SmallMDP:
        """Return the same process under another discount."""
        return replace(self, gamma=gamma)

    @property
    def _identity(self) -> Tensor:
        return torch.eye(self.num_states, dtype=self.left.dtype)


def squashed_moments(loc: Tensor, log_scale: Tensor) -> tuple[Tensor, Tensor]:
    """Return E[a] and E[a²] of the logit-normal action a = tanh(z/2), z ~ Normal: `[...]` each, by quadrature.

    To 1e-12 for σ ≤ e; the rule is too coarse for wider laws (1e-6 at log σ = 2, 1e-3 at 3).

    Args:
        loc: `[...]` μ of the latent, float64.
        log_scale: `[...]` log σ.

    Example:
        >>> import torch
        >>> one = torch.ones(1, dtype=torch.float64)
        >>> [round(m.item(), 4) for m in squashed_moments(one, 0 * one)]
        [0.3935, 0.2882]
    """
    scale = log_scale.exp()
    mean = quadrature.expectation(lambda z: torch.tanh(z / 2), loc, scale, _RULE)
    square = quadrature.expectation(lambda z: torch.tanh(z / 2).square(), loc, scale, _RULE)
    return mean, square


def _corridor(cells: int, grip: float) -> tuple[Tensor, Tensor]:
    """Return the moves by one cell, taken with probability `grip`; the first cell has a wall, the last has none."""
    stay = (1 - grip) * torch.eye(cells, dtype=torch.float64)
    left = stay + grip * torch.diag(torch.ones(cells - 1, dtype=torch.float64), -1)
    left[0, 0] = 1.0
    right = stay + grip * torch.diag(torch.ones(cells - 1, dtype=torch.float64), 1)
    return left, right


def ledge(
    cells: int = 6, gamma: float = 0.9, grip: float = 0.8, battery: float = 0.98, fall: float = 10.0
) -> SmallMDP:
    """Return a rover on a ledge, paid for its speed, with a cliff behind the last cell.

    It starts in the first cell, which has a wall behind it. The reward is a − 0.1a², speed less control cost; in the
    last cell it is also charged for a fall, times the probability that it falls. A fall ends the episode.

    Args:
        cells: of the road, N.
        gamma: discount.
        grip: probability that a push moves the rover by a cell.
        battery: probability that the episode goes on after a step.
        fall: what a fall costs.

    Example:
        >>> ledge(cells=4).reward.shape  # cells; constant, linear and quadratic term in the action
        torch.Size([4, 3])
    """
    left, right = _corridor(cells, grip)
    reward = torch.tensor([0.0, 1.0, -0.1], dtype=torch.float64).repeat(cells, 1)
    reward[-1, :2] -= fall * grip / 2  # P(fall | last cell, a) = grip (1 + a)/2
    start = torch.eye(cells, dtype=torch.float64)[0]
    return SmallMDP(battery * left, battery * right, reward, start, gamma)


def slope(
    cells: int = 6, gamma: float = 0.9, grip: float = 0.8, battery: float = 0.98, climb: float = 0.4
) -> SmallMDP:
    """Return a rover on a slope: climbing costs, and only the last cell, which has a wall behind it, lies in the sun.

    It starts anywhere. The reward is −climb (1 + a)/2 − 0.1a², and one more in the sun.

    Args:
        cells: of the road, N.
        gamma: discount.
        grip: probability that a push moves the rover by a cell.
        battery: probability that the episode goes on after a step.
        climb: cost of a full push uphill; a full push downhill is free.

    Example:
        >>> slope(cells=4).start.tolist()
        [0.25, 0.25, 0.25, 0.25]
    """
    left, right = _corridor(cells, grip)
    right[-1, -1] = 1.0
    reward = torch.tensor([-climb / 2, -climb / 2, -0.1], dtype=torch.float64).repeat(cells, 1)
    reward[-1, 0] += 1.0
    start = torch.full((cells,), 1 / cells, dtype=torch.float64)
    return SmallMDP(battery * left, battery * right, reward, start, gamma)
