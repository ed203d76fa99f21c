r"""REINFORCE with a baseline (Williams 1992; Sutton et al. 2000), for S seeds in lockstep.

$$ ∇J ≈ E[ ∇ log π_θ(z | s) Â ],   Â_t = Σ_k γ^k r_{t+k} − V(s_t), $$

one ascent step per rollout, because only at the sampling θ does this expectation mean anything. As everyone
does, it drops the factor γ^t that the exact gradient of the discounted return carries. `gae_lambda` = 1 is the
return minus the baseline; less trades variance for the bias of V.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from torch import Tensor

from inbounds.learning.advantages import normalize_advantage
from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.networks.adam import SeedAdam
from inbounds.learning.rollout import Rollout
from inbounds.learning.updates.checks import check, check_minibatches
from inbounds.learning.updates.diagnostics import diagnose
from inbounds.learning.updates.value import fit_values

if TYPE_CHECKING:  # numba is an extra
    from inbounds.learning.updates.compiled import CompiledAdam


@dataclass(frozen=True)
class PolicyGradientConfig:
    """Every number of REINFORCE with a baseline.

    Example:
        >>> PolicyGradientConfig(gae_lambda=0.95).policy_learning_rate
        0.003
    """

    horizon: int = 2048
    """T, env steps per seed and epoch."""
    policy_learning_rate: float = 3e-3
    """Adam's step size for the policy, which takes one step per epoch."""
    learning_rate: float = 3e-4
    """Adam's step size for the value network."""
    adam_eps: float = 1e-5
    """Adam's ε, for both."""
    num_epochs: int = 10
    """Passes of the value regression over the rollout per epoch of training."""
    minibatch_size: int = 64
    """B of the value regression, env steps of each seed; a divisor of the horizon."""
    gamma: float = 0.99
    """Discount γ per env step."""
    gae_lambda: float = 1.0
    """λ of the advantage estimate; 1 is the return minus the baseline."""
    entropy_coef: float = 1e-4
    """Weight of the family's entropy, per nat."""
    normalize_advantage: bool = True
    """Normalise advantages per seed and rollout."""
    max_grad_norm: float | None = 0.5
    """Clip each seed's gradients, policy and value apart, to this norm; None never does."""

    def __post_init__(self) -> None:
        check(self, positive=("horizon", "policy_learning_rate", "learning_rate", "adam_eps", "num_epochs"))
        check(self, positive=("minibatch_size",), unit=("gamma", "gae_lambda"))
        check(self, not_negative=("entropy_coef",), positive_or_none=("max_grad_norm",))
        together = self.horizon if self.normalize_advantage else None
        check_minibatches(self.horizon, self.minibatch_size, together)


@dataclass
class Optimizers:
    """One Adam for the policy, one for the value network.

    Used by `update`, which has an example.
    """

    actor: SeedAdam
    critic: SeedAdam | CompiledAdam

    def state_dict(self) -> dict[str, object]:
        """Return both states."""
        return {"actor": self.actor.state_dict(), "critic": self.critic.state_dict()}

    def load_state_dict(self, state: dict[str, dict[str, object]]) -> None:
        """Go back to both states."""
        self.actor.load_state_dict(state["actor"])
        self.critic.load_state_dict(state["critic"])


def make_optimizer(
    networks: ActorCritic, config: PolicyGradientConfig, adam: type[Any] = SeedAdam
) -> Optimizers:
    """Return the optimisers of the policy, autograd's under any engine, and of the value network."""
    eps, norm = config.adam_eps, config.max_grad_norm
    return Optimizers(
        SeedAdam([networks.actor], config.policy_learning_rate, eps, norm),
        adam([networks.critic], config.learning_rate, eps, norm),
    )


def loss(networks: ActorCritic, rollout: Rollout, advantage: Tensor, entropy_coef: float) -> Tensor:
    """Return the scalar whose gradient is minus the policy gradient; its value means nothing.

    Args:
        networks: the policies that drew the rollout.
        rollout: `[S, T, ...]`.
        advantage: `[S, T]`, a constant to the gradient.
        entropy_coef: weight of the entropy.

    Returns:
        For each seed a mean over its rollout, summed over seeds.

    Example:
        >>> import torch
        >>> from inbounds.learning import Trainer, preset
        >>> trainer = Trainer(preset("common", "Hopper-v5", seeds=2))
        >>> rollout = trainer.collector.collect(8)
        >>> loss(trainer.networks, rollout, torch.ones(2, 8), entropy_coef=0.0).requires_grad
        True
    """
    policy = networks.policy
    parameters = networks.parameters(rollout.obs)
    objective = policy.law.log_prob(parameters, rollout.latent) * advantage
    if entropy_coef:
        objective = objective + entropy_coef * policy.family.entropy(parameters)
    return -objective.mean(1).sum()


def update(
    networks: ActorCritic,
    optimizer: Optimizers,
    rollout: Rollout,
    generators: Sequence[np.random.Generator],
    config: PolicyGradientConfig,
) -> dict[str, Tensor]:
    """Take one policy gradient step, then fit the values.

    Args:
        networks: changed in place.
        optimizer: from `make_optimizer`.
        rollout: `[S, T, ...]`, drawn by these networks.
        generators: one per seed, for the order of the minibatches.
        config: the numbers.

    Returns:
        The diagnostics `[S]` of `diagnose`.

    Raises:
        ValueError: minibatches do not divide the rollout; nothing has changed then.

    Example:
        >>> from inbounds.learning import Trainer, preset
        >>> trainer = Trainer(preset("common", "Hopper-v5", algo="policy-gradient", seeds=2))
        >>> shuffles = [stream.shuffle for stream in trainer.streams]
        >>> rollout = trainer.collector.collect(64)
        >>> found = update(trainer.networks, trainer.optimizer, rollout, shuffles, trainer.config.algorithm)
        >>> found["kl"].shape
        torch.Size([2])
    """
    check_minibatches(rollout.horizon, config.minibatch_size)
    advantage, return_ = rollout.advantages(config.gamma, config.gae_lambda)
    weights = normalize_advantage(advantage) if config.normalize_advantage else advantage
    optimizer.actor.minimize(loss(networks, rollout, weights, config.entropy_coef))
    fit_values(
        networks, optimizer.critic, rollout, return_, generators, config.num_epochs, config.minibatch_size
    )
    return diagnose(networks, rollout, return_)[0]
