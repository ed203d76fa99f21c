r"""Proximal policy optimisation (Schulman et al. 2017, sections 3 and 5), for S seeds in lockstep.

With the ratio r(θ) = π_θ(z | s) / π_old(z | s) of the *latents'* densities, the clipped surrogate

$$ L(θ) = E[ min( r Â, clip(r, 1 − ε, 1 + ε) Â ) ] + c_H E[H(π_θ)] − c_V E[(V_θ − R)²] $$

is ascended by Adam over shuffled minibatches. Clipping removes the incentive to move the ratio beyond 1 ± ε; it bounds
neither the ratio nor the KL divergence, so both are measured and recorded. A loss is a mean within a seed and a sum
over seeds: its gradient gives each seed its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import mse_loss

from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.networks.adam import SeedAdam
from inbounds.learning.rollout import Rollout
from inbounds.learning.updates.checks import check, check_minibatches
from inbounds.learning.updates.diagnostics import diagnose
from inbounds.learning.updates.minibatches import Minibatch, minibatches

if TYPE_CHECKING:  # numba is an extra
    from inbounds.learning.updates.compiled import CompiledAdam


@dataclass(frozen=True)
class PPOConfig:
    """Every number of PPO.

    Example:
        >>> PPOConfig(horizon=1024).minibatch_size
        64
        >>> PPOConfig(clip_range=0.0)
        Traceback (most recent call last):
        ValueError: clip_range must be positive, got 0.0
    """

    horizon: int = 2048
    """T, env steps per seed and epoch."""
    learning_rate: float = 3e-4
    """Adam's step size, constant."""
    adam_eps: float = 1e-5
    """Adam's ε."""
    num_epochs: int = 10
    """Passes over the rollout per epoch of training."""
    minibatch_size: int = 64
    """B, env steps of each seed in a gradient step; a divisor of the horizon."""
    gamma: float = 0.99
    """Discount γ per env step."""
    gae_lambda: float = 0.95
    """λ of the advantage estimate."""
    clip_range: float = 0.2
    """ε: where the surrogate goes flat, |r − 1| = ε."""
    entropy_coef: float = 1e-4
    """c_H, weight of the family's entropy, per nat."""
    value_coef: float = 0.5
    """c_V, weight of the value network's mean squared error."""
    normalize_advantage: bool = True
    """Normalise advantages per seed and minibatch."""
    max_grad_norm: float | None = 0.5
    """Clip each seed's gradient to this norm; None never does."""

    def __post_init__(self) -> None:
        check(self, positive=("horizon", "learning_rate", "adam_eps", "num_epochs", "minibatch_size"))
        check(self, positive=("clip_range",), unit=("gamma", "gae_lambda"))
        check(self, not_negative=("entropy_coef", "value_coef"), positive_or_none=("max_grad_norm",))
        together = self.minibatch_size if self.normalize_advantage else None
        check_minibatches(self.horizon, self.minibatch_size, together)


def make_optimizer(networks: ActorCritic, config: PPOConfig, adam: type[Any] = SeedAdam) -> Any:
    """Return the one Adam that moves policy and value networks together: the engine's, `SeedAdam` or `CompiledAdam`."""
    return adam(networks.networks, config.learning_rate, config.adam_eps, config.max_grad_norm)


def clipped_surrogate(log_prob: Tensor, old_log_prob: Tensor, advantage: Tensor, clip_range: float) -> Tensor:
    """Return min(r Â, clip(r, 1 − ε, 1 + ε) Â), elementwise.

    Args:
        log_prob: `[S, B]` log π_θ(z | s), in nats.
        old_log_prob: `[S, B]` of the policy that drew z.
        advantage: `[S, B]`.
        clip_range: ε.

    Returns:
        `[S, B]`, to be maximised.

    Example:
        >>> import torch
        >>> log_ratio, advantage = torch.tensor([[0.5, 0.5]]), torch.tensor([[1.0, -1.0]])
        >>> clipped_surrogate(log_ratio, torch.zeros(1, 2), advantage, 0.2).numpy().round(3)
        array([[ 1.2  , -1.649]], dtype=float32)
    """
    ratio = torch.exp(log_prob - old_log_prob)
    return torch.minimum(ratio * advantage, ratio.clamp(1 - clip_range, 1 + clip_range) * advantage)


