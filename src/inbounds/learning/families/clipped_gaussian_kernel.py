r"""The clipped Normal's score in compiled loops. Needs numba, the extra `fast`.

Between the bounds it is the Normal's. On a bound the log-probability is log Φ(t), with t = (−1 − μ)/σ on the lower one
and t = (μ − 1)/σ on the upper, and its derivative by t is the ratio φ(t)/Φ(t). The entropy's derivatives follow from

$$ H = −P_l log P_l − P_h log P_h + M₀ (log σ + ½ log 2π) + ½ M₂. $$

Tails are evaluated in float64.
"""

from __future__ import annotations

import math
from typing import Any

from inbounds.learning.families import gaussian_kernel
from inbounds.learning.families.gaussian import HALF_LOG_2PI
from inbounds.learning.families.gaussian_kernel import beyond, clipped
from inbounds.learning.networks.kernels import kernel

_DEEP = -30.0
"""Below it Φ is near the smallest numbers, and its expansion in 1/t² exact to 1e-12."""
_of_the_normal = gaussian_kernel.score


@kernel
def pdf(t: float) -> float:
    """Return φ(t)."""
    return math.exp(-0.5 * t * t - HALF_LOG_2PI)


@kernel
def cdf(t: float) -> float:
    """Return Φ(t), its lower tail included."""
    return 0.5 * math.erfc(-t / math.sqrt(2.0))


@kernel
def deep(t: float) -> float:
    """Return −t Φ(t)/φ(t) far below zero: 1 − 1/t² + 3/t⁴ − 15/t⁶ + 105/t⁸."""
    y = 1.0 / (t * t)
    return 1.0 - y * (1.0 - 3.0 * y * (1.0 - 5.0 * y * (1.0 - 7.0 * y)))


@kernel
def log_cdf(t: float) -> float:
    """Return log Φ(t)."""
    if t < _DEEP:
        return -0.5 * t * t - HALF_LOG_2PI - math.log(-t) + math.log(deep(t))
    return math.log(cdf(t))


@kernel
def log_cdf_slope(t: float) -> float:
    """Return φ(t)/Φ(t), the derivative of log Φ(t)."""
    return -t / deep(t) if t < _DEEP else pdf(t) / cdf(t)


@kernel
def score(outputs: Any, latent: Any, limits: Any, log_prob: Any, slope: Any) -> None:
    """Fill log_prob `[B]`, and slope `[2A, B]` with its derivatives by the outputs `[2A, B]`, at latents `[A, B]`."""
    act_dim, size = latent.shape
    number = latent.dtype.type
    _of_the_normal(outputs, latent, limits, log_prob, slope)
    for a in range(act_dim):
        for b in range(size):
            z = latent[a, b]
            if abs(z) >= number(1):
                raw, loc = outputs[act_dim + a, b], outputs[a, b]
                log_scale = clipped(raw, limits)
                per_scale = math.exp(-log_scale)
                u = (z - loc) * per_scale  # what the Normal's log-density was taken at
                side = -1.0 if z > number(0) else 1.0  # of t by the distance from the bound
                t = side * (-side - float(loc)) * float(per_scale)
                by_t = log_cdf_slope(t)
                log_prob[b] += log_scale + number(HALF_LOG_2PI) + number(0.5) * u * u + number(log_cdf(t))
                slope[a, b] = number(-side * by_t * per_scale)
                slope[act_dim + a, b] = number(0) if beyond(raw, limits) else number(-by_t * t)


@kernel
def entropy_slope(outputs: Any, limits: Any, slope: Any) -> None:
    """Fill slope `[2A, B]` with the derivatives of the mixed law's entropy by the outputs `[2A, B]`."""
    act_dim = outputs.shape[0] // 2
    number = outputs.dtype.type
    for a in range(act_dim):
        for b in range(outputs.shape[1]):
            raw, loc = outputs[act_dim + a, b], float(outputs[a, b])
            log_scale = float(clipped(raw, limits))
            scale = math.exp(log_scale)
            lower, upper = (-1.0 - loc) / scale, (1.0 - loc) / scale
            m0 = cdf(-lower) - cdf(-upper) if lower > 0.0 else cdf(upper) - cdf(lower)
            inside = 1.0 + log_scale + HALF_LOG_2PI
            by_lower = -pdf(lower) * (log_cdf(lower) + inside + 0.5 * lower * lower)
            by_upper = pdf(upper) * (log_cdf(-upper) + inside + 0.5 * upper * upper)
            slope[a, b] = number(-(by_lower + by_upper) / scale)
            by_log_scale = m0 - lower * by_lower - upper * by_upper
            slope[act_dim + a, b] = number(0) if beyond(raw, limits) else number(by_log_scale)
