r"""The policy families, and one of them bound to a box.

| Family             | Law of the latent         | Unit action in [−1, 1]       | Entropy in a bonus      |
|--------------------|---------------------------|------------------------------|-------------------------|
| `gaussian`         | Normal                    | z; the robot clips it        | of the unclipped Normal |
| `clipped-gaussian` | Normal, scored as clipped | clip(z)                      | of the clipped, mixed   |
| `beta`             | Beta on [0, 1]            | 2x − 1                       | of the unit action      |
| `logit-normal`     | Normal                    | tanh(z/2) = 2 sigmoid(z) − 1 | of the unit action      |

One affine map then takes [−1, 1] to the box [low, high]. Ratio, score, KL divergence and Fisher information are
invariant under a fixed bijection, so an algorithm sees the law only: logit-normal PPO *is* Gaussian PPO with another
map. Not invariant are the entropy and the greedy actions: each family offers mean, median and mode.
Entropies are in nats and of unit actions: in units of the robot's action each dimension adds the constant log of
half its range, which no gradient sees.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType, ModuleType
from typing import Any, Literal, TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.distributions import Distribution

from inbounds.distributions.bounds import require_bounds
from inbounds.learning.families import beta, clipped_gaussian, gaussian, logit_normal
from inbounds.learning.families.family import Array, Family, Limits, Parameters
from inbounds.learning.updates.checks import check

ActionMode: TypeAlias = Literal["clip", "raw"]

SATURATION_MARGIN = 1e-3
"""Of half the action range: an executed action closer than this to a bound counts as at the bound."""

FAMILIES: Mapping[str, Family] = MappingProxyType(
    {module.FAMILY.name: module.FAMILY for module in (gaussian, clipped_gaussian, beta, logit_normal)}
)


def family_of(name: str) -> Family:
    """Return the family of a name.

    Raises:
        ValueError: there is none.
    """
    if name not in tuple(FAMILIES):  # a list has no hash
        raise ValueError(f"no policy family {name!r}; choose one of {', '.join(FAMILIES)}")
    return FAMILIES[name]


@dataclass(frozen=True)
class PolicyConfig:
    """What is common to every state: the family, and how network outputs become parameters.

    Example:
        >>> PolicyConfig("beta", initial_std=0.4).limits.concentration_max
        80.0
        >>> PolicyConfig("cauchy")
        Traceback (most recent call last):
        ValueError: no policy family 'cauchy'; choose one of gaussian, clipped-gaussian, beta, logit-normal
    """

    family: str = "logit-normal"
    """gaussian, clipped-gaussian, beta or logit-normal."""
    limits: Limits = field(default_factory=Limits)
    """Hard limits of the law's parameters."""
    state_dependent_std: bool = True
    """False: log σ is one free number per action dimension, the same in every state (not for beta)."""
    initial_std: float | None = None
    """Executed noise before training, in units of half the action range; None leaves the head's bias as it is."""

    def __post_init__(self) -> None:
        if not isinstance(self.limits, Limits):
            raise ValueError(f"limits must be a Limits, got {self.limits!r}")
        check(self, positive_or_none=["initial_std"])
        names = family_of(self.family).law.named.names()
        if "log_scale" not in names and not self.state_dependent_std:
            raise ValueError(
                f"{self.family} has {' and '.join(names)}, and no scale to set free of the state: use it with "
                "state_dependent_std=True"
            )