def loss(networks: ActorCritic, batch: Minibatch, config: PPOConfig) -> Tensor:
    """Return the scalar to minimise: for each seed the mean over its minibatch, summed over seeds.

    Args:
        networks: the policy and the value networks.
        batch: `[S, B, ...]`.
        config: the coefficients.

    Returns:
        −L, a scalar.

    Example:
        >>> import numpy as np
        >>> import torch
        >>> from inbounds.learning import ActorCritic, NetworkConfig, Policy, PolicyConfig, PPOConfig
        >>> from inbounds.learning.updates.minibatches import Minibatch
        >>> policy = Policy(PolicyConfig("gaussian"), low=-np.ones(1), high=np.ones(1))
        >>> networks = ActorCritic(policy, 3, NetworkConfig(), [torch.Generator().manual_seed(s) for s in (0, 1)])
        >>> obs, latent = torch.ones(2, 64, 3), torch.zeros(2, 64, 1)
        >>> log_prob = policy.law.log_prob(networks.parameters(obs), latent).detach()
        >>> batch = Minibatch(obs, latent, log_prob, torch.ones(2, 64), return_=networks.values(obs).detach())
        >>> loss(networks, batch, PPOConfig(entropy_coef=0.0)).item()  # ratios 1, values right: −1 for each seed
        -2.0
    """
    policy = networks.policy
    parameters = networks.parameters(batch.obs)
    log_prob = policy.law.log_prob(parameters, batch.latent)
    surrogate = clipped_surrogate(log_prob, batch.log_prob, batch.advantage, config.clip_range)
    error = mse_loss(networks.values(batch.obs), batch.return_, reduction="sum")
    total = config.value_coef * error - surrogate.sum()
    if config.entropy_coef:
        total = total - config.entropy_coef * policy.family.entropy(parameters).sum()
    return total / batch.obs.shape[1]


def update(
    networks: ActorCritic,
    optimizer: SeedAdam | CompiledAdam,
    rollout: Rollout,
    generators: Sequence[np.random.Generator],
    config: PPOConfig,
) -> dict[str, Tensor]:
    """Do one PPO update: `num_epochs` passes of Adam over the rollout.

    Args:
        networks: changed in place.
        optimizer: from `make_optimizer`.
        rollout: `[S, T, ...]`, drawn by these networks.
        generators: one per seed, for the order of its minibatches.
        config: the numbers.

    Returns:
        Diagnostics `[S]`: those of `diagnose`, and `clip_fraction`, the fraction of steps whose ratio ended
        beyond 1 ± ε.

    Raises:
        ValueError: minibatches do not divide the rollout; nothing has changed then.

    Example:
        >>> from inbounds.learning import PPOConfig, Trainer, preset
        >>> trainer = Trainer(preset("common", "Hopper-v5", seeds=2))
        >>> rollout = trainer.collector.collect(128)
        >>> shuffles = [stream.shuffle for stream in trainer.streams]
        >>> sorted(update(trainer.networks, trainer.optimizer, rollout, shuffles, PPOConfig(horizon=128)))
        ['approx_kl', 'clip_fraction', 'entropy', 'explained_variance', 'kl']
    """
    check_minibatches(rollout.horizon, config.minibatch_size)
    advantage, return_ = rollout.advantages(config.gamma, config.gae_lambda)
    if isinstance(optimizer, SeedAdam):
        for _ in range(config.num_epochs):
            for batch in minibatches(
                rollout, advantage, return_, config.minibatch_size, generators, config.normalize_advantage
            ):
                optimizer.minimize(loss(networks, batch, config))
    else:
        (generator,) = generators
        optimizer.ppo_passes(networks.policy, rollout, advantage, return_, generator, config)
    diagnostics, ratio = diagnose(networks, rollout, return_)
    beyond = (ratio - 1).abs() > config.clip_range
    return diagnostics | {"clip_fraction": beyond.to(ratio.dtype).mean(1)}
