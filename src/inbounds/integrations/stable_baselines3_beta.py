r"""The Beta as a policy of stable-baselines3: PPO, A2C, and sb3-contrib's TRPO take the class itself.

    model = PPO(BetaPolicy, env)

The head gives two numbers per component of the action, α = 1 + softplus(u) and β = 1 + softplus(v), as Chou, Maturana
& Scherer (2017) have it: no mode on a bound, and a spread that depends on the state. What is drawn, kept and scored is
the latent, the logit of the fraction of the way through the box; `stable_baselines3` tells why.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from torch import Tensor, nn
from torch.nn.functional import softplus

from inbounds.distributions import ScaledBeta
from inbounds.distributions.scaled_beta import before_softplus
from inbounds.integrations.quiet import quiet_concentration
from inbounds.integrations.stable_baselines3 import BoundedPolicy, ScoresLatents, require_finite

try:
    from stable_baselines3.common.distributions import BernoulliDistribution
except ImportError as error:
    raise ImportError(
        'stable-baselines3 is not installed: pip install ".[integrations]" in the source tree'
    ) from error

__all__ = ["BetaDistribution", "BetaPolicy"]


class BetaDistribution(ScoresLatents, BernoulliDistribution):
    """A box of independent Betas, in the peer's interface: its "actions" are latents `[B, A]`.

    The peer has a place for laws that one layer determines, which it keeps for its Bernoulli.

    Args:
        low: `[A]` lower bounds of the action, in its own units.
        high: `[A]` upper bounds.

    Raises:
        ValueError: some bounds are not finite, not in order, or so close that no number is between them.

    Example:
        >>> import numpy as np
        >>> import torch
        >>> law = BetaDistribution(np.array([0.0, -2.0]), np.array([8.0, 1.0]))
        >>> _ = law.proba_distribution(torch.zeros(1, 4))  # α = β = 1 + log 2
        >>> law.action(law.mode()).tolist()  # the middle of the box
        [[4.0, -0.5]]
    """

    distribution: ScaledBeta  # type: ignore[assignment]  # the peer's is a Bernoulli

    def proba_distribution_net(self, latent_dim: int) -> nn.Module:
        """Return the layer from features `[B, F]` to outputs `[B, 2A]`: of α, then of β."""
        return nn.Linear(latent_dim, 2 * self.action_dims)

    def proba_distribution(self, action_logits: Tensor) -> BetaDistribution:
        """Set α and β of outputs `[B, 2A]`.

        Raises:
            ValueError: they are not finite.
        """
        require_finite(action_logits)
        alpha, beta = (1 + softplus(action_logits)).chunk(2, dim=-1)
        low, high = (bound.to(action_logits) for bound in (self.low, self.high))
        self.distribution = ScaledBeta(alpha, beta, low, high, validate_args=False)
        return self

    def mode(self) -> Tensor:
        """Return the latents `[B, A]` of the medians, which a bijection keeps: what the peer calls deterministic."""
        return self.distribution.value_to_latent(self.distribution.median)

    @staticmethod
    def start_quietly(policy: Any, std: float) -> None:
        """Set the head's bias; see `quiet_start`."""
        policy.action_net.bias.fill_(before_softplus(quiet_concentration(std)))


class BetaPolicy(BoundedPolicy):
    """The peer's actor-critic with Beta actions in any bounded box; see the module.

    Args:
        observation_space: as the peer's; a Dict or images, too, which get the networks of `MultiInputPolicy` and
            `CnnPolicy`.
        action_space: a bounded, one-dimensional Box.
        lr_schedule: as the peer's.
        **options: as the peer's, without `log_std_init`: a Beta has no σ. Without a quiet start it executes at first a
            standard deviation of 0.48 of half the range. Generalised state-dependent exploration (`use_sde`) is not
            for it.

    Raises:
        ValueError: another action space (the message names the wrapper that makes this one of it), `use_sde`, or
            `log_std_init`.

    `predict(obs, deterministic=True)` acts by the median, which SciPy computes. Called as a module, the policy returns
    *latents*. Pass the class to the peer, not its name.

    Example:
        >>> import numpy as np
        >>> from stable_baselines3 import PPO
        >>> model = PPO(BetaPolicy, "Pendulum-v1", n_steps=64, device="cpu", seed=0).learn(64)
        >>> action, _ = model.predict(np.zeros((1000, 3), np.float32))
        >>> bool((abs(action) < 2).all())  # N·m: never on a bound
        True
    """

    law = BetaDistribution

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        """Refuse what would be ignored, before the heads are built."""
        if self.log_std_init:
            raise ValueError("a Beta has no σ: leave log_std_init out, and call quiet_start(model, 0.4)")
        super()._build(lr_schedule)
