"""What an update did to a policy, measured on the rollout that it learned from, and what that rollout earned."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.rollout import Rollout


@torch.no_grad()
def diagnose(networks: ActorCritic, rollout: Rollout, return_: Tensor) -> tuple[dict[str, Tensor], Tensor]:
    """Compare the policy after an update with the one that drew the rollout.

    Args:
        networks: after the update.
        rollout: `[S, T, ...]`, drawn before it.
        return_: `[S, T]`, what the value network learned from.

    Returns:
        Diagnostics `[S]`: `kl`, the exact KL(old‖new) in nats, `approx_kl`, its estimate E[(r − 1) − log r]
        from the drawn latents (Schulman 2020), `entropy` of the new policy in nats, `explained_variance`
        of the returns by the values before the update, each a mean over the rollout; and the ratios r `[S, T]`.
    """
    policy = networks.policy
    parameters = networks.parameters(rollout.obs)
    log_ratio = policy.law.log_prob(parameters, rollout.latent) - rollout.log_prob
    ratio = torch.exp(log_ratio)
    residual = return_ - rollout.value
    diagnostics = {
        "kl": policy.law.kl(rollout.parameters, parameters).mean(1),
        "approx_kl": (torch.expm1(log_ratio) - log_ratio).mean(1),
        "entropy": policy.family.entropy(parameters).mean(1),
        "explained_variance": 1 - residual.var(1) / return_.var(1),
    }
    return diagnostics, ratio


def episode_statistics(rollout: Rollout) -> dict[str, np.ndarray]:
    """Return, per seed, the number of episodes that ended and the mean of their returns (NaN where none did)."""
    returns = rollout.episode_returns
    return {
        "episodes": np.array([len(r) for r in returns]),
        "return_mean": np.array([np.mean(r) if r else np.nan for r in returns]),
    }
