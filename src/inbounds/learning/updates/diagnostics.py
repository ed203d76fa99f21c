"""What an update did to a policy, measured on the rollout that it learned from, and what that rollout earned."""

from __future__ import annotations

from collections.abc import Sequence

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


def told_of_divergence(
    too_far: Sequence[int], fed_nonsense: Sequence[int], epoch: int, dtype: str
) -> list[str]:
    """Return what to say of seeds whose weights have just ceased to be finite: nothing, one sentence, or two.

    Args:
        too_far: seeds that had seen finite numbers alone.
        fed_nonsense: seeds whose environment returned others.
        epoch: in which it happened.
        dtype: of the networks.

    Example:
        >>> [said] = told_of_divergence([3, 7], [], 12, "float32")
        >>> said.partition(":")[0], said.rpartition(", or ")[2]
        ('seeds [3, 7] diverged in epoch 12', 'train with a smaller learning_rate')
    """
    mend = (
        "mend the environment, which has returned an observation or a reward that is no finite number, or one "
        f"too large for {dtype} (gymnasium.utils.env_checker.check_env looks for more)"
    )
    return [
        f"seeds {seeds} diverged in epoch {epoch}: their weights are not finite. They are marked in every later "
        f"record; leave them out of means, or {advice}"
        for seeds, advice in ((too_far, "train with a smaller learning_rate"), (fed_nonsense, mend))
        if seeds
    ]
