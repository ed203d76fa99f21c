r"""The policy families: a law for the latent and a map to the action.

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

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType, ModuleType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import betaincinv
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.distributions import Distribution, Normal

from inbounds.distributions import ClippedNormal, LogitNormal, ScaledBeta, trapezoid
from inbounds.distributions.scaled_beta import log_beta
from inbounds.learning.families import family as laws
from inbounds.learning.families.family import BETA, CLIPPED_NORMAL, NORMAL, Array, Law, Limits, Parameters

SATURATION_MARGIN = 1e-3
"""Of half the action range: an executed action closer than this to a bound counts as at the bound."""


@dataclass(frozen=True)
class Family:
    """A row of the table above.

    Args:
        law: of the latent.
        to_unit: the map from latents `[..., A]` to unit actions; called with the latents and `xp`.
        entropy_name: which entropy `entropy` is, in words.
        entropy: of parameters `[..., A]`, summed over A: `[...]`, in nats.
        greedy: ways to act without noise, by name: parameters `[..., A]` to unit actions `[..., A]`.
        distribution: of the action, elementwise: parameters `[..., A]` and the box's low and high `[A]`.
    """

    law: Law
    to_unit: Callable[[Array, ModuleType], Array]
    entropy_name: str
    entropy: Callable[[Parameters], Tensor]
    greedy: Mapping[str, Callable[[Parameters], Tensor]]
    distribution: Callable[[Parameters, Tensor, Tensor], Distribution]


def normal_entropy(parameters: Parameters) -> Tensor:
    """Return Σ_A log σ + ½ log 2πe, `[...]`: the entropy of the latent Normal, in nats.

    Example:
        >>> round(normal_entropy(Parameters(torch.zeros(2), torch.zeros(2))).item(), 4)  # log 2πe
        2.8379
    """
    log_scale = parameters.second
    return log_scale.sum(-1) + (0.5 + laws.HALF_LOG_2PI) * log_scale.shape[-1]


def logit_normal_entropy(parameters: Parameters) -> Tensor:
    """Return the entropy `[...]` of the unit action tanh(z/2), in nats: the Normal's plus the map's expected log-slope.

    Within 1e-3 nats of `LogitNormal.entropy` for every log σ ≤ 1, at a twentieth of its cost: a bonus, which is
    multiplied by 1e-4, need not be exact to the last bit. Differentiable once.

    Example:
        >>> narrow = Parameters(torch.zeros(1), torch.full((1,), -4.0))  # at 0 the map halves lengths
        >>> round((normal_entropy(narrow) - logit_normal_entropy(narrow)).item(), 3)  # log 2
        0.693
    """
    log_slope: Tensor = _ExpectedLogSlope.apply(*parameters)
    return normal_entropy(parameters) + log_slope.sum(-1)


class _ExpectedLogSlope(torch.autograd.Function):
    """E[log ½(1 − tanh²(z/2))] for z ~ Normal, elementwise: by 15 nodes, its gradient by the same nodes.

    With log ½(1 − tanh²(z/2)) = log 2 − 2 (|z|/2 + log(1 + exp(−|z|))) and its derivative −tanh(z/2). In NumPy
    and with long inner loops, because PPO evaluates it in every minibatch.
    """

    @staticmethod
    def forward(ctx: Any, loc: Tensor, log_scale: Tensor) -> Tensor:
        nodes, weights = _nodes_and_weights(loc.dtype)
        scale = np.exp(log_scale.numpy()).ravel()
        half = (
            nodes[:, None] * scale
        )  # [N, M], soon z/2; in place, because fresh memory costs more than arithmetic
        half += loc.numpy().ravel()
        half *= 0.5
        slope = np.tanh(half)
        np.abs(half, out=half)
        bend = np.exp(-2 * half)
        bend += 1
        np.log(bend, out=bend)
        bend += half
        log_slope = math.log(2) - 2 * (weights @ bend)
        to_loc, to_log_scale = -weights @ slope, -(weights * nodes) @ slope * scale
        ctx.save_for_backward(*(torch.from_numpy(g).view(loc.shape) for g in (to_loc, to_log_scale)))
        return torch.from_numpy(log_slope).view(loc.shape)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, Tensor]:
        to_loc, to_log_scale = ctx.saved_tensors
        return grads[0] * to_loc, grads[0] * to_log_scale


@functools.cache
def _nodes_and_weights(dtype: torch.dtype) -> tuple[NDArray[Any], NDArray[Any]]:
    nodes, weights = trapezoid(15, 5.0, dtype)
    return nodes.numpy(), weights.numpy()


def beta_entropy(parameters: Parameters) -> Tensor:
    """Return the entropy `[...]` of the unit action 2x − 1, in nats: `ScaledBeta.entropy` at half its cost.

    Example:
        >>> round(beta_entropy(Parameters(torch.ones(1), torch.ones(1))).item(), 4)  # uniform on [−1, 1]: log 2
        0.6931
    """
    alpha, beta = parameters.first.double(), parameters.second.double()
    digammas = (
        (alpha - 1) * torch.digamma(alpha)
        + (beta - 1) * torch.digamma(beta)
        - (alpha + beta - 2) * torch.digamma(alpha + beta)
    )
    entropy = log_beta(alpha, beta) - digammas + math.log(2)
    return entropy.sum(-1).to(parameters.first.dtype)


def beta_median(parameters: Parameters) -> Tensor:
    """Return the medians `[..., A]` of unit actions 2x − 1, by SciPy: torch has no inverse of the incomplete beta."""
    alpha, beta = (x.detach().double() for x in parameters)
    half = torch.from_numpy(np.asarray(betaincinv(alpha.numpy(), beta.numpy(), 0.5)))
    return (2 * half - 1).to(parameters.first.dtype)


def _in_box(parameters: Parameters, low: Tensor, high: Tensor) -> tuple[Tensor, Tensor]:
    """Return location and scale of a Normal latent in the robot's units."""
    half_range = (high - low) / 2
    return (low + high) / 2 + half_range * parameters.first, half_range * parameters.second.exp()


