"""`beta`: a Beta on [0, 1], stretched over [−1, 1] (Chou, Maturana & Scherer 2017)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.distributions import kl_divergence

from inbounds.distributions import ScaledBeta
from inbounds.distributions.scaled_beta import before_softplus, log_beta
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


@dataclass(frozen=True, eq=False)
class BetaParameters(Parameters):
    """The concentrations, α of the upper bound and β of the lower, `[..., A]` each.

    Returned by `BetaLaw`, which has an example.
    """

    concentration1: Array
    concentration0: Array


class BetaLaw:
    """Independent Betas on [0, 1] with α, β = 1 + softplus ≥ 1, capped, hence unimodal.

    Densities and divergences are evaluated in float64: log-gamma cancels.

    Example:
        >>> import torch
        >>> from inbounds.learning.families import BETA, Limits
        >>> parameters = BETA.parameters(torch.tensor([0.0, 1000.0]), Limits())
        >>> [round(x.item(), 4) for x in parameters]  # 1 + log 2, and the cap
        [1.6931, 80.0]
    """

    named = BetaParameters

    def parameters(self, outputs: Array, limits: Limits, xp: ModuleType = torch) -> BetaParameters:
        """Return concentration1 α and concentration0 β, `[..., A]`, for outputs `[..., 2A]`."""
        softplus = torch.nn.functional.softplus(outputs) if xp is torch else np.logaddexp(outputs, 0)
        return BetaParameters(*halves(clip(1 + softplus, 1.0, limits.concentration_max)))

    def sampler(
        self, generators: Sequence[np.random.Generator], horizon: int, act_dim: int, dtype: Any
    ) -> Sampler:
        """Return Betas drawn step by step, kept a rounding error away from 0 and 1; NaN for NaN parameters."""
        margin = float(np.finfo(dtype).epsneg)

        def draw(parameters: BetaParameters, t: int) -> NDArray[Any]:
            latent = np.full((len(generators), act_dim), np.nan)
            for s, generator in enumerate(generators):
                alpha, beta = parameters.concentration1[s], parameters.concentration0[s]
                if np.isfinite(alpha).all() and np.isfinite(beta).all():  # NumPy refuses NaN: a diverged seed
                    latent[s] = generator.beta(alpha, beta)
            return np.clip(latent, margin, 1 - margin).astype(dtype)

        return draw

    def log_prob(self, parameters: BetaParameters, latent: Tensor) -> Tensor:
        """Return Σ_A (α − 1) log x + (β − 1) log(1 − x) − log B(α, β), `[...]`: `ScaledBeta`'s, at half its cost."""
        alpha, beta = parameters.each(Tensor.double)
        x = latent.double()
        shape = (alpha - 1) * torch.log(x) + (beta - 1) * torch.log1p(-x)
        return (shape - log_beta(alpha, beta)).sum(-1).to(latent.dtype)

    def kl(self, old: BetaParameters, new: BetaParameters) -> Tensor:
        """Return KL(old‖new) in closed form, `[...]`."""
        return kl_divergence(scaled_beta(old), scaled_beta(new)).sum(-1)

    def describe(self, parameters: BetaParameters, limits: Limits) -> dict[str, NDArray[Any]]:
        """Return quantiles of α and β, and their shares at the cap, `[S]` each."""
        alpha, beta = parameters
        cap = limits.concentration_max
        return {
            **quantiles("alpha", alpha, (1, 50, 99)),
            **quantiles("beta", beta, (1, 50, 99)),
            "at_alpha_max": (alpha >= cap).mean((1, 2)),
            "at_beta_max": (beta >= cap).mean((1, 2)),
        }


BETA = BetaLaw()


def scaled_beta(parameters: BetaParameters) -> ScaledBeta:
    """Return the law of the unit action 2x − 1, elementwise `[..., A]`."""
    return ScaledBeta(parameters.concentration1, parameters.concentration0, -1.0, 1.0, validate_args=False)


def beta_entropy(parameters: BetaParameters) -> Tensor:
    """Return the entropy `[...]` of the unit action 2x − 1, in nats: `ScaledBeta.entropy` at half its cost.

    Example:
        >>> import torch
        >>> from inbounds.learning.families import BetaParameters
        >>> round(beta_entropy(BetaParameters(torch.ones(1), torch.ones(1))).item(), 4)  # uniform on [−1, 1]: log 2
        0.6931
    """
    alpha, beta = parameters.each(Tensor.double)
    digammas = (
        (alpha - 1) * torch.digamma(alpha)
        + (beta - 1) * torch.digamma(beta)
        - (alpha + beta - 2) * torch.digamma(alpha + beta)
    )
    entropy = log_beta(alpha, beta) - digammas + math.log(2)
    return entropy.sum(-1).to(parameters.concentration1.dtype)


def beta_head_bias(std: float, limits: Limits) -> tuple[float, float]:
    """Return the pre-activations of α = β with sd² = 1/(2α + 1)."""
    pre_activation = before_softplus((1 / std**2 - 1) / 2)
    return pre_activation, pre_activation


FAMILY = Family(
    name="beta",
    law=BETA,
    to_unit=lambda latent, xp: 2 * latent - 1,
    entropy=beta_entropy,
    greedy={
        "mean": lambda p: scaled_beta(p).mean,
        "median": lambda p: scaled_beta(p).median,
        "mode": lambda p: scaled_beta(p).mode,
    },
    distribution=lambda p, low, high: ScaledBeta(p.concentration1, p.concentration0, low, high),
    executed_std=lambda concentration: 1 / math.sqrt(2 * concentration + 1),
    scales=lambda limits: (limits.concentration_max, 1.0),
    head_bias=beta_head_bias,
    kernels="inbounds.learning.families.beta_kernel",
)
