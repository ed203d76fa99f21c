r"""The Beta distribution on an interval, as a policy.

With α = concentration1 and β = concentration0, the fraction x = (a − low)/(high − low) has the density

$$ p(x) = x^{α−1} (1 − x)^{β−1} / B(α, β),  B(α, β) = Γ(α) Γ(β) / Γ(α + β), $$

and the action a has p(x)/(high − low). Chou, Maturana & Scherer (2017) proposed it for policies on bounded actions,
with α, β > 1 so that the density has one mode, inside. The KL divergence is

$$ KL(P‖Q) = log B(α', β')/B(α, β) + (α − α') ψ(α) + (β − β') ψ(β) + (α' − α + β' − β) ψ(α + β) $$

for P = Beta(α, β), Q = Beta(α', β'). Its terms are hundreds of nats for concentrations near 80 while the sum is a
hundredth: float32 leaves two digits of it, and none of a smaller one. So everything made of log Γ and ψ is evaluated
in float64 and returned in the type of the parameters.

Where is the location, where the scale? The mode ω and the total concentration κ are such a pair:
α = 1 + ωκ, β = 1 + (1 − ω)κ; see `ScaledBeta.from_mode`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor
from torch.distributions import constraints, register_kl
from torch.nn.functional import logsigmoid

from inbounds.distributions.bounds import SigmoidMapped, TensorLike, as_parameters, require_equal_bounds

__all__ = ["ScaledBeta"]


class ScaledBeta(SigmoidMapped):
    r"""Law of low + (high − low) · x for x ~ Beta(concentration1, concentration0); elementwise.

    **The latent** is the logit z = log x − log(1 − x): it never saturates, where x itself rounds to one. Its law is
    that of the log-ratio of two Gamma variables, which is how it is drawn.

    **Edges of the support.** As in `LogitNormal`: the support is the open interval, a value on a bound or beyond it
    raises under validation and has log-density −inf without, a sample is never on a bound. The *mode* may be:
    a density with a concentration below one grows towards its bound, where no value attains the maximum.

    No `cdf` and `icdf`: torch has no incomplete beta function. The `median`, by SciPy, has no gradient.

    **Accuracy.** Entropy, log-density and KL divergence are differences of numbers as large as the concentrations: in
    float64 their absolute error is about 1e-16 times α + β times its logarithm, 1e-11 at 10⁴ and 1e-4 at 10¹⁰. The
    divergence of two nearly equal laws may come out as far below zero.

    Args:
        concentration1: `[...]` α, positive; weight towards high.
        concentration0: `[...]` β, positive; weight towards low.
        low: `[...]` lower bound, in units of the action.
        high: `[...]` upper bound.
        validate_args: check parameters and values; see `BoundedDistribution`.

    Raises:
        ValueError: parameters or bounds that make no distribution; of bounds the message names the fix.

    Example:
        >>> import torch
        >>> action = ScaledBeta(torch.tensor([2.0, 4.0]), 2.0, low=-1.0, high=1.0)
        >>> [[round(x, 4) for x in centre.tolist()] for centre in (action.mean, action.median, action.mode)]
        [[0.0, 0.3333], [0.0, 0.3724], [0.0, 0.5]]
    """

    arg_constraints: ClassVar[dict[str, constraints.Constraint]] = {
        "concentration1": constraints.positive,
        "concentration0": constraints.positive,
        "low": constraints.dependent,
        "high": constraints.dependent,
    }
    has_rsample = True
    concentration1: Tensor
    concentration0: Tensor

    def __init__(
        self,
        concentration1: TensorLike,
        concentration0: TensorLike,
        low: TensorLike = 0.0,
        high: TensorLike = 1.0,
        validate_args: bool | None = None,
    ) -> None:
        super().__init__(
            concentration1=concentration1,
            concentration0=concentration0,
            low=low,
            high=high,
            validate_args=validate_args,
        )

    @classmethod
    def from_mode(
        cls,
        mode: TensorLike,
        concentration: TensorLike,
        low: TensorLike = 0.0,
        high: TensorLike = 1.0,
        validate_args: bool | None = None,
    ) -> Self:
        """Return the Beta with this mode and total concentration κ: α = 1 + ωκ, β = 1 + (1 − ω)κ.

        ω = (mode − low)/(high − low). κ = 0 is the uniform law; the standard deviation falls like 1/√κ.

        Args:
            mode: `[...]` where the density is highest, in units of the action, within [low, high].
            concentration: `[...]` κ, not negative.
            low: `[...]` lower bound.
            high: `[...]` upper bound.
            validate_args: check parameters and values.

        Raises:
            ValueError: under validation, a mode outside the bounds or a concentration that is negative or infinite.

        Example:
            >>> law = ScaledBeta.from_mode(0.5, 8.0, low=-1.0, high=1.0)
            >>> law.concentration1.item(), law.concentration0.item(), law.mode.item()
            (7.0, 3.0, 0.5)
        """
        given = as_parameters(mode=mode, concentration=concentration, low=low, high=high)
        low, high = given["low"], given["high"]
        towards_high, towards_low = given["mode"] - low, high - given["mode"]
        if validate_args if validate_args is not None else cls._validate_args:
            cls(1.0, 1.0, low, high, True)  # what is wrong with the bounds is not the mode's fault
            if not torch._is_all_true(
                (towards_high >= 0) & (towards_low >= 0)
            ):  # as torch checks, also under vmap
                raise ValueError(
                    f"the mode must lie within [low, high], got {mode}: clip it or move the bounds"
                )
            concentrations = given["concentration"]
            if not torch._is_all_true((concentrations >= 0) & concentrations.isfinite()):
                raise ValueError(
                    f"the concentration must be finite and not negative, got {concentration}: use softplus or exp on "
                    "what feeds it, and clip it"
                )
        per_length = given["concentration"] / (high - low)
        return cls(1 + per_length * towards_high, 1 + per_length * towards_low, low, high, validate_args)

    # ---- the latent (its bijection with the value: SigmoidMapped)

    def rsample_latent(self, sample_shape: Any = (), generator: torch.Generator | None = None) -> Tensor:
        """Return logits z = log G₁ − log G₀, `[*sample_shape, ...]`, with G₁ ~ Gamma(α) and G₀ ~ Gamma(β).

        Each log G is log Gamma(α + 1) + log(U)/α with U uniform (Marsaglia & Tsang 2000, for α < 1): it stays finite
        for α down to 1e-36 in single precision. Differentiable once in the concentrations (implicitly, through torch's
        Gamma sampler), with finite gradients for α from 1e-10 on.
        """
        shape = self._extended_shape(torch.Size(sample_shape))
        return _rsample_log_gamma(self.concentration1.expand(shape), generator) - _rsample_log_gamma(
            self.concentration0.expand(shape), generator
        )

    def log_prob_latent(self, latent: Tensor) -> Tensor:
        """Return log p(a) in nats at a = latent_to_value(latent): the density over *values*, read off the latent.

        (α − 1) log sigmoid(z) + (β − 1) log sigmoid(−z) − log B(α, β) − log(width): exact where the value has
        long saturated.
        """
        dtype = torch.promote_types(latent.dtype, self.low.dtype)
        latent = latent.double()
        return self._log_density(logsigmoid(latent), logsigmoid(-latent)).to(dtype)

    # ---- the density over values

    def log_prob(self, value: Tensor) -> Tensor:
        """Return the log-density at value, `[...]`, in nats; −inf outside the open interval (see the class)."""
        if self._validate_args:
            self._validate_sample(value)
        dtype = torch.promote_types(value.dtype, self.low.dtype)
        above_low, below_high, outside = self._distances(value)
        log_width = self.width.double().log()
        log_density = self._log_density(
            above_low.double().log() - log_width, below_high.double().log() - log_width
        )
        return log_density.masked_fill(outside, -math.inf).to(dtype)

    def entropy(self) -> Tensor:
        """Return the differential entropy `[...]` in nats, the interval's length included."""
        alpha, beta = self._concentrations()
        unit_entropy = (
            log_beta(alpha, beta)
            - (alpha - 1) * torch.digamma(alpha)
            - (beta - 1) * torch.digamma(beta)
            + (alpha + beta - 2) * torch.digamma(alpha + beta)
        )
        return (unit_entropy + self.width.double().log()).to(self.low.dtype)

    # ---- the centre and the spread

    @property
    def mean(self) -> Tensor:
        """`[...]` mean, low + width · α/(α + β); within the bounds, which rounding could leave by a last bit."""
        mean = self.low + self.width * self.concentration1 / (self.concentration1 + self.concentration0)
        return torch.clamp(mean, self.low, self.high)

    @property
    def variance(self) -> Tensor:
        """`[...]` variance, width² · αβ/((α + β)² (α + β + 1))."""
        total = self.concentration1 + self.concentration0
        fraction = self.concentration1 / total
        return self.width.square() * fraction * (self.concentration0 / total) / (total + 1)

    @property
    def median(self) -> Tensor:
        """`[...]` median, by SciPy's inverse of the incomplete beta function: without a gradient, and not for vmap."""
        from scipy.special import betaincinv  # here, because it takes a while

        alpha, beta = (each.detach().cpu().numpy() for each in self._concentrations())
        half = torch.from_numpy(np.asarray(betaincinv(alpha, beta, 0.5))).to(self.low.device)
        median = (self.low.double() + self.width.double() * half).to(self.low.dtype)
        median = torch.where(median.isnan(), self.mean, median)  # beyond 1e16, where SciPy gives up
        return torch.clamp(median, self.low, self.high).detach()

    @property
    def mode(self) -> Tensor:
        """`[...]` where the density is highest: low + width · (α − 1)/(α + β − 2) for α, β ≥ 1.

        At the edges of the parameters:

        * α = β = 1, the uniform law: every value is a mode, the midpoint is returned;
        * one concentration below one: its bound (there the density is infinite);
        * both below one: the bound of the smaller one, where the density grows faster; if equal, high (the upper
          mode, as `LogitNormal` breaks its ties).

        Differentiable for α, β > 1; constant in the other cases.
        """
        alpha, beta = self.concentration1, self.concentration0
        no_pole = (alpha >= 1) & (beta >= 1)
        excess = (alpha - 1) + (beta - 1)  # not α + β − 2, which rounds where both are near one
        peaked = no_pole & (excess > 0)
        inside = (alpha - 1) / torch.where(peaked, excess, torch.ones_like(alpha))
        at_bound = ((beta < 1) & (beta <= alpha)).to(alpha.dtype)
        fraction = torch.where(peaked, inside, torch.where(no_pole, torch.full_like(alpha, 0.5), at_bound))
        fraction = torch.where(excess.isnan(), excess, fraction)  # NaN is no order, and would be a bound
        return torch.where(
            fraction < 0.5, self.low + self.width * fraction, self.high - self.width * (1 - fraction)
        )

    # ---- helpers

    def _concentrations(self) -> tuple[Tensor, Tensor]:
        return self.concentration1.double(), self.concentration0.double()

    def _log_density(self, log_fraction: Tensor, log_complement: Tensor) -> Tensor:
        """Return the log-density over values in float64 from log x and log(1 − x)."""
        alpha, beta = self._concentrations()
        shape = (alpha - 1) * log_fraction + (beta - 1) * log_complement
        return shape - log_beta(alpha, beta) - self.width.double().log()