def _logit_normal(parameters: Parameters) -> LogitNormal:
    return LogitNormal(parameters.first, parameters.second.exp(), -1.0, 1.0, validate_args=False)


FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        "gaussian": Family(
            law=NORMAL,
            to_unit=lambda latent, xp: latent,
            entropy_name="differential entropy of the unclipped Normal",
            entropy=normal_entropy,
            greedy={name: lambda p: p.first for name in ("mean", "median", "mode")},
            distribution=lambda p, low, high: Normal(*_in_box(p, low, high)),
        ),
        "clipped-gaussian": Family(
            law=CLIPPED_NORMAL,
            to_unit=lambda latent, xp: laws.clip(latent, -1.0, 1.0),
            entropy_name="entropy of the mixed law of the clipped unit action",
            entropy=lambda p: laws.clipped_normal(p).entropy().sum(-1),
            greedy={
                "mean": lambda p: laws.clipped_normal(p).mean,
                "median": lambda p: laws.clipped_normal(p).median,
                "mode": lambda p: laws.clipped_normal(p).mode,
            },
            distribution=lambda p, low, high: ClippedNormal(*_in_box(p, low, high), low, high),
        ),
        "beta": Family(
            law=BETA,
            to_unit=lambda latent, xp: 2 * latent - 1,
            entropy_name="differential entropy of the unit action",
            entropy=beta_entropy,
            greedy={
                "mean": lambda p: laws.scaled_beta(p).mean,
                "median": beta_median,
                "mode": lambda p: laws.scaled_beta(p).mode,
            },
            distribution=lambda p, low, high: ScaledBeta(*p, low, high),
        ),
        "logit-normal": Family(
            law=NORMAL,
            to_unit=lambda latent, xp: xp.tanh(latent / 2),
            entropy_name="differential entropy of the unit action",
            entropy=logit_normal_entropy,
            greedy={
                "mean": lambda p: _logit_normal(p).mean,
                "median": lambda p: _logit_normal(p).median,
                "mode": lambda p: _logit_normal(p).mode,
            },
            distribution=lambda p, low, high: LogitNormal(p.first, p.second.exp(), low, high),
        ),
    }
)


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
        if self.family not in FAMILIES:
            raise ValueError(f"no policy family {self.family!r}; choose one of {', '.join(FAMILIES)}")
        if self.family == "beta" and not self.state_dependent_std:
            raise ValueError(
                "a Beta has no scale to set free of the state: use state_dependent_std=True with beta"
            )


