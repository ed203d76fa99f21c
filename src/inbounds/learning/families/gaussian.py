"""`gaussian`: a Normal whose latent is the unit action itself; the robot clips what leaves [−1, 1]."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.distributions import Normal

from inbounds.learning.families.family import (
    Array,
    Family,
    Limits,
    Parameters,
    Sampler,
    clip,
    halves,
    quantiles,
)

HALF_LOG_2PI = math.log(2 * math.pi) / 2


@dataclass(frozen=True, eq=False)
class NormalParameters(Parameters):
    """Loc μ and log_scale log σ, `[..., A]` each.

    Returned by `NormalLaw`, which has an example.
    """

    loc: Array
    log_scale: Array


class NormalLaw:
    """The diagonal Normal: the law of `gaussian` and of `logit-normal`, which differ by their map alone.

    Example:
        >>> import torch
        >>> from inbounds.learning.families import NORMAL, Limits, NormalParameters
        >>> parameters = NORMAL.parameters(torch.tensor([0.0, 2.0, -20.0, 0.0]), Limits())
        >>> parameters.loc.tolist(), parameters.log_scale.tolist()
        ([0.0, 2.0], [-10.0, 0.0])
        >>> standard = NormalParameters(torch.zeros(2), torch.zeros(2))
        >>> round(NORMAL.log_prob(standard, torch.zeros(2)).item(), 4)  # −log 2π
        -1.8379
        >>> NORMAL.kl(standard, NormalParameters(torch.ones(2), torch.zeros(2))).item()
        1.0
    """

    named = NormalParameters

    def parameters(self, outputs: Array, limits: Limits, xp: ModuleType = torch) -> NormalParameters:
        """Return loc and the clipped log_scale, `[..., A]`, for outputs `[..., 2A]`."""
        loc, log_scale = halves(outputs)
        return NormalParameters(loc, clip(log_scale, limits.log_std_min, limits.log_std_max))

    def sampler(
        self, generators: Sequence[np.random.Generator], horizon: int, act_dim: int, dtype: Any
    ) -> Sampler:
        """Return z = loc + σ ε; the noise ε of the whole rollout is drawn in one call per seed."""
        noise = np.stack([g.standard_normal((horizon, act_dim), dtype) for g in generators], axis=1)

        def draw(parameters: NormalParameters, t: int) -> NDArray[Any]:
            return parameters.loc + np.exp(parameters.log_scale) * noise[t]

        return draw

    def log_prob(self, parameters: NormalParameters, latent: Tensor) -> Tensor:
        """Return Σ_A −½u² − log σ − ½log 2π with u = (z − loc)/σ, `[...]`."""
        loc, log_scale = parameters
        u = (latent - loc) * torch.exp(-log_scale)
        return -torch.addcmul(log_scale, u, u, value=0.5).sum(-1) - HALF_LOG_2PI * latent.shape[-1]

    def kl(self, old: NormalParameters, new: NormalParameters) -> Tensor:
        """Return Σ_A log(σ'/σ) + (σ² + (μ − μ')²)/(2σ'²) − ½ for new primed, `[...]`."""
        shrink = torch.exp(old.log_scale - new.log_scale)  # σ/σ'
        shift = (old.loc - new.loc) * torch.exp(-new.log_scale)
        return (new.log_scale - old.log_scale + (shrink.square() + shift.square() - 1) / 2).sum(-1)

    def describe(self, parameters: NormalParameters, limits: Limits) -> dict[str, NDArray[Any]]:
        """Return quantiles of |μ| and σ, and the shares of log σ at its clips, `[S]` each."""
        loc, log_scale = parameters
        return {
            **quantiles("abs_loc", np.abs(loc), (50, 90, 99)),
            **quantiles("scale", np.exp(log_scale), (1, 50, 99)),
            "at_log_std_min": (log_scale <= limits.log_std_min).mean((1, 2)),
            "at_log_std_max": (log_scale >= limits.log_std_max).mean((1, 2)),
        }


NORMAL = NormalLaw()


def normal_entropy(parameters: NormalParameters) -> Tensor:
    """Return Σ_A log σ + ½ log 2πe, `[...]`: the entropy of the latent Normal, in nats.

    Example:
        >>> import torch
        >>> from inbounds.learning.families import NormalParameters
        >>> round(normal_entropy(NormalParameters(torch.zeros(2), torch.zeros(2))).item(), 4)  # log 2πe
        2.8379
    """
    log_scale = parameters.log_scale
    return log_scale.sum(-1) + (0.5 + HALF_LOG_2PI) * log_scale.shape[-1]


def in_box(parameters: NormalParameters, low: Tensor, high: Tensor) -> tuple[Tensor, Tensor]:
    """Return location and scale of a Normal latent in the robot's units."""
    half_range = (high - low) / 2
    return (low + high) / 2 + half_range * parameters.loc, half_range * parameters.log_scale.exp()


def clipped_std(scale: float) -> float:
    """Return the standard deviation of a centred Normal after a clip to [−1, 1]."""
    if scale > 1e150:  # whose square may overflow; long before, all mass is on the bounds
        return 1.0
    bound = min(1 / scale, 1e150)  # E[u²] = σ² E[ε²; |ε| < 1/σ] + P(|ε| > 1/σ)
    outside = math.erfc(bound / math.sqrt(2))
    density = math.exp(-(bound**2) / 2) / math.sqrt(2 * math.pi)
    inside = scale**2 * (1 - outside - 2 * bound * density)  # of a very wide Normal nothing but rounding
    return math.sqrt(min(max(inside, 0.0) + outside, 1.0))


def normal_scales(limits: Limits) -> tuple[float, float]:
    """Return the least and the largest σ."""
    return math.exp(limits.log_std_min), math.exp(limits.log_std_max)


def normal_head_bias(
    executed_std: Callable[[float], float], std: float, limits: Limits
) -> tuple[float, float]:
    """Return loc 0 and the log_scale whose `executed_std` is std."""
    from scipy.optimize import brentq  # here, because it takes a while

    log_scale = brentq(
        lambda s: executed_std(math.exp(s)) - std, limits.log_std_min, limits.log_std_max, xtol=1e-14
    )
    return 0.0, log_scale


FAMILY = Family(
    name="gaussian",
    law=NORMAL,
    to_unit=lambda latent, xp: latent,
    entropy=normal_entropy,
    greedy={name: lambda p: p.loc for name in ("mean", "median", "mode")},
    distribution=lambda p, low, high: Normal(*in_box(p, low, high)),
    executed_std=clipped_std,
    scales=normal_scales,
    head_bias=lambda std, limits: normal_head_bias(clipped_std, std, limits),
    kernels="inbounds.learning.families.gaussian_kernel",
)