def log_beta(alpha: Tensor, beta: Tensor) -> Tensor:
    """Return log B(α, β), `[...]`, for float64 α and β: to 1e-13 of the largest of its three terms, which cancel.

    Example:
        >>> import torch
        >>> log_beta(torch.tensor(2.0, dtype=torch.float64), torch.tensor(3.0, dtype=torch.float64)).exp().item() * 12
        1.0
    """
    return torch.lgamma(alpha) + torch.lgamma(beta) - torch.lgamma(alpha + beta)


def before_softplus(concentration: float) -> float:
    """Return the u of a concentration 1 + softplus(u), without overflow; one that rounds to 1 has the least u.

    Example:
        >>> round(before_softplus(1 + math.log(2)), 12)
        0.0
    """
    excess = max(concentration - 1, math.ulp(1.0))
    return excess + math.log(-math.expm1(-excess))


def _rsample_log_gamma(concentration: Tensor, generator: torch.Generator | None) -> Tensor:
    """Return the logarithm of Gamma(concentration, 1) samples."""
    uniform = torch.rand(
        concentration.shape, dtype=concentration.dtype, device=concentration.device, generator=generator
    )
    boosted = torch._standard_gamma(concentration + 1, generator=generator)
    return boosted.log() + torch.log1p(-uniform) / concentration  # 1 − U: torch's uniform may be 0, never 1


@register_kl(ScaledBeta, ScaledBeta)
def _kl_scaled_beta_scaled_beta(p: ScaledBeta, q: ScaledBeta) -> Tensor:
    """Return KL(p‖q) in nats, elementwise, in closed form: evaluated in float64, of the parameters' type."""
    require_equal_bounds(p, q)
    (alpha_p, beta_p), (alpha_q, beta_q) = p._concentrations(), q._concentrations()
    divergence = (
        log_beta(alpha_q, beta_q)
        - log_beta(alpha_p, beta_p)
        + (alpha_p - alpha_q) * torch.digamma(alpha_p)
        + (beta_p - beta_q) * torch.digamma(beta_p)
        + (alpha_q - alpha_p + beta_q - beta_p) * torch.digamma(alpha_p + beta_p)
    )
    return divergence.to(torch.promote_types(p.low.dtype, q.low.dtype))