class Policy:
    """A family bound to a box: everything about actions, nothing about networks.

    Args:
        config: the family and its options.
        low: `[A]` lower bounds of the action, in the robot's units (N·m for the MuJoCo tasks).
        high: `[A]` upper bounds.

    Raises:
        ValueError: the bounds are not finite or not in order.

    Example:
        >>> policy = Policy(PolicyConfig("logit-normal"), low=np.array([-2.0]), high=np.array([4.0]))
        >>> policy.action(np.array([[0.0], [100.0]])).tolist()
        [[1.0], [4.0]]
        >>> outputs = torch.tensor([0.0, -1.0])  # loc and log_scale of one action dimension
        >>> policy.greedy(outputs, "median").tolist()
        [1.0]
    """

    def __init__(self, config: PolicyConfig, low: NDArray[Any], high: NDArray[Any]) -> None:
        low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        if low.ndim != 1 or low.shape != high.shape or not (np.isfinite(low) & np.isfinite(high)).all():
            raise ValueError(
                f"a policy needs finite bounds of shape [A], got low={low.tolist()}, high={high.tolist()}: "
                "wrap the environment so that its action space is a bounded, one-dimensional Box"
            )
        if not (low < high).all():
            raise ValueError(f"low must be below high, got low={low.tolist()}, high={high.tolist()}")
        self.config = config
        self.family = FAMILIES[config.family]
        self.law = self.family.law
        self.low, self.high = low, high
        self.act_dim = len(low)
        self.centre, self.half_range = (high + low) / 2, (high - low) / 2

    def parameters(self, outputs: Array, xp: ModuleType = torch) -> Parameters:
        """Return the law's parameters `[..., A]` for network outputs `[..., 2A]`."""
        return self.law.parameters(outputs, self.config.limits, xp)

    def unit_action(self, latent: Array, xp: ModuleType = np) -> Array:
        """Return the family's map of latents `[..., A]`: unit actions, beyond [−1, 1] only for `gaussian`."""
        return self.family.to_unit(latent, xp)

    def action(self, latent: NDArray[Any]) -> NDArray[Any]:
        """Return the action `[..., A]`, in the robot's units, that latents `[..., A]` stand for, not yet clipped."""
        unit = self.unit_action(latent)
        centre, half_range = self.centre.astype(unit.dtype), self.half_range.astype(unit.dtype)
        return centre + half_range * unit

    def distribution(self, outputs: Tensor) -> Distribution:
        """Return the distribution of the action, elementwise `[..., A]`, in the robot's units and in float64.

        A sum of its `log_prob` over A is the joint log-density. For `gaussian` it is the Normal that is drawn from,
        before any clip.

        Args:
            outputs: `[..., 2A]` of the policy network.
        """
        parameters = Parameters(*(x.double() for x in self.parameters(outputs)))
        return self.family.distribution(parameters, torch.from_numpy(self.low), torch.from_numpy(self.high))

    def entropy(self, outputs: Tensor) -> Tensor:
        """Return the family's bonus entropy `[...]` for outputs `[..., 2A]`, in nats."""
        return self.family.entropy(self.parameters(outputs))

    def greedy(self, outputs: Tensor, by: str) -> NDArray[Any]:
        """Return the greedy action `[..., A]` within the box, in the robot's units.

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
        return np.clip(self.centre + self.half_range * unit, self.low, self.high)