class Policy:
    """A family bound to a box: everything about actions, nothing about networks.

    Args:
        config: the family and its options.
        low: `[A]` lower bounds of the action, in the robot's units (N·m for the MuJoCo tasks).
        high: `[A]` upper bounds.

    Raises:
        ValueError: the bounds are not of shape [A], not finite, not in order, or too close for a number of their type
            between them, or too far apart for the type.

    Example:
        >>> import numpy as np
        >>> import torch
        >>> from inbounds.learning import PolicyConfig
        >>> policy = Policy(PolicyConfig("logit-normal"), low=np.array([-2.0]), high=np.array([4.0]))
        >>> policy.action(np.array([[0.0], [100.0]])).tolist()
        [[1.0], [4.0]]
        >>> outputs = torch.tensor([0.0, -1.0])  # loc and log_scale of one action dimension
        >>> policy.greedy(outputs, "median").tolist()
        [1.0]
    """

    def __init__(self, config: PolicyConfig, low: NDArray[Any], high: NDArray[Any]) -> None:
        self.dtype = np.result_type(np.asarray(low), np.float16)  # of executed actions, the box's
        low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        if low.ndim != 1 or low.shape != high.shape or not low.size:
            raise ValueError(
                f"a policy needs bounds of shape [A], A at least 1, got low={low.tolist()}, high={high.tolist()}: "
                "wrap the environment so that its action space is a bounded, one-dimensional Box"
            )
        require_bounds(low, high, getattr(torch, self.dtype.name, torch.float64))
        self.config = config
        self.family = FAMILIES[config.family]
        self.law = self.family.law
        self.low, self.high = low, high
        self.act_dim = len(low)
        self.centre, self.half_range = (high + low) / 2, (high - low) / 2
        self._as_executed = [bound.astype(self.dtype) for bound in (low, high, self.centre)]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what it was made from; a family's functions have no names to be found by."""
        return type(self), (self.config, self.low.astype(self.dtype), self.high.astype(self.dtype))

    def parameters(self, outputs: Array, xp: ModuleType = torch) -> Parameters:
        """Return the law's parameters `[..., A]` for network outputs `[..., 2A]`.

        Raises:
            ValueError: they are of another number of action dimensions.
        """
        if outputs.shape[-1] != 2 * self.act_dim:  # those of one dimension would be broadcast
            raise ValueError(
                f"{self.act_dim} action dimensions take {2 * self.act_dim} outputs, not {outputs.shape[-1]}"
            )
        return self.law.parameters(outputs, self.config.limits, xp)

    def unit_action(self, latent: Array, xp: ModuleType = np) -> Array:
        """Return the family's map of latents `[..., A]`: unit actions, beyond [−1, 1] only for `gaussian`."""
        return self.family.to_unit(latent, xp)

    def action(self, latent: NDArray[Any]) -> NDArray[Any]:
        """Return the action `[..., A]`, in the robot's units, that latents `[..., A]` stand for, not yet clipped."""
        unit = self.unit_action(latent)
        # Far from zero a box may need more digits than latents have.
        precision = np.result_type(unit, self.dtype)
        centre, half_range = self.centre.astype(precision), self.half_range.astype(precision)
        return centre + half_range * unit

    def execute(self, latent: NDArray[Any], mode: ActionMode = "clip") -> NDArray[Any]:
        """Return the action `[..., A]` that the robot receives for latents `[..., A]`, in the box's precision.

        A diverged policy, whose latents are NaN, holds still in the middle of its box.

        Args:
            latent: what the law drew.
            mode: "clip" to the box, or "raw", as it was drawn.
        """
        return self._executed(self.action(latent), mode)

    def _executed(self, action: NDArray[Any], mode: ActionMode) -> NDArray[Any]:
        low, high, centre = self._as_executed
        action = action.astype(self.dtype)
        if mode == "clip":
            action = np.minimum(np.maximum(action, low), high)
        if not np.isfinite(action).all():
            action = np.where(np.isfinite(action), action, centre)
        return action

    def sample(
        self, outputs: NDArray[Any], generators: Sequence[np.random.Generator], mode: ActionMode = "clip"
    ) -> NDArray[Any]:
        """Return an action `[B, A]` to execute for each row of the network's outputs `[B, 2A]`, by a generator each.

        Raises:
            ValueError: there are more rows than generators, or fewer.
        """
        if len(generators) != len(outputs):
            raise ValueError(
                f"{len(outputs)} rows of outputs need a generator each, not {len(generators)} in all"
            )
        draw = self.law.sampler(generators, 1, self.act_dim, outputs.dtype)
        return self.execute(draw(self.parameters(outputs, np), 0), mode)

    def distribution(self, outputs: Tensor) -> Distribution:
        """Return the distribution of the action, elementwise `[..., A]`, in the robot's units and in float64.

        A sum of its `log_prob` over A is the joint log-density. For `gaussian` it is the Normal that is drawn from,
        before any clip.

        Args:
            outputs: `[..., 2A]` of the policy network.
        """
        parameters = self.parameters(outputs).each(Tensor.double)
        return self.family.distribution(parameters, torch.from_numpy(self.low), torch.from_numpy(self.high))

    def entropy(self, outputs: Tensor) -> Tensor:
        """Return the family's bonus entropy `[...]` for outputs `[..., 2A]`, in nats."""
        return self.family.entropy(self.parameters(outputs))

    def greedy(self, outputs: Tensor, by: str) -> NDArray[Any]:
        """Return the greedy action `[..., A]` to execute, within the box and in its precision.

        Args:
            outputs: `[..., 2A]` of the policy network.
            by: "mean", "median" or "mode", as the family offers.

        Raises:
            ValueError: the family does not offer it.
        """
        if by not in self.family.greedy:
            raise ValueError(
                f"{self.config.family} offers the greedy actions {', '.join(self.family.greedy)}, not {by!r}"
            )
        with torch.no_grad():
            unit = self.family.greedy[by](self.parameters(outputs)).numpy()
        return self._executed(self.centre + self.half_range * unit, "clip")
