r"""Generalised advantage estimation (Schulman et al. 2016), with the two ways an episode can end kept apart.

$$ δ_t = r_t + γ V(s_{t+1}) − V(s_t),   Â_t = δ_t + γλ Â_{t+1} = Σ_k (γλ)^k δ_{t+k}. $$

*Terminated* (the robot fell): nothing follows, V(s_{t+1}) = 0. *Truncated* (the clock stopped it): the world goes on
unseen, V(s_{t+1}) is the value of the final observation. The sum over k stops at both.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor


def gae(
    reward: Tensor,
    value: Tensor,
    terminated: Tensor,
    truncated: Tensor,
    bootstrap: Tensor,
    gamma: float,
    gae_lambda: float,
) -> tuple[Tensor, Tensor]:
    """Return advantages Â and the returns Â + V that the value network learns from.

    Args:
        reward: `[S, T]`.
        value: `[S, T]` V(s_t), without a graph (`detach`).
        terminated: `[S, T]` booleans, the episode ended by itself after step t.
        truncated: `[S, T]` booleans, the episode was cut off after step t.
        bootstrap: `[S, T]` V of the observation after step t: read where truncated, and at the last step unless it
            terminated.
        gamma: discount γ per step.
        gae_lambda: λ; 1 is the discounted return minus the value, 0 the one-step residual.

    Returns:
        Advantages and returns, `[S, T]` each.

    Example:
        >>> import torch
        >>> step = torch.ones(1, 3)
        >>> never = torch.zeros(1, 3, dtype=torch.bool)
        >>> ends = torch.tensor([[False, True, False]])
        >>> gae(step, 0 * step, ends, never, 10 * step, gamma=0.5, gae_lambda=1.0)[0].tolist()
        [[1.5, 1.0, 6.0]]
        >>> gae(step, 0 * step, never, ends, 10 * step, gamma=0.5, gae_lambda=1.0)[0].tolist()
        [[4.0, 6.0, 6.0]]
    """
    next_value = torch.cat([value[:, 1:], bootstrap[:, -1:]], 1)
    next_value = torch.where(truncated, bootstrap, next_value).masked_fill(terminated, 0)
    residual = (reward + gamma * next_value - value).numpy().T  # [T, S]
    decay = ((~(terminated | truncated)).to(value.dtype) * (gamma * gae_lambda)).numpy().T
    advantage = np.empty_like(residual)
    following = np.zeros_like(residual[0])
    with np.errstate(invalid="ignore"):  # 0 · ∞ is NaN; the trainer tells of infinite rewards
        for t in reversed(range(len(residual))):
            following = residual[t] + decay[t] * following
            advantage[t] = following
    result = torch.from_numpy(advantage.T)  # [S, T]
    return result.contiguous(), result + value


def normalize_advantage(advantage: Tensor) -> Tensor:
    """Return (Â − mean)/(standard deviation + 1e-8) over the last axis alone, `[..., B]`: per seed, per minibatch.

    Example:
        >>> import torch
        >>> normalize_advantage(torch.tensor([[1.0, 3.0], [10.0, 30.0]])).numpy().round(3)
        array([[-0.707,  0.707],
               [-0.707,  0.707]], dtype=float32)
    """
    centred = advantage - advantage.mean(-1, keepdim=True)
    variance = centred.square().sum(-1, keepdim=True) / (advantage.shape[-1] - 1)
    return centred / (variance.sqrt() + 1e-8)
