r"""The Normal's score in compiled loops. Needs numba, the extra `fast`.

With u = (z − μ)/σ and s = log σ: log p = −½u² − s − ½ log 2π, hence

$$ ∂ log p/∂μ = u/σ,   ∂ log p/∂s = u² − 1,   ∂H/∂s = 1, $$

and nothing reaches a log σ beyond its limits, as `clip` has it.
"""

from __future__ import annotations

import math
from typing import Any

from inbounds.learning.families.gaussian import HALF_LOG_2PI
from inbounds.learning.networks.kernels import kernel


@kernel
def clipped(raw: Any, limits: Any) -> Any:
    """Return log σ within its limits; NaN stays NaN."""
    raw = limits[0] if raw < limits[0] else raw
    return limits[1] if raw > limits[1] else raw


@kernel
def beyond(raw: Any, limits: Any) -> Any:
    """Return whether log σ is beyond its limits, where nothing reaches it; NaN is not."""
    return raw < limits[0] or raw > limits[1]


@kernel
def score(outputs: Any, latent: Any, limits: Any, log_prob: Any, slope: Any) -> None:
    """Fill log_prob `[B]`, and slope `[2A, B]` with its derivatives by the outputs `[2A, B]`, at latents `[A, B]`."""
    act_dim, size = latent.shape
    number = latent.dtype.type
    one, half = number(1), number(0.5)
    log_prob[:] = number(-HALF_LOG_2PI * act_dim)
    for a in range(act_dim):
        for b in range(size):
            log_scale = clipped(outputs[act_dim + a, b], limits)
            per_scale = math.exp(-log_scale)
            u = (latent[a, b] - outputs[a, b]) * per_scale
            log_prob[b] -= log_scale + half * u * u
            slope[a, b] = u * per_scale
            slope[act_dim + a, b] = u * u - one if not beyond(outputs[act_dim + a, b], limits) else number(0)


@kernel
def entropy_slope(outputs: Any, limits: Any, slope: Any) -> None:
    """Fill slope `[2A, B]` with the derivatives of the entropy by the outputs `[2A, B]`."""
    act_dim = outputs.shape[0] // 2
    number = outputs.dtype.type
    slope[:act_dim] = number(0)
    for a in range(act_dim, 2 * act_dim):
        for b in range(outputs.shape[1]):
            slope[a, b] = number(0) if beyond(outputs[a, b], limits) else number(1)
