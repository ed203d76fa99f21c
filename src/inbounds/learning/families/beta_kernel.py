r"""The Beta's score in compiled loops, in float64. Needs numba, the extra `fast`.

With s = α + β, ψ the digamma and ψ' the trigamma function,

$$ ∂ log p/∂α = log x − ψ(α) + ψ(s),   ∂H/∂α = (s − 2) ψ'(s) − (α − 1) ψ'(α), $$

likewise for β with log(1 − x), and each is multiplied by the sigmoid, the slope of 1 + softplus, below the cap.
log Γ, ψ and ψ' come from Stirling's series at x + 8 and the recurrences down to x ≥ 1.
"""

from __future__ import annotations

import math
from typing import Any

from inbounds.learning.families.gaussian import HALF_LOG_2PI
from inbounds.learning.networks.kernels import kernel

_LINEAR = 20.0  # where torch's softplus becomes the identity


@kernel
def log_gamma(x: float) -> float:
    """Return log Γ(x), x ≥ 1."""
    product = x * (x + 1.0) * (x + 2.0) * (x + 3.0) * (x + 4.0) * (x + 5.0) * (x + 6.0) * (x + 7.0)
    y = x + 8.0
    v = 1.0 / (y * y)
    series = (
        1 / 12 - v * (1 / 360 - v * (1 / 1260 - v * (1 / 1680 - v * (1 / 1188 - v * 691 / 360360))))
    ) / y
    return (y - 0.5) * math.log(y) - y + HALF_LOG_2PI + series - math.log(product)


@kernel
def digamma(x: float) -> float:
    """Return ψ(x), x ≥ 1."""
    before = 1.0 / x + 1.0 / (x + 1.0) + 1.0 / (x + 2.0) + 1.0 / (x + 3.0)
    before += 1.0 / (x + 4.0) + 1.0 / (x + 5.0) + 1.0 / (x + 6.0) + 1.0 / (x + 7.0)
    y = x + 8.0
    v = 1.0 / (y * y)
    series = v * (1 / 12 - v * (1 / 120 - v * (1 / 252 - v * (1 / 240 - v * (1 / 132 - v * 691 / 32760)))))
    return math.log(y) - 0.5 / y - series - before


@kernel
def trigamma(x: float) -> float:
    """Return ψ'(x), x ≥ 1."""
    before = 0.0
    for k in range(8):
        before += 1.0 / ((x + k) * (x + k))
    y = x + 8.0
    v = 1.0 / (y * y)
    series = v * (1 / 6 - v * (1 / 30 - v * (1 / 42 - v * (1 / 30 - v * (5 / 66 - v * 691 / 2730)))))
    return (1.0 + 0.5 / y + series) / y + before


@kernel
def concentration(raw: float, cap: float) -> tuple[float, float]:
    """Return 1 + softplus(raw), capped, and its slope, which is zero beyond the cap."""
    softplus = raw if raw > _LINEAR else math.log1p(math.exp(raw))
    slope = 1.0 if raw > _LINEAR else 1.0 / (1.0 + math.exp(-raw))
    return (cap, 0.0) if 1.0 + softplus > cap else (1.0 + softplus, slope)


@kernel
def score(outputs: Any, latent: Any, limits: Any, log_prob: Any, slope: Any) -> None:
    """Fill log_prob `[B]`, and slope `[2A, B]` with its derivatives by the outputs `[2A, B]`, at latents `[A, B]`."""
    act_dim, size = latent.shape
    number = latent.dtype.type
    for b in range(size):
        total = 0.0
        for a in range(act_dim):
            alpha, to_alpha = concentration(float(outputs[a, b]), float(limits[2]))
            beta, to_beta = concentration(float(outputs[act_dim + a, b]), float(limits[2]))
            log_x, log_rest = math.log(float(latent[a, b])), math.log1p(-float(latent[a, b]))
            both = digamma(alpha + beta)
            total += (alpha - 1.0) * log_x + (beta - 1.0) * log_rest
            total += log_gamma(alpha + beta) - log_gamma(alpha) - log_gamma(beta)
            slope[a, b] = number(to_alpha * (log_x - digamma(alpha) + both))
            slope[act_dim + a, b] = number(to_beta * (log_rest - digamma(beta) + both))
        log_prob[b] = number(total)


@kernel
def entropy_slope(outputs: Any, limits: Any, slope: Any) -> None:
    """Fill slope `[2A, B]` with the derivatives of the entropy by the outputs `[2A, B]`."""
    act_dim = outputs.shape[0] // 2
    number = outputs.dtype.type
    for a in range(act_dim):
        for b in range(outputs.shape[1]):
            alpha, to_alpha = concentration(float(outputs[a, b]), float(limits[2]))
            beta, to_beta = concentration(float(outputs[act_dim + a, b]), float(limits[2]))
            both = (alpha + beta - 2.0) * trigamma(alpha + beta)
            slope[a, b] = number(to_alpha * (both - (alpha - 1.0) * trigamma(alpha)))
            slope[act_dim + a, b] = number(to_beta * (both - (beta - 1.0) * trigamma(beta)))
